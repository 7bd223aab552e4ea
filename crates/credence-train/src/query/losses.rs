use burn::tensor::{
    Device, Tensor, TensorData,
    activation::{log_softmax, relu},
};
use credence_embed::query::{CATEGORIES, Decoded, Encoded, QueryNetwork};
use credence_nn::loss::AngularMargin;

use super::augment::Example;

/// Weight of the directions' loss and of the class head's.
const MINOR: f64 = 0.1;

const DIRECTIONS: AngularMargin = AngularMargin {
    scale: 8.0,
    margin: 0.35,
};

/// Truth of a batch: labels (queries), categories of the queries and of the observations, one-hot.
pub(super) struct Truth {
    labels: Tensor<1>,
    query_categories: Tensor<2>,
    categories: Tensor<2>,
}

impl Truth {
    pub(super) fn new(examples: &[Example], device: &Device) -> Self {
        let labels: Vec<f32> = examples.iter().flat_map(|e| &e.labels).copied().collect();
        let count = labels.len();
        let per_query = examples
            .iter()
            .flat_map(|e| e.labels.iter().map(|_| e.category));
        Self {
            labels: Tensor::from_data(TensorData::new(labels, [count]), device),
            query_categories: one_hot(per_query, device),
            categories: one_hot(examples.iter().map(|e| e.category), device),
        }
    }
}

fn one_hot(categories: impl Iterator<Item = usize>, device: &Device) -> Tensor<2> {
    let row = |category| (0..CATEGORIES).map(move |c| if c == category { 1.0_f32 } else { 0.0 });
    let values: Vec<f32> = categories.flat_map(row).collect();
    let rows = values.len() / CATEGORIES;
    Tensor::from_data(TensorData::new(values, [rows, CATEGORIES]), device)
}

/// The loss and its parts: surface, direction, class.
pub(super) fn losses(
    network: &QueryNetwork,
    encoded: &Encoded,
    decoded: Decoded,
    truth: Truth,
) -> [Tensor<1>; 4] {
    let surface = cross_entropy(decoded.logits, truth.labels.clone()).mean();
    let on = truth.labels;
    let count = on.clone().sum().clamp_min(1.0);
    let angular = DIRECTIONS.forward(
        decoded.directions,
        network.anchors(),
        truth.query_categories,
    );
    let direction = (angular * on).sum() / count;
    let logits = log_softmax(encoded.class_logits.clone(), 1);
    let class = -(logits * truth.categories).sum_dim(1).mean();
    let minor = (direction.clone() + class.clone()) * MINOR;
    [surface.clone() + minor, surface, direction, class]
}

/// Binary cross entropy of a logit l and a label y: max(l, 0) - l y + ln(1 + exp(-|l|)).
pub(super) fn cross_entropy(logits: Tensor<1>, labels: Tensor<1>) -> Tensor<1> {
    let tail = (-logits.clone().abs()).exp().log1p();
    relu(logits.clone()) - logits * labels + tail
}
