use burn::tensor::Device;
use credence_complete::centersnap::AutoEncoder;
use credence_nn::{seed_parameters, weights};
use credence_types::stream;

use super::task::AutoEncoderTask;
use crate::{
    TrainError,
    command::{RunArgs, text},
    data::MeshSet,
    run::train,
};

/// Trains the auto-encoder and writes its weights, in half precision: in single precision the last
/// layer alone would be 25 MB.
///
/// # Errors
/// Meshes that cannot be used, folders that cannot be written, checkpoints of another run, a loss
/// that diverges.
pub(crate) fn run(args: &RunArgs, steps: Option<u64>) -> Result<(), TrainError> {
    let run = args.begin("autoencoder", steps.unwrap_or(args.pick(4000, 10)))?;
    let device = Device::flex().autodiff();
    let task = AutoEncoderTask {
        meshes: MeshSet::open(&args.meshes)?,
        validation: MeshSet::open(&args.validation)?,
        seed: args.seed,
        clouds: args.pick(32, 4) as usize,
        device: device.clone(),
    };
    let network = AutoEncoder::new(&device);
    let network = seed_parameters(network, &mut stream(args.seed, "train/autoencoder/weights"));
    let outcome = train(&task, network, &run.plan(500))?;
    let bytes = weights::to_half_bytes(&outcome.network)?;
    let numbers = [
        ("mesh_count", task.meshes.len()),
        ("validation_mesh_count", task.validation.len()),
    ];
    run.finish_with(outcome, &bytes, text(numbers))
}
