use burn::tensor::{Device, Tensor, TensorData, activation::log_softmax};

/// Cross entropy of scaled cosines, with the true class's cosine lowered by a margin.
///
/// For unit directions u and unit anchors w: -log softmax(scale (u.w - margin onehot)), the
/// additive margin of Wang et al. 2018 (`CosFace`).
#[derive(Debug, Clone, Copy)]
pub struct AngularMargin {
    /// Inverse temperature.
    pub scale: f64,
    /// What the true class's cosine must exceed the others by.
    pub margin: f64,
}

impl AngularMargin {
    /// One loss per row of `directions` (rows, 3); `anchors` is (classes, 3), and `onehot` (rows,
    /// classes) marks each row's class.
    pub fn forward(
        &self,
        directions: Tensor<2>,
        anchors: Tensor<2>,
        onehot: Tensor<2>,
    ) -> Tensor<1> {
        let cosines = directions.matmul(anchors.transpose());
        let lowered = (cosines - onehot.clone() * self.margin) * self.scale;
        let own = (log_softmax(lowered, 1) * onehot).sum_dim(1);
        -own.squeeze_dim::<1>(1)
    }
}

/// Rows of zeros with a one at each class (rows, count).
pub fn one_hot(classes: impl Iterator<Item = usize>, count: usize, device: &Device) -> Tensor<2> {
    let row = |class| (0..count).map(move |c| if c == class { 1.0_f32 } else { 0.0 });
    let values: Vec<f32> = classes.flat_map(row).collect();
    let rows = values.len() / count;
    Tensor::from_data(TensorData::new(values, [rows, count]), device)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LOSS: AngularMargin = AngularMargin {
        scale: 8.0,
        margin: 0.35,
    };

    /// The formula in double precision, for two rows and two anchors, of classes 0 and 1.
    fn by_hand(directions: &[f64; 6], anchors: &[f64; 6]) -> [f64; 2] {
        [0, 1].map(|row| {
            let cosine = |class: usize| -> f64 {
                (0..3)
                    .map(|i| directions[3 * row + i] * anchors[3 * class + i])
                    .sum()
            };
            let own = 8.0 * (cosine(row) - 0.35);
            let other = 8.0 * cosine(1 - row);
            (own.exp() + other.exp()).ln() - own
        })
    }

    const DIRECTIONS: [f64; 6] = [0.6, 0.0, 0.8, 0.0, 0.28, 0.96];
    const ANCHORS: [f64; 6] = [1.0, 0.0, 0.0, 0.0, 0.6, 0.8];

    fn tensor(values: &[f64; 6], device: &Device) -> Tensor<2> {
        let values: Vec<f32> = values.iter().map(|v| *v as f32).collect();
        Tensor::from_data(TensorData::new(values, [2, 3]), device)
    }

    #[test]
    fn is_the_formula() {
        let device = Device::flex();
        let onehot = one_hot([0, 1].into_iter(), 2, &device);
        let (u, w) = (tensor(&DIRECTIONS, &device), tensor(&ANCHORS, &device));
        let losses = LOSS.forward(u, w, onehot).into_data();
        let expected = by_hand(&DIRECTIONS, &ANCHORS);
        for (loss, expected) in losses.iter::<f32>().zip(expected) {
            assert!(
                (f64::from(loss) - expected).abs() < 1e-5,
                "{loss} {expected}"
            );
        }
    }

    #[test]
    fn gradients_agree_with_finite_differences() {
        let device = Device::flex().autodiff();
        let u = tensor(&DIRECTIONS, &device).require_grad();
        let w = tensor(&ANCHORS, &device).require_grad();
        let onehot = one_hot([0, 1].into_iter(), 2, &device);
        let gradients = LOSS.forward(u.clone(), w.clone(), onehot).sum().backward();
        let total = |u: &[f64; 6], w: &[f64; 6]| by_hand(u, w).iter().sum::<f64>();
        let moved = |values: &[f64; 6], i: usize, by: f64| {
            let mut values = *values;
            values[i] += by;
            values
        };
        const STEP: f64 = 1e-6;
        let of_u = |i, by| total(&moved(&DIRECTIONS, i, by), &ANCHORS);
        let of_w = |i, by| total(&DIRECTIONS, &moved(&ANCHORS, i, by));
        let found = [u.grad(&gradients), w.grad(&gradients)].map(|g| g.unwrap().into_data());
        for i in 0..6 {
            let expected = [
                (of_u(i, STEP) - of_u(i, -STEP)) / (2.0 * STEP),
                (of_w(i, STEP) - of_w(i, -STEP)) / (2.0 * STEP),
            ];
            for (found, expected) in found.iter().zip(expected) {
                let found = f64::from(found.iter::<f32>().nth(i).unwrap());
                assert!((found - expected).abs() < 1e-4, "{i}: {found} {expected}");
            }
        }
    }
}
