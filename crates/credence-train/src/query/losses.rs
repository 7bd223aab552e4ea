use burn::tensor::{
    Device, Tensor, TensorData,
    activation::{log_softmax, relu},
};
use credence_embed::query::{CATEGORIES, Decoded, Encoded, QueryNetwork};
use credence_nn::loss::{AngularMargin, one_hot};

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
            query_categories: one_hot(per_query, CATEGORIES, device),
            categories: one_hot(examples.iter().map(|e| e.category), CATEGORIES, device),
        }
    }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cross_entropy_is_that_of_the_sigmoid_even_far_out() {
        let device = Device::flex();
        let tensor = |values: [f32; 4]| Tensor::<1>::from_data(values, &device);
        let found = cross_entropy(
            tensor([0.0, 2.0, -1.0, 200.0]),
            tensor([1.0, 0.0, 1.0, 0.0]),
        );
        // -ln sigmoid(0), -ln sigmoid(-2), -ln sigmoid(-1), and the logit itself far out.
        let expected = [std::f32::consts::LN_2, 2.126_928, 1.313_261_7, 200.0];
        for (found, expected) in found.into_data().iter::<f32>().zip(expected) {
            assert!((found - expected).abs() < 1e-5, "{found} {expected}");
        }
    }
}
