use burn::{
    module::{Module, Param},
    nn::{Linear, LinearConfig},
    tensor::{Device, Tensor, TensorData},
};
use credence_nn::query::{Batch, QueryTensors, QueryTrunk, Widths};
use credence_types::Category;

/// Number of categories that the directions tell apart.
pub const CATEGORIES: usize = Category::ALL.len();

/// Where the categories' anchors start: the corners of an octahedron, the six directions that are
/// farthest apart.
const FIRST_ANCHORS: [[f32; 3]; CATEGORIES] = [
    [1.0, 0.0, 0.0],
    [-1.0, 0.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.0, -1.0, 0.0],
    [0.0, 0.0, 1.0],
    [0.0, 0.0, -1.0],
];

/// Norms are kept above this, so that a zero vector has a direction with a gradient.
const SMALL: f64 = 1e-6;

/// The network: a trunk and what it is asked for, a logit and a direction.
#[derive(Module, Debug)]
pub struct QueryNetwork {
    trunk: QueryTrunk,
    output: Linear,
    class_head: Linear,
    anchors: Param<Tensor<2>>,
}

/// What the network knows of observations before it is asked about a point.
#[derive(Debug, Clone)]
pub struct Encoded {
    trunk: credence_nn::query::Encoded,
    /// Logits of each observation's category (observations, categories).
    pub class_logits: Tensor<2>,
}

/// What the network says of queries, those of the first observation first.
#[derive(Debug, Clone)]
pub struct Decoded {
    /// Log odds that the point lies on the surface (queries).
    pub logits: Tensor<1>,
    /// Unit directions (queries, 3).
    pub directions: Tensor<2>,
}

impl QueryNetwork {
    /// A network with untrained weights.
    pub fn new(widths: Widths, device: &Device) -> Self {
        let code = widths.code;
        let anchors = TensorData::new(FIRST_ANCHORS.concat(), [CATEGORIES, 3]);
        Self {
            trunk: QueryTrunk::new(widths, device),
            output: LinearConfig::new(code, 4).init(device),
            class_head: LinearConfig::new(code, CATEGORIES).init(device),
            anchors: Param::from_tensor(Tensor::from_data(anchors, device)),
        }
    }

    /// The trunk, for a network of another purpose to start from.
    pub fn into_trunk(self) -> QueryTrunk {
        self.trunk
    }

    /// Unit vectors of the categories, in their order (categories, 3).
    pub fn anchors(&self) -> Tensor<2> {
        unit(self.anchors.val())
    }

    /// Encodes the observations and answers their queries.
    pub fn forward(&self, batch: &Batch) -> (Encoded, Decoded) {
        let encoded = self.encode(batch);
        let decoded = self.decode(&encoded, batch.queries());
        (encoded, decoded)
    }

    /// The observations' codes.
    pub(crate) fn encode(&self, batch: &Batch) -> Encoded {
        let trunk = self.trunk.encode(batch);
        Encoded {
            class_logits: self.class_head.forward(trunk.code.clone()),
            trunk,
        }
    }

    /// The answers to queries of encoded observations.
    pub(crate) fn decode(&self, encoded: &Encoded, queries: &QueryTensors) -> Decoded {
        let output = self
            .output
            .forward(self.trunk.decode(&encoded.trunk, queries));
        let total = output.dims()[0];
        Decoded {
            logits: output.clone().slice([0..total, 0..1]).reshape([total]),
            directions: unit(output.slice([0..total, 1..4])),
        }
    }
}

/// Rows of unit length.
fn unit(rows: Tensor<2>) -> Tensor<2> {
    let squares = (rows.clone() * rows.clone()).sum_dim(1);
    rows / (squares + SMALL * SMALL).sqrt()
}
