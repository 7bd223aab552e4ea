use burn::{
    module::Module,
    nn::{Linear, LinearConfig},
    tensor::{Device, Tensor},
};
use credence_nn::query::{Batch, Encoded, QueryTensors, QueryTrunk, Widths};

/// Numbers that the network says of a query: three of an offset and one of its doubt.
const OUTPUTS: usize = 4;

/// Natural logarithms that a spread is held between: 0.03 mm to 0.7 m in the object's frame.
const LOG_SPREAD: [f64; 2] = [-8.0, 2.0];

/// The network: where, seen from a query point, the surface is nearest, and how sure that is.
#[derive(Module, Debug)]
pub struct SurfaceNetwork {
    trunk: QueryTrunk,
    output: Linear,
}

/// What the network says of queries, those of the first observation first.
#[derive(Debug, Clone)]
pub struct Decoded {
    /// Offset from each query to the nearest point of the surface (queries, 3).
    pub offsets: Tensor<2>,
    /// Logarithm of the expected distance from the surface of where the offset leads (queries).
    pub log_spreads: Tensor<1>,
}

impl SurfaceNetwork {
    /// A network with untrained weights.
    pub fn new(widths: Widths, device: &Device) -> Self {
        Self {
            trunk: QueryTrunk::new(widths, device),
            output: LinearConfig::new(widths.code, OUTPUTS).init(device),
        }
    }

    /// The network on a trunk that has learned another purpose.
    #[must_use]
    pub fn on_trunk(self, trunk: QueryTrunk) -> Self {
        Self { trunk, ..self }
    }

    /// Encodes the observations and answers their queries.
    pub fn forward(&self, batch: &Batch) -> Decoded {
        self.decode(&self.encode(batch), batch.queries())
    }

    /// The observations' codes.
    pub(crate) fn encode(&self, batch: &Batch) -> Encoded {
        self.trunk.encode(batch)
    }

    /// The answers to queries of encoded observations.
    pub(crate) fn decode(&self, encoded: &Encoded, queries: &QueryTensors) -> Decoded {
        let output = self.output.forward(self.trunk.decode(encoded, queries));
        let total = output.dims()[0];
        let [low, high] = LOG_SPREAD;
        Decoded {
            offsets: output.clone().slice([0..total, 0..3]),
            log_spreads: output
                .slice([0..total, 3..OUTPUTS])
                .reshape([total])
                .clamp(low, high),
        }
    }
}
