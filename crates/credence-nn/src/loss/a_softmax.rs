//! A-Softmax, the loss of `SphereFace` (Liu et al. 2017), with margin m = 4.
//!
//! Class weights are unit vectors without bias, so a logit is `|x| cos(theta_c)`. The own class's
//! cosine gives way to a function that falls faster,
//!
//! `psi(theta) = (-1)^k cos(4 theta) - 2 k` for theta in `[k pi/4, (k + 1) pi/4]`,
//!
//! which asks every sample to lie four times nearer to its own class than to any other. As psi
//! alone does not converge from a random start, the own logit is
//! `|x| (lambda cos(theta) + psi(theta)) / (1 + lambda)` with lambda falling over the steps.

use std::f64::consts::FRAC_1_SQRT_2;

use burn::tensor::{IndexingUpdateOp, Int, Tensor, activation::log_softmax};

/// Keeps the length of a zero feature differentiable.
const TINY: f64 = 1e-12;

/// Weight of the plain cosine after `step` steps: `max(5, 1000 / (1 + 0.12 step))`.
pub fn annealing(step: usize) -> f64 {
    (1000.0 / (1.0 + 0.12 * step as f64)).max(5.0)
}

/// The mean loss of `features`, `[n, d]`, whose classes are `labels`, `[n]`; `classes`,
/// `[d, c]`, holds a column per class, of any length but zero.
pub fn a_softmax(
    features: Tensor<2>,
    classes: &Tensor<2>,
    labels: Tensor<1, Int>,
    lambda: f64,
) -> Tensor<1> {
    let [n, _] = features.dims();
    let labels = labels.reshape([n, 1]);
    let length = norm(features.clone(), 1);
    let directions = classes.clone() / norm(classes.clone(), 0);
    let logits = features.matmul(directions);
    let own_logit = logits.clone().gather(1, labels.clone());
    let cosine = own_logit.clone() / length.clone();
    let own_margin = (psi(&cosine) + cosine * lambda) * length / (1.0 + lambda);
    let logits = logits.scatter(
        1,
        labels.clone(),
        own_margin - own_logit,
        IndexingUpdateOp::Add,
    );
    -log_softmax(logits, 1).gather(1, labels).mean()
}

/// psi as a function of the cosine: `cos(4 theta) = 8 c^4 - 8 c^2 + 1`, and k counts which of
/// `cos(pi/4)`, `cos(pi/2)` and `cos(3 pi/4)` the cosine lies below.
fn psi(cosine: &Tensor<2>) -> Tensor<2> {
    let square = cosine.clone() * cosine.clone();
    let quadruple = (square.clone() * square.clone() - square) * 8.0 + 1.0;
    let mut k = cosine.zeros_like();
    let mut sign = cosine.ones_like();
    for bound in [FRAC_1_SQRT_2, 0.0, -FRAC_1_SQRT_2] {
        let below = cosine.clone().detach().lower_elem(bound).float();
        sign = sign * (1.0 - below.clone() * 2.0);
        k = k + below;
    }
    sign * quadruple - k * 2.0
}

/// Length along a dimension, which stays with size 1.
fn norm(x: Tensor<2>, dim: usize) -> Tensor<2> {
    ((x.clone() * x).sum_dim(dim) + TINY).sqrt()
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use burn::tensor::{Device, TensorData};
    use proptest::prelude::*;

    use super::*;

    const CLASSES: usize = 4;
    const SAMPLES: usize = 3;

    fn tensor(values: &[f64], columns: usize, device: &Device) -> Tensor<2> {
        let values: Vec<f32> = values.iter().map(|&v| v as f32).collect();
        let shape = [values.len() / columns, columns];
        Tensor::from_data(TensorData::new(values, shape), device)
    }

    fn psi_of(cosine: f64) -> f64 {
        let device = Device::flex();
        f64::from(psi(&tensor(&[cosine], 1, &device)).into_scalar::<f32>())
    }

    /// psi from the angle, as the paper writes it.
    fn psi_by_angle(theta: f64) -> f64 {
        let k = (theta * 4.0 / PI).floor().min(3.0);
        (-1.0_f64).powf(k) * (4.0 * theta).cos() - 2.0 * k
    }

    /// The loss in double precision, by angles.
    fn reference(features: &[f64], classes: &[f64], labels: &[usize], lambda: f64) -> f64 {
        let sample = |n: usize| {
            let x = &features[3 * n..3 * n + 3];
            let length = x.iter().map(|v| v * v).sum::<f64>().sqrt();
            let logit = |c: usize| {
                let w: Vec<f64> = (0..3).map(|d| classes[d * CLASSES + c]).collect();
                let norm = w.iter().map(|v| v * v).sum::<f64>().sqrt();
                let cosine = x.iter().zip(&w).map(|(a, b)| a * b).sum::<f64>() / length / norm;
                if c == labels[n] {
                    length * (lambda * cosine + psi_by_angle(cosine.acos())) / (1.0 + lambda)
                } else {
                    length * cosine
                }
            };
            let logits: Vec<f64> = (0..CLASSES).map(logit).collect();
            logits.iter().map(|l| l.exp()).sum::<f64>().ln() - logits[labels[n]]
        };
        (0..labels.len()).map(sample).sum::<f64>() / labels.len() as f64
    }

    #[test]
    fn the_margin_falls_from_one_to_minus_seven() {
        for (degrees, expected) in [
            (0.0, 1.0),
            (45.0, -1.0),
            (90.0, -3.0),
            (135.0, -5.0),
            (180.0, -7.0),
        ] {
            let found = psi_of(f64::to_radians(degrees).cos());
            assert!((found - expected).abs() < 1e-5, "psi({degrees}) = {found}");
        }
    }

    #[test]
    fn annealing_ends_at_five() {
        assert_eq!(annealing(0), 1000.0);
        assert!((annealing(100) - 1000.0 / 13.0).abs() < 1e-12);
        assert_eq!(annealing(1_000_000), 5.0);
    }

    #[test]
    fn one_sample_by_hand() {
        // x = (2, 0), classes +x and +y, own class +y: cos 90 = 0, psi = -3, lambda 1: own logit
        // 2 (0 - 3) / 2 = -3, other 2; loss = ln(e^-3 + e^2) + 3.
        let device = Device::flex();
        let features = tensor(&[2.0, 0.0], 2, &device);
        let classes = tensor(&[3.0, 0.0, 0.0, 0.5], 2, &device);
        let labels = Tensor::<1, Int>::from_data([1], &device);
        let loss: f32 = a_softmax(features, &classes, labels, 1.0).into_scalar();
        let expected = ((-3.0_f64).exp() + 2.0_f64.exp()).ln() + 3.0;
        assert!(
            (f64::from(loss) - expected).abs() < 1e-5,
            "{loss} is not {expected}"
        );
    }

    #[test]
    fn a_feature_without_length_gives_finite_gradients() {
        let device = Device::flex().autodiff();
        let features = tensor(&[0.0; 3], 3, &device).require_grad();
        let classes = tensor(&[1.0, 0.0, 0.0, 1.0, 0.0, 0.0], 2, &device);
        let labels = Tensor::<1, Int>::from_data([0], &device);
        let loss = a_softmax(features.clone(), &classes, labels, 5.0);
        let grads = loss.backward();
        let gradient = features.grad(&grads).unwrap().into_data();
        assert!(gradient.iter::<f32>().all(f32::is_finite), "{gradient}");
    }

    proptest! {
        #[test]
        fn the_margin_is_continuous_and_falls_with_the_angle(
            theta in 0.0..PI,
            further in 0.001..0.2_f64,
        ) {
            let here = psi_of(theta.cos());
            prop_assert!((here - psi_by_angle(theta)).abs() < 1e-4);
            // |psi'| <= 4; single precision of the cosine at 0 and pi costs 1e-3 of an angle.
            let next = psi_of((theta + further).min(PI).cos());
            prop_assert!(next <= here + 1e-4);
            prop_assert!(here - next <= 4.0 * further + 1e-4);
        }

        #[test]
        fn loss_and_gradients_are_those_of_finite_differences(
            features in prop::collection::vec(-2.0..2.0_f64, 3 * SAMPLES),
            classes in prop::collection::vec(-2.0..2.0_f64, 3 * CLASSES),
            labels in prop::collection::vec(0..CLASSES, SAMPLES),
            lambda in 0.0..20.0_f64,
        ) {
            // Short vectors turn fast: their differences need more digits than f32 has.
            let long = |vector: &[f64]| vector.iter().map(|v| v * v).sum::<f64>() > 0.25;
            prop_assume!(features.chunks(3).all(long));
            prop_assume!((0..CLASSES).all(|c| long(&[classes[c], classes[CLASSES + c], classes[2 * CLASSES + c]])));

            let device = Device::flex().autodiff();
            let x = tensor(&features, 3, &device).require_grad();
            let w = tensor(&classes, CLASSES, &device).require_grad();
            let own: Vec<u32> = labels.iter().map(|&l| l as u32).collect();
            let own = Tensor::<1, Int>::from_data(TensorData::new(own, [SAMPLES]), &device);
            let loss = a_softmax(x.clone(), &w, own, lambda);
            let grads = loss.backward();
            let found = f64::from(loss.into_scalar::<f32>());
            let expected = reference(&features, &classes, &labels, lambda);
            prop_assert!((found - expected).abs() < 1e-4 * (1.0 + expected.abs()));

            let step = 1e-6;
            let compare = |analytic: Vec<f32>, at: &[f64], f: &dyn Fn(&[f64]) -> f64| {
                for (i, analytic) in analytic.into_iter().enumerate() {
                    let mut moved = at.to_vec();
                    moved[i] = at[i] + step;
                    let up = f(&moved);
                    moved[i] = at[i] - step;
                    let slope = (up - f(&moved)) / (2.0 * step);
                    let error = (f64::from(analytic) - slope).abs();
                    prop_assert!(error < 2e-3 * (1.0 + slope.abs()), "{analytic} is not {slope}");
                }
                Ok(())
            };
            let gradient = |t: &Tensor<2>| t.grad(&grads).unwrap().into_data().try_to_vec().unwrap();
            compare(gradient(&x), &features, &|x| reference(x, &classes, &labels, lambda))?;
            compare(gradient(&w), &classes, &|w| reference(&features, w, &labels, lambda))?;
        }
    }
}
