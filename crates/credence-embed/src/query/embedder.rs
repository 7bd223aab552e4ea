use std::path::Path;

use burn::tensor::Device;
use credence_nn::{
    query::{Batch, QueryTensors, REACH, Sample, Support, Widths},
    read, weights,
};
use credence_types::{ObjectFrame, Observation, Point, all_finite, thinned};
use rayon::prelude::*;

use super::{CATEGORIES, QueryNetwork};
use crate::EmbedError;

/// The weights that come with the crate.
const WEIGHTS: &[u8] = include_bytes!("../../../../assets/weights/query.safetensors");

/// Support points of a kind that are looked at; more are thinned at random.
const MOST: usize = 2048;

/// Queries that are worked on at a time: their layers fit in a core's cache.
const CHUNK: usize = 256;

/// Logit of a point beyond reach, where the network was never asked: as free as its surest points.
const FAR_LOGIT: f64 = -10.0;

/// A query's place in the metric space: sigmoid(logit) times the direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct QueryEmbedding {
    /// Log odds that the point lies on the object's surface.
    pub logit: f64,
    /// Unit vector; the nearer a category's anchor, the likelier the category.
    pub direction: [f64; 3],
}

/// The trained network, ready to be asked.
#[derive(Debug)]
pub struct QueryEmbedder {
    network: QueryNetwork,
    device: Device,
}

impl QueryEmbedder {
    /// The network that comes with the crate.
    ///
    /// # Errors
    /// None, unless the crate was built with weights of another network.
    pub fn embedded() -> Result<Self, EmbedError> {
        let device = Device::flex();
        let network = QueryNetwork::new(Widths::default(), &device);
        let network =
            weights::from_bytes(network, WEIGHTS.to_vec(), "the built-in query.safetensors")?;
        Ok(Self::new(network))
    }

    /// The network whose weights are in a file.
    ///
    /// # Errors
    /// A file that is missing, truncated, or holds another network's weights.
    pub fn from_file(path: &Path) -> Result<Self, EmbedError> {
        let network = QueryNetwork::new(Widths::default(), &Device::flex());
        Ok(Self::new(weights::load(network, path)?))
    }

    /// A network at hand.
    pub fn new(network: QueryNetwork) -> Self {
        Self {
            network,
            device: Device::flex(),
        }
    }

    /// Unit vectors of the categories, in their order.
    ///
    /// # Errors
    /// None that a CPU gives.
    pub fn anchors(&self) -> Result<[[f64; 3]; CATEGORIES], EmbedError> {
        let values = read(self.network.anchors())?;
        let mut anchors = [[0.0; 3]; CATEGORIES];
        for (slot, value) in anchors.as_flattened_mut().iter_mut().zip(values) {
            *slot = f64::from(value);
        }
        Ok(anchors)
    }

    /// Embeds query points, world metres, given an observation.
    ///
    /// The result depends on the points alone: not on their order, the number of threads or
    /// earlier calls.
    ///
    /// # Errors
    /// An observation without object or free points; a coordinate that is not finite.
    pub fn embed(
        &self,
        observation: &Observation,
        queries: &[Point],
    ) -> Result<Vec<QueryEmbedding>, EmbedError> {
        all_finite("object", &observation.object)?;
        all_finite("free", &observation.free)?;
        all_finite("queries", queries)?;
        let object = thinned(&observation.object, MOST, "embed/query/object");
        let viewpoint = observation.viewpoint;
        let frame = ObjectFrame::new(&object, viewpoint, observation.table_height_m)?;
        let to_frame = |point: &Point| frame.locate(point).map(narrow);
        let free = thinned(&observation.free, MOST, "embed/query/free");
        let support = Support::new(
            object.iter().map(to_frame).collect(),
            free.iter().map(to_frame).collect(),
        )?;
        let batch = Batch::new(&[Sample::new(&support, &[])?], &self.device)?;
        let encoded = self.network.encode(&batch);
        let queries: Vec<[f32; 3]> = queries.iter().map(to_frame).collect();
        let chunks = queries.par_chunks(CHUNK).map(|queries| {
            let tensors = QueryTensors::of(&support, queries, &self.device)?;
            let decoded = self.network.decode(&encoded, &tensors);
            let logits = read(decoded.logits)?;
            let directions = read(decoded.directions)?;
            let answers = logits.iter().zip(directions.chunks_exact(3)).zip(queries);
            Ok(answers.map(|((l, u), q)| answer(*l, u, *q)).collect())
        });
        let chunks: Result<Vec<Vec<QueryEmbedding>>, EmbedError> = chunks.collect();
        Ok(chunks?.concat())
    }
}

/// In single precision, where a coordinate light years away would be infinite: a hundred
/// kilometres are as far beyond reach.
fn narrow(coordinate: f64) -> f32 {
    coordinate.clamp(-1e6, 1e6) as f32
}

fn answer(logit: f32, direction: &[f32], query: [f32; 3]) -> QueryEmbedding {
    let far = query.iter().map(|c| c * c).sum::<f32>() > REACH * REACH;
    QueryEmbedding {
        logit: if far { FAR_LOGIT } else { f64::from(logit) },
        direction: [0, 1, 2].map(|axis| f64::from(direction[axis])),
    }
}
