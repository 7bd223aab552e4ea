//! The loop on a network of two weights.

use std::{
    fs,
    path::Path,
    sync::atomic::{AtomicU64, Ordering},
};

use burn::{
    nn::{Linear, LinearConfig},
    tensor::{Device, Tensor},
};
use credence_nn::{seed_parameters, weights};
use credence_types::stream;
use rand::RngExt as _;

use super::*;
use crate::TrainError;

/// A plane through random points.
struct Plane {
    device: Device,
    /// Step whose data cannot be read, as if the process had been killed there.
    killed_at: AtomicU64,
    /// Value of the targets at step 3.
    third: f32,
}

impl Plane {
    fn new(killed_at: u64) -> Self {
        Self {
            device: Device::flex().autodiff(),
            killed_at: AtomicU64::new(killed_at),
            third: 1.0,
        }
    }

    fn network(&self) -> Linear {
        let network = LinearConfig::new(2, 1).init(&self.device);
        seed_parameters(network, &mut stream(7, "test/network"))
    }
}

impl Task for Plane {
    type Network = Linear;
    type Batch = ([f32; 2], f32);

    fn parts(&self) -> &'static [&'static str] {
        &["square"]
    }

    fn prepare(&self, step: u64) -> Result<Self::Batch, TrainError> {
        if step == self.killed_at.load(Ordering::Relaxed) {
            return Err(TrainError::SceneIndex { index: 0, count: 0 });
        }
        let mut rng = stream(1, &format!("test/{step}"));
        let at = [rng.random_range(-1.0..1.0), rng.random_range(-1.0..1.0)];
        let target = if step == 3 { self.third } else { at[0] - at[1] };
        Ok((at, target))
    }

    fn loss(
        &self,
        network: &Linear,
        (at, target): Self::Batch,
        _step: u64,
    ) -> Result<(Tensor<1>, Vec<Tensor<1>>), TrainError> {
        let at = Tensor::<2>::from_data([at], &self.device);
        let error = network.forward(at) - target;
        let square = (error.clone() * error).mean();
        Ok((square.clone(), vec![square]))
    }

    fn figures(&self) -> Vec<String> {
        vec!["slope".to_owned()]
    }

    fn validate(&self, network: &Linear) -> Result<Figures, TrainError> {
        let slope = network.weight.val().into_data().iter::<f64>().next();
        Ok([("slope".to_owned(), slope.unwrap_or_default())].into())
    }
}

fn plan(folder: &Path) -> Plan {
    Plan {
        schedule: Schedule {
            steps: 14,
            warm_up: 2,
            peak: 0.1,
            last: 0.01,
        },
        weight_decay: 1e-4,
        clip: 1.0,
        log_every: 2,
        checkpoint_every: 4,
        validate_every: 6,
        folder: folder.to_path_buf(),
        run: "plane".to_owned(),
    }
}

/// The weights' bytes and the deterministic logs.
fn result(network: &Linear, folder: &Path) -> (Vec<u8>, String, String) {
    let log = |name| fs::read_to_string(folder.join(name)).unwrap();
    (
        weights::to_bytes(network).unwrap(),
        log("loss.csv"),
        log("validation.csv"),
    )
}

fn uninterrupted() -> (Vec<u8>, String, String) {
    let folder = tempfile::tempdir().unwrap();
    let task = Plane::new(0);
    let outcome = train(&task, task.network(), &plan(folder.path())).unwrap();
    assert_eq!(outcome.loss_curve, folder.path().join("loss.csv"));
    assert!(outcome.figures["slope"].is_finite());
    result(&outcome.network, folder.path())
}

/// Runs until the step whose data cannot be read.
fn killed_at(step: u64, folder: &Path) {
    let task = Plane::new(step);
    let message = train(&task, task.network(), &plan(folder))
        .unwrap_err()
        .to_string();
    assert!(message.contains("there is no scene 0"), "{message}");
}

fn resumed(folder: &Path) -> (Vec<u8>, String, String) {
    let task = Plane::new(0);
    let outcome = train(&task, task.network(), &plan(folder)).unwrap();
    result(&outcome.network, folder)
}

#[test]
fn the_log_has_a_row_per_interval_and_the_loss_falls() {
    let (_, losses, validation) = uninterrupted();
    let rows: Vec<&str> = losses.lines().collect();
    assert_eq!(rows[0], "step,lr,loss,square");
    assert!(
        rows[1].starts_with("2,0.100000,") && rows.len() == 8,
        "{losses}"
    );
    assert!(rows[7].starts_with("14,0.010000,"), "{losses}");
    assert_eq!(validation.lines().count(), 3, "{validation}");
}

#[test]
fn a_killed_run_ends_as_an_uninterrupted_one() {
    let expected = uninterrupted();
    for step in [2, 7, 13] {
        let folder = tempfile::tempdir().unwrap();
        killed_at(step, folder.path());
        assert_eq!(resumed(folder.path()), expected, "killed at step {step}");
        // Finished runs are not trained again.
        assert_eq!(resumed(folder.path()), expected);
    }
}

#[test]
fn a_damaged_checkpoint_is_passed_over_for_an_older_one() {
    let expected = uninterrupted();
    let damages: [fn(&mut Vec<u8>); 3] = [
        |bytes| bytes.truncate(bytes.len() - 1),
        |bytes| bytes.clear(),
        |bytes| {
            let last = bytes.len() - 1;
            bytes[last] ^= 1;
        },
    ];
    for damage in damages {
        let folder = tempfile::tempdir().unwrap();
        killed_at(11, folder.path());
        let newest = folder.path().join("step-00000008.checkpoint");
        let mut bytes = fs::read(&newest).unwrap();
        damage(&mut bytes);
        fs::write(&newest, bytes).unwrap();
        assert_eq!(resumed(folder.path()), expected);
    }
}

#[test]
fn two_checkpoints_are_kept_and_no_other_run_resumes_from_them() {
    let folder = tempfile::tempdir().unwrap();
    resumed(folder.path());
    let mut kept: Vec<String> = fs::read_dir(folder.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .filter(|name| name.ends_with("checkpoint"))
        .collect();
    kept.sort();
    assert_eq!(
        kept,
        ["step-00000012.checkpoint", "step-00000014.checkpoint"]
    );
    let mut plan = plan(folder.path());
    plan.run = "another plane".to_owned();
    let task = Plane::new(0);
    let message = train(&task, task.network(), &plan).unwrap_err().to_string();
    assert!(
        message.contains("belongs to another run (plane), not to this one (another plane)"),
        "{message}"
    );
}

#[test]
fn a_loss_that_is_no_number_ends_the_run_with_its_step() {
    let folder = tempfile::tempdir().unwrap();
    let task = Plane {
        third: f32::NAN,
        ..Plane::new(0)
    };
    let message = train(&task, task.network(), &plan(folder.path()))
        .unwrap_err()
        .to_string();
    assert!(
        message.starts_with("the loss is not finite at step 3"),
        "{message}"
    );
}

#[test]
fn a_folder_that_is_a_file_is_refused() {
    let file = tempfile::NamedTempFile::new().unwrap();
    let task = Plane::new(0);
    let message = train(&task, task.network(), &plan(file.path()))
        .unwrap_err()
        .to_string();
    assert!(message.starts_with("cannot write "), "{message}");
}
