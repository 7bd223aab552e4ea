use burn::tensor::Device;
use credence_nn::{
    query::{Batch, Encoded, QueryTensors, Sample, Support},
    read,
};
use rayon::prelude::*;

use super::SurfaceNetwork;
use crate::CompleteError;

/// Queries that are worked on at a time: their layers fit in a core's cache.
const CHUNK: usize = 256;

/// What the network says of one query, in the units of the object's frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Answer {
    /// To the surface's nearest point.
    pub(super) offset: [f32; 3],
    /// Expected distance from the surface of where the offset leads.
    pub(super) spread: f32,
}

/// The network, with an observation in mind.
pub(super) struct Field<'a> {
    network: &'a SurfaceNetwork,
    support: Support,
    encoded: Encoded,
    device: Device,
}

impl<'a> Field<'a> {
    pub(super) fn new(
        network: &'a SurfaceNetwork,
        support: Support,
    ) -> Result<Self, CompleteError> {
        let device = Device::flex();
        let batch = Batch::new(&[Sample::new(&support, &[])?], &device)?;
        Ok(Self {
            encoded: network.encode(&batch),
            network,
            support,
            device,
        })
    }

    /// An answer to each query; it depends on no other query.
    pub(super) fn ask(&self, queries: &[[f32; 3]]) -> Result<Vec<Answer>, CompleteError> {
        let chunks = queries.par_chunks(CHUNK).map(|queries| {
            let tensors = QueryTensors::of(&self.support, queries, &self.device)?;
            let decoded = self.network.decode(&self.encoded, &tensors);
            let offsets = read(decoded.offsets)?;
            let spreads = read(decoded.log_spreads.exp())?;
            let (offsets, _) = offsets.as_chunks::<3>();
            let answers = offsets.iter().zip(spreads);
            Ok(answers
                .map(|(offset, spread)| Answer {
                    offset: *offset,
                    spread,
                })
                .collect())
        });
        let chunks: Result<Vec<Vec<Answer>>, CompleteError> = chunks.collect();
        Ok(chunks?.concat())
    }
}
