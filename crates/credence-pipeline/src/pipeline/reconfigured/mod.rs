#[cfg(test)]
mod tests;

use std::sync::Arc;

use super::{Foreign, Pipeline};
use crate::{
    ChosenSegmenter, Config, PipelineError, completers::Completers, completion::Completions,
    embedders::Embedders,
};

impl Pipeline {
    /// A pipeline that stands where this one does, under another configuration of the stages after
    /// the map: it holds a copy of the map, and neither changes the other from then on. Its
    /// [times](Self::times) are of what it does itself.
    ///
    /// It holds the completions too if `completer`, `[completion]` and, with the completer "cloud",
    /// `metric.table_height_m` are the same: all that shapes what single views give. Otherwise
    /// the frames must be [completed again](Self::complete_frame), unless the completer is "none".
    ///
    /// A stage that stays the same and is not among `foreign` is shared with this pipeline.
    ///
    /// # Errors
    /// Another `segmenter`, `[segmentation]` or `[map]`, a setting outside its range, a file of
    /// weights that cannot be read, a completer in Python for which there is none from outside.
    pub fn reconfigured(&self, config: Config, foreign: Foreign) -> Result<Self, PipelineError> {
        config.check()?;
        self.config.check_maps_as(&config)?;
        let keeps_completions = Completers::are_alike(&self.config, &config);
        let completers = match foreign.completer {
            None if keeps_completions => self.completers.clone(),
            completer => Completers::new(&config, completer)?,
        };
        let completed_frames = match (keeps_completions, completers.is_none()) {
            (true, _) => self.completed_frames,
            (false, true) => self.frames.len(),
            (false, false) => 0,
        };
        Ok(Self {
            segmenter: match foreign.segmenter {
                None => Arc::clone(&self.segmenter),
                segmenter => Arc::new(ChosenSegmenter::new(&config, segmenter)?),
            },
            completers,
            map: self.map.clone(),
            viewpoints: self.viewpoints.clone(),
            completions: if keeps_completions {
                self.completions.clone()
            } else {
                Completions::default()
            },
            frames: self.frames.clone(),
            completed_frames,
            embedders: Embedders::new(&config.metric)?,
            times: Vec::new(),
            config,
        })
    }
}
