use burn::tensor::{Device, Tensor, TensorData};
use credence_complete::centersnap::{AutoEncoder, DECODED_POINTS};
use credence_types::{Category, stream};
use rayon::prelude::*;

use super::{
    chamfer::{chamfer, nearest_distances},
    clouds::{Turn, canonical_cloud, training_cloud},
};
use crate::{
    TrainError,
    data::{Mesh, MeshSet, any_category},
    run::{Figures, Task},
};

/// Meshes that are validated at a time.
const TOGETHER: usize = 16;

/// The auto-encoder on clouds drawn from meshes.
pub(super) struct AutoEncoderTask {
    pub(super) meshes: MeshSet,
    pub(super) validation: MeshSet,
    pub(super) seed: u64,
    /// Clouds of a step.
    pub(super) clouds: usize,
    pub(super) device: Device,
}

impl Task for AutoEncoderTask {
    type Network = AutoEncoder;
    type Batch = Vec<Vec<[f32; 3]>>;

    fn parts(&self) -> &'static [&'static str] {
        &["chamfer"]
    }

    fn prepare(&self, step: u64) -> Result<Self::Batch, TrainError> {
        let cloud = |slot| {
            let mut rng = stream(self.seed, &format!("train/autoencoder/{step}/{slot}"));
            let mesh = self.meshes.draw(any_category(&mut rng), &mut rng);
            training_cloud(mesh, DECODED_POINTS, &mut rng)
        };
        Ok((0..self.clouds).into_par_iter().map(cloud).collect())
    }

    fn loss(
        &self,
        network: &AutoEncoder,
        clouds: Self::Batch,
        _step: u64,
    ) -> Result<(Tensor<1>, Vec<Tensor<1>>), TrainError> {
        let latents = network.encode(points(&clouds, &self.device), clouds.len());
        let loss = chamfer(network.decode(latents), &clouds, &self.device)?;
        Ok((loss.clone(), vec![loss]))
    }

    fn figures(&self) -> Vec<String> {
        figure_names()
    }

    fn validate(&self, network: &AutoEncoder) -> Result<Figures, TrainError> {
        evaluate(network, &self.validation)
    }
}

fn figure_names() -> Vec<String> {
    let of = |name: &str| format!("chamfer_mm_{name}");
    let mut names = vec!["chamfer_mm".to_owned()];
    names.extend(Category::ALL.iter().map(|c| of(c.name())));
    names
}

/// Mean distance between meshes' clouds and what is decoded of their latents, both ways, in
/// millimetres at the meshes' sizes: over all meshes and by category.
fn evaluate(network: &AutoEncoder, meshes: &MeshSet) -> Result<Figures, TrainError> {
    let device = Device::flex();
    let mut sums = [(0.0, 0.0); Category::ALL.len()];
    for (number, group) in meshes.meshes().chunks(TOGETHER).enumerate() {
        let clouds: Vec<Vec<[f32; 3]>> = (0..)
            .zip(group)
            .map(|(slot, mesh): (usize, &Mesh)| {
                let mut rng = stream(1, &format!("validate/autoencoder/{number}/{slot}"));
                canonical_cloud(mesh, Turn::NONE, DECODED_POINTS, &mut rng)
            })
            .collect();
        let decoded = network.decode(network.encode(points(&clouds, &device), clouds.len()));
        for (mesh, distance) in group.iter().zip(nearest_distances(&decoded, &clouds)?) {
            let (sum, count) = &mut sums[usize::from(mesh.category.class()) - 1];
            *sum += 1e3 * mesh.diagonal() * distance;
            *count += 1.0;
        }
    }
    let all = sums.iter().map(|(sum, _)| sum).sum::<f64>() / meshes.len() as f64;
    let each = sums.iter().map(|(sum, count)| sum / count);
    Ok(figure_names()
        .into_iter()
        .zip([all].into_iter().chain(each))
        .collect())
}

/// The rows of all clouds.
pub(crate) fn points(clouds: &[Vec<[f32; 3]>], device: &Device) -> Tensor<2> {
    let values: Vec<f32> = clouds
        .iter()
        .flat_map(|c| c.as_flattened())
        .copied()
        .collect();
    let rows = values.len() / 3;
    Tensor::from_data(TensorData::new(values, [rows, 3]), device)
}
