use burn::{
    module::Module,
    nn::{Linear, LinearConfig},
    tensor::{Device, Int, Tensor, activation::relu},
};

use super::{
    Batch, QueryTensors, SUBSET_OBJECT,
    batch::{EDGE, PLACE},
    support::{NEAR_FREE, NEAR_OBJECT},
};
use crate::{Mlp, ResidualMlp, strongest_rows};

/// Widths of the layers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Widths {
    /// Of a support point's and an edge's code.
    pub point: usize,
    /// Of the observation's code and of the decoder.
    pub code: usize,
}

impl Default for Widths {
    fn default() -> Self {
        Self {
            point: 64,
            code: 128,
        }
    }
}

/// An encoder of the observed cloud, edges from a query to its nearest support points, and a
/// decoder of both up to the layer that says what is asked for.
#[derive(Module, Debug)]
pub struct QueryTrunk {
    point: Mlp,
    cloud: Mlp,
    code: Mlp,
    edge_point: Linear,
    edge_offset: Linear,
    edge: Linear,
    from_code: Linear,
    from_query: Linear,
    first: ResidualMlp,
    second: ResidualMlp,
}

/// What the network knows of observations before it is asked about a point.
#[derive(Debug, Clone)]
pub struct Encoded {
    /// Code of each observation (observations, code).
    pub code: Tensor<2>,
    /// The same in the decoder's first layer.
    shared: Tensor<2>,
    /// Code of each support point, already in the edges' first layer (points, point).
    points: Tensor<2>,
}

impl QueryTrunk {
    /// A trunk with untrained weights.
    pub fn new(widths: Widths, device: &Device) -> Self {
        let Widths { point, code } = widths;
        let bare = |inputs, outputs| {
            LinearConfig::new(inputs, outputs)
                .with_bias(false)
                .init(device)
        };
        Self {
            point: Mlp::new([4, point, point], device),
            cloud: Mlp::new([point, code, code], device),
            code: Mlp::new([2 * code, code, code], device),
            edge_point: LinearConfig::new(point, point).init(device),
            edge_offset: bare(EDGE, point),
            edge: LinearConfig::new(point, point).init(device),
            from_code: bare(code, code),
            from_query: LinearConfig::new(4 * point + PLACE, code).init(device),
            first: ResidualMlp::new(code, device),
            second: ResidualMlp::new(code, device),
        }
    }

    /// The observations' codes.
    pub fn encode(&self, batch: &Batch) -> Encoded {
        let points = relu(self.point.forward(batch.points.clone()));
        let subset = points.clone().select(0, batch.subset.clone());
        let cloud = self.cloud.forward(subset);
        let [rows, width] = cloud.dims();
        let observations = batch.queries.observations;
        let split = observations * SUBSET_OBJECT;
        let part = |from: usize, to: usize| cloud.clone().slice([from..to, 0..width]);
        let object = highest(part(0, split), observations);
        let free = highest(part(split, rows), observations);
        let code = self.code.forward(Tensor::cat(vec![object, free], 1));
        Encoded {
            shared: self.from_code.forward(code.clone()),
            points: self.edge_point.forward(points),
            code,
        }
    }

    /// The last layer's input for queries of encoded observations (queries, code), those of the
    /// first observation first.
    pub fn decode(&self, encoded: &Encoded, queries: &QueryTensors) -> Tensor<2> {
        let (observations, count) = (queries.observations, queries.count);
        let total = observations * count;
        let mut features = self.edges(&encoded.points, &queries.edges, &queries.rows, total);
        features.push(queries.places.clone());
        let own = self.from_query.forward(Tensor::cat(features, 1));
        let width = own.dims()[1];
        let shared = encoded.shared.clone().reshape([observations, 1, width]);
        let hidden = (own.reshape([observations, count, width]) + shared).reshape([total, width]);
        relu(self.second.forward(self.first.forward(hidden)))
    }

    /// The pooled codes of each query's edges.
    ///
    /// The first layer, W [offset, distance, code], is the sum of a part of the edge and a part of
    /// the neighbour, and the latter is worked out once per neighbour.
    fn edges(
        &self,
        points: &Tensor<2>,
        edges: &Tensor<2>,
        rows: &Tensor<1, Int>,
        total: usize,
    ) -> Vec<Tensor<2>> {
        let neighbours = points.clone().select(0, rows.clone());
        let codes = self
            .edge
            .forward(relu(neighbours + self.edge_offset.forward(edges.clone())));
        let [all, width] = codes.dims();
        let split = total * NEAR_OBJECT;
        let mut pooled = Vec::with_capacity(5);
        for (from, to, near) in [(0, split, NEAR_OBJECT), (split, all, NEAR_FREE)] {
            let part = codes.clone().slice([from..to, 0..width]);
            let mean = part.clone().reshape([total, near, width]).mean_dim(1);
            pooled.push(highest(part, total));
            pooled.push(mean.reshape([total, width]));
        }
        pooled
    }
}

/// The highest value of each column in each of `groups` equal runs of rows.
///
/// The rows are looked for outside autodiff, and only their values are taken inside.
fn highest(rows: Tensor<2>, groups: usize) -> Tensor<2> {
    let width = rows.dims()[1];
    let winners = strongest_rows(rows.clone(), groups).reshape([groups, width]);
    rows.gather(0, winners)
}
