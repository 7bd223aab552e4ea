use burn::tensor::Device;
use credence_complete::centersnap::{AutoEncoder, CenterSnapNetwork};
use credence_nn::{seed_parameters, weights};
use credence_types::stream;

use super::{
    calibrate::{calibrate, latent_statistics},
    task::CenterSnapTask,
    truth::Shapes,
};
use crate::{
    TrainError,
    command::{RunArgs, text},
    data::MeshSet,
    run::train,
};

/// Trains the network on pictures of the meshes, measures its errors and writes its weights. The
/// auto-encoder's weights lie beside them: its latents are what the network learns.
///
/// # Errors
/// No auto-encoder, meshes that cannot be used, folders that cannot be written, checkpoints of
/// another run, a loss that diverges.
pub(crate) fn run(args: &RunArgs, steps: Option<u64>) -> Result<(), TrainError> {
    let run = args.begin("centersnap", steps.unwrap_or(args.pick(6000, 6)))?;
    let device = Device::flex().autodiff();
    let autoencoder = weights::load(
        AutoEncoder::new(&Device::flex()),
        &args.out.with_file_name("autoencoder.safetensors"),
    )?;
    let meshes = MeshSet::open(&args.meshes)?;
    let statistics = latent_statistics(&autoencoder, &meshes);
    let task = CenterSnapTask {
        validation: MeshSet::open(&args.validation)?,
        shapes: Shapes {
            autoencoder,
            statistics,
        },
        meshes,
        seed: args.seed,
        pictures: args.pick(8, 2) as usize,
        trials: args.pick(120, 4) as usize,
        device: device.clone(),
    };
    let network = CenterSnapNetwork::new(&device);
    let network = seed_parameters(network, &mut stream(args.seed, "train/centersnap/weights"));
    let mut outcome = train(&task, network, &run.plan(1000))?;
    let pictures = args.pick(200, 4) as usize;
    let (network, figures) = calibrate(&outcome.network, &task.shapes, &task.validation, pictures)?;
    outcome.network = network;
    outcome.figures.extend(figures);
    let bytes = weights::to_bytes(&outcome.network)?;
    let numbers = [
        ("mesh_count", task.meshes.len()),
        ("validation_mesh_count", task.validation.len()),
        ("validation_pictures", task.trials),
    ];
    run.finish_with(outcome, &bytes, text(numbers))
}
