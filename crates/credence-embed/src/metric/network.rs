use burn::{
    module::{Module, Param},
    nn::{Linear, LinearConfig},
    tensor::{Device, Int, Tensor, TensorData},
};
use credence_nn::leaky_relu;
use rayon::prelude::*;

use super::{
    clouds::CloudBatch,
    dgcnn::{Dgcnn, Encoded},
};

/// Channels of every layer; the default is the published network's.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MetricWidths {
    /// Outputs of each edge convolution and of the layer on points behind the first two.
    pub edge: usize,
    /// Length of a cloud's code.
    pub code: usize,
    /// Hidden layers between the code joined to a point's features and the logits.
    pub decoder: [usize; 2],
    /// Logits per point: free space first, then the categories.
    pub logits: usize,
    /// Hidden layers of the head from the logits to the sphere.
    pub head: [usize; 3],
}

impl Default for MetricWidths {
    fn default() -> Self {
        Self {
            edge: 64,
            code: 1024,
            decoder: [512, 256],
            logits: credence_types::CLASS_COUNT,
            head: [250, 100, 50],
        }
    }
}

/// The network of the metric embedding: a point's cloud gives its logits, its logits their place
/// on the unit sphere, on which every category has a direction.
#[derive(Module, Debug)]
pub struct MetricNetwork {
    dgcnn: Dgcnn,
    head: Vec<Linear>,
    classes: Param<Tensor<2>>,
}

impl MetricNetwork {
    /// A network with random weights. The categories' directions start on the axes, where any
    /// two of up to six are at least a right angle apart.
    pub fn new(widths: &MetricWidths, device: &Device) -> Self {
        let [first, second, third] = widths.head;
        let sizes = [widths.logits, first, second, third, 3];
        Self {
            dgcnn: Dgcnn::new(widths, device),
            head: sizes
                .windows(2)
                .map(|pair| LinearConfig::new(pair[0], pair[1]).init(device))
                .collect(),
            classes: Param::from_tensor(axes(widths.logits - 1, device)),
        }
    }

    /// Logits per point, free space first, of the points in `rows` (of all when `None`), which
    /// must hold equally many of every cloud, cloud by cloud.
    pub fn logits(&self, batch: &CloudBatch, rows: Option<Tensor<1, Int>>) -> Tensor<2> {
        let Encoded { points, codes } = self.dgcnn.encode(batch);
        let points = match rows {
            Some(rows) => points.select(0, rows),
            None => points,
        };
        self.dgcnn.decode(points, codes)
    }

    /// Logits and features of all points of one cloud, `rows` of them at a time in parallel: their
    /// layers' outputs then stay in the cache.
    pub(super) fn in_blocks(&self, batch: &CloudBatch, rows: usize) -> Vec<[Tensor<2>; 2]> {
        let Encoded { points, codes } = self.dgcnn.encode(batch);
        points
            .split(rows, 0)
            .into_par_iter()
            .map(|points| {
                let logits = self.dgcnn.decode(points, codes.clone());
                [logits.clone(), self.features(logits)]
            })
            .collect()
    }

    /// The head's output `[n, 3]` for logits `[n, classes]`, before it is normalised: its length
    /// is the confidence that the loss needs, its direction the embedding.
    pub fn features(&self, logits: Tensor<2>) -> Tensor<2> {
        let last = self.head.len() - 1;
        self.head.iter().enumerate().fold(logits, |x, (i, layer)| {
            let x = layer.forward(x);
            if i == last { x } else { leaky_relu(x) }
        })
    }

    /// The categories' directions as columns `[3, categories]`, of any length.
    pub fn classes(&self) -> Tensor<2> {
        self.classes.val()
    }
}

/// Columns +x, +y, +z, -x, -y, -z and so on.
fn axes(count: usize, device: &Device) -> Tensor<2> {
    let mut values = vec![0.0_f32; 3 * count];
    for column in 0..count {
        values[column % 3 * count + column] = if column / 3 % 2 == 0 { 1.0 } else { -1.0 };
    }
    Tensor::from_data(TensorData::new(values, [3, count]), device)
}
