use std::path::Path;

use burn::tensor::Device;
use credence_nn::weights;
use credence_types::{Completion, Frame, Instance};
use rayon::prelude::*;

use super::{
    associate::associate,
    autoencoder::AutoEncoder,
    detect::{CenterSnap, Detection},
    image::of_frame,
    network::CenterSnapNetwork,
};
use crate::{
    CompleteError, Completer, Uncompleted, completer::check_measured, even_order, observed_points,
};

/// The weights that come with the crate.
const NETWORK: &[u8] = include_bytes!("../../../../assets/weights/centersnap.safetensors");
const AUTOENCODER: &[u8] = include_bytes!("../../../../assets/weights/autoencoder.safetensors");

impl CenterSnap {
    /// The networks that come with the crate.
    ///
    /// # Errors
    /// None, unless the crate was built with weights of other networks.
    pub fn embedded() -> Result<Self, CompleteError> {
        let device = Device::flex();
        let bytes = |weights: &[u8]| weights.to_vec();
        let name = "the built-in centersnap.safetensors";
        let network = CenterSnapNetwork::new(&device);
        let network = weights::from_bytes(network, bytes(NETWORK), name)?;
        let name = "the built-in autoencoder.safetensors";
        let autoencoder = AutoEncoder::new(&device);
        let autoencoder = weights::from_bytes(autoencoder, bytes(AUTOENCODER), name)?;
        Ok(Self::new(network, autoencoder))
    }

    /// The network whose weights are in a file, and the auto-encoder's in `autoencoder.safetensors`
    /// beside it.
    ///
    /// # Errors
    /// A file that is missing, damaged, or holds another network's weights.
    pub fn from_file(path: &Path) -> Result<Self, CompleteError> {
        let device = Device::flex();
        let network = weights::load(CenterSnapNetwork::new(&device), path)?;
        let autoencoder = path.with_file_name("autoencoder.safetensors");
        let autoencoder = weights::load(AutoEncoder::new(&device), &autoencoder)?;
        Ok(Self::new(network, autoencoder))
    }

    /// The objects in a frame, the surest first; none if there is none in view.
    ///
    /// # Errors
    /// None that a CPU gives.
    pub fn detect(&self, frame: &Frame) -> Result<Vec<Detection>, CompleteError> {
        self.detections(&self.look(&of_frame(frame))?)
    }
}

impl Completer for CenterSnap {
    fn complete(
        &self,
        frame: &Frame,
        instances: &[Instance],
    ) -> Result<Vec<Result<Completion, Uncompleted>>, CompleteError> {
        let measured: Vec<usize> = instances
            .iter()
            .map(|instance| Ok(observed_points(frame, instance)?.len()))
            .collect::<Result<_, CompleteError>>()?;
        if instances.is_empty() {
            return Ok(Vec::new());
        }
        let detections = self.detect(frame)?;
        let associated = associate(frame, instances, &detections);
        Ok(measured
            .into_par_iter()
            .zip(associated)
            .map(|(found, detection)| {
                check_measured(found)?;
                let index = detection.ok_or(Uncompleted::NotDetected)?;
                Ok(completion(&detections[index]))
            })
            .collect())
    }
}

/// A detection's cloud in an even order.
fn completion(detection: &Detection) -> Completion {
    let points = &detection.points_camera;
    let order = even_order(points, points.len());
    Completion {
        category: detection.category,
        score: detection.score,
        points_camera: order.iter().map(|index| points[*index]).collect(),
        spread_m: order
            .iter()
            .map(|index| detection.spread_m[*index])
            .collect(),
    }
}
