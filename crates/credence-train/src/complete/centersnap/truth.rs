use burn::tensor::{Device, Tensor, TensorData};
use credence_complete::centersnap::{
    AutoEncoder, DECODED_POINTS, LATENT, ObjectPose, StatisticValues, facing, has_front,
};
use rand::Rng;

use super::super::autoencoder::{Turn, canonical_cloud};
use crate::data::{Mesh, Picture, Shown};

/// Pixels, of 320x240, that an object must show to be told of.
const LEAST_PIXELS: usize = 60;

/// Whether the network is to tell of an object: enough of it is seen, its centre too.
pub(super) fn is_told(object: &Shown<'_>) -> bool {
    let (pose, _) = pose(object);
    let [u, v] = pose.pixel();
    let [width, height] = Picture::SIZE.map(|size| size as f64);
    let seen = (0.0..width).contains(&u) && (0.0..height).contains(&v);
    object.pixels >= LEAST_PIXELS && pose.centre_m.z > 0.0 && seen
}

/// Pose in the frame that the network tells of, and the angle by which the mesh is turned into it.
pub(super) fn pose(object: &Shown<'_>) -> (ObjectPose, Turn) {
    let up = object.rotation.column(2).into_owned();
    let rotation = if has_front(object.mesh.category) {
        object.rotation
    } else {
        facing(up, object.centre_m)
    };
    let turn = rotation.transpose() * object.rotation;
    let pose = ObjectPose {
        rotation,
        centre_m: object.centre_m,
        scale_m: object.scale * object.mesh.diagonal(),
    };
    let turn = Turn {
        yaw_rad: turn[(1, 0)].atan2(turn[(0, 0)]),
        ..Turn::NONE
    };
    (pose, turn)
}

/// The latents of meshes, in the unit of the statistics.
pub(super) struct Shapes {
    pub(super) autoencoder: AutoEncoder,
    pub(super) statistics: StatisticValues,
}

impl Shapes {
    /// The latent of a mesh turned into the frame that the network tells of.
    pub(super) fn latent(&self, mesh: &Mesh, turn: Turn, rng: &mut impl Rng) -> [f32; LATENT] {
        let StatisticValues {
            latent_mean,
            latent_scale,
            ..
        } = &self.statistics;
        let mut latent = raw_latent(&self.autoencoder, mesh, turn, rng);
        for (value, mean) in latent.iter_mut().zip(latent_mean) {
            *value = (*value - mean) / latent_scale;
        }
        latent
    }
}

/// The latent of a mesh as the auto-encoder gives it.
pub(super) fn raw_latent(
    autoencoder: &AutoEncoder,
    mesh: &Mesh,
    turn: Turn,
    rng: &mut impl Rng,
) -> [f32; LATENT] {
    let cloud = canonical_cloud(mesh, turn, DECODED_POINTS, rng);
    let values = TensorData::new(cloud.as_flattened().to_vec(), [cloud.len(), 3]);
    let latent = autoencoder.encode(Tensor::from_data(values, &Device::flex()), 1);
    let mut slots = [0.0; LATENT];
    for (slot, value) in slots.iter_mut().zip(latent.into_data().iter::<f32>()) {
        *slot = value;
    }
    slots
}
