use std::{
    path::PathBuf,
    sync::atomic::{AtomicUsize, Ordering},
};

use super::{MeshSet, SceneCache};
use crate::TrainError;

/// Generates training scenes, or completes a folder of them.
#[derive(Debug, Clone, clap::Args)]
pub struct DataCommand {
    /// Folder of meshes, as `harness assets` makes it
    #[arg(long)]
    meshes: PathBuf,
    /// Folder for the scenes
    #[arg(long)]
    out: PathBuf,
    /// Number of scenes
    #[arg(long, default_value_t = 30_000)]
    count: usize,
    /// Seed that every scene is drawn from
    #[arg(long, default_value_t = 0)]
    seed: u64,
}

impl DataCommand {
    /// Runs the command; `log` takes a line at every twentieth of the way, from any thread.
    ///
    /// # Errors
    /// Those of [`MeshSet::open`] and [`SceneCache::open_or_generate`].
    pub fn run(&self, log: &(dyn Fn(&str) + Sync)) -> Result<(), TrainError> {
        let meshes = MeshSet::open(&self.meshes)?;
        log(&format!(
            "{} meshes in {}",
            meshes.len(),
            self.meshes.display()
        ));
        let twentieths = AtomicUsize::new(0);
        let progress = |done: usize| {
            let reached = 20 * done / self.count;
            if twentieths.fetch_max(reached, Ordering::Relaxed) < reached {
                log(&format!("{done} of {} scenes", self.count));
            }
        };
        SceneCache::open_or_generate(&self.out, &meshes, self.count, self.seed, &progress)?;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::{super::tests::boxes, *};

    #[test]
    fn the_command_fills_a_folder_and_says_how_far_it_is() {
        let (meshes, _) = boxes();
        let out = tempfile::tempdir().unwrap();
        let command = DataCommand {
            meshes: meshes.path().to_path_buf(),
            out: out.path().join("cache"),
            count: 3,
            seed: 0,
        };
        let lines = Mutex::new(Vec::new());
        let log = |line: &str| lines.lock().unwrap().push(line.to_owned());
        command.run(&log).unwrap();
        let lines = lines.into_inner().unwrap();
        assert!(lines[0].starts_with("12 meshes in "));
        assert_eq!(lines.last().unwrap(), "3 of 3 scenes");
        let cache = SceneCache::open_or_generate(
            &command.out,
            &MeshSet::open(&command.meshes).unwrap(),
            3,
            0,
            &|_| (),
        );
        assert_eq!(cache.unwrap().len(), 3);
    }
}
