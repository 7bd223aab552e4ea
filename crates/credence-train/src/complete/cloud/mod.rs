//! Training of the completer of partial clouds.

mod evaluate;
mod example;
mod losses;
mod task;

use burn::tensor::Device;
use credence_complete::cloud::SurfaceNetwork;
use credence_embed::query::{QueryNetwork, Widths};
use credence_nn::{seed_parameters, weights};
use credence_types::stream;
use std::path::Path;
use task::SurfaceTask;

use crate::{TrainError, command::RunArgs, run::train};

/// Trains and writes the weights. The trunk starts from the query network's weights beside them,
/// which has learned to read the same observations; without such a file it starts at random.
pub(super) fn run(args: &RunArgs, steps: Option<u64>) -> Result<(), TrainError> {
    let run = args.begin("cloud", steps.unwrap_or(args.pick(8_000, 40)))?;
    let device = Device::flex().autodiff();
    let task = SurfaceTask {
        scenes: run.training()?,
        validation: run.validation()?,
        seed: args.seed,
        observations: args.pick(24, 4) as usize,
        queries: 256,
        device: device.clone(),
    };
    let widths = Widths::default();
    let mut rng = stream(args.seed, "train/cloud/weights");
    let network = SurfaceNetwork::new(widths, &device);
    let mut network = seed_parameters(network, &mut rng);
    let query = args.out.with_file_name("query.safetensors");
    if query.exists() {
        let trained = weights::load(QueryNetwork::new(widths, &device), Path::new(&query))?;
        network = network.on_trunk(trained.into_trunk());
    }
    let outcome = train(&task, network, &run.plan(1000))?;
    run.finish(outcome, &task.validation)
}
