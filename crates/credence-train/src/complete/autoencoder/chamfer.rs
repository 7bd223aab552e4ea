use burn::tensor::{Device, Int, Tensor, TensorData};
use credence_nn::knn;
use rayon::prelude::*;

use crate::TrainError;

/// Under the root of a squared distance: a coincidence has a gradient then, of zero.
const TINY: f64 = 1e-10;

/// Mean distance of points to their nearest counterparts, both ways, averaged: over clouds of
/// equally many points each, one after the other.
///
/// The distances themselves, not their squares as in the first auto-encoders of this kind: a
/// square cares for the worst points and leaves the rest blurred.
///
/// # Errors
/// A coordinate that is not finite.
pub(super) fn chamfer(
    decoded: Tensor<2>,
    truth: &[Vec<[f32; 3]>],
    device: &Device,
) -> Result<Tensor<1>, TrainError> {
    let [rows, _] = decoded.dims();
    let per_cloud = rows / truth.len().max(1);
    let truth_rows: usize = truth.iter().map(Vec::len).sum();
    // Found outside autodiff: the gradient passes through the distances only.
    let pairs = nearest(&host_points(&decoded), truth)?;
    let mut nearest_truth = Vec::with_capacity(3 * rows);
    let mut nearest_decoded = Vec::with_capacity(truth_rows);
    for (cloud, ([of_decoded, of_truth], truth)) in pairs.iter().zip(truth).enumerate() {
        let values = of_decoded.iter().flat_map(|index| truth[*index as usize]);
        nearest_truth.extend(values);
        let first = (cloud * per_cloud) as u32;
        nearest_decoded.extend(of_truth.iter().map(|index| (first + index).cast_signed()));
    }
    let nearest_truth = Tensor::from_data(TensorData::new(nearest_truth, [rows, 3]), device);
    let index = TensorData::new(nearest_decoded, [truth_rows]);
    let index = Tensor::<1, Int>::from_data(index, device);
    let flat: Vec<f32> = truth
        .iter()
        .flat_map(|t| t.as_flattened())
        .copied()
        .collect();
    let flat = Tensor::from_data(TensorData::new(flat, [truth_rows, 3]), device);
    let there = lengths(decoded.clone() - nearest_truth).mean();
    let back = lengths(decoded.select(0, index) - flat).mean();
    Ok((there + back) / 2.0)
}

/// The same of every cloud by itself, on the host.
///
/// # Errors
/// A coordinate that is not finite.
pub(super) fn nearest_distances(
    decoded: &Tensor<2>,
    truth: &[Vec<[f32; 3]>],
) -> Result<Vec<f64>, TrainError> {
    let points = host_points(decoded);
    let per_cloud = points.len() / truth.len().max(1);
    let mean = |from: &[[f32; 3]], to: &[[f32; 3]], nearest: &[u32]| {
        let length = |(p, index): (&[f32; 3], &u32)| {
            let q = to[*index as usize];
            (0..3)
                .map(|axis| f64::from(p[axis] - q[axis]).powi(2))
                .sum::<f64>()
                .sqrt()
        };
        from.iter().zip(nearest).map(length).sum::<f64>() / from.len() as f64
    };
    let pairs = nearest(&points, truth)?;
    let clouds = points.chunks(per_cloud.max(1)).zip(truth).zip(&pairs);
    Ok(clouds
        .map(|((decoded, truth), [of_decoded, of_truth])| {
            mean(decoded, truth, of_decoded).midpoint(mean(truth, decoded, of_truth))
        })
        .collect())
}

/// Of every cloud, the true point nearest to each decoded one, and the other way round.
fn nearest(points: &[[f32; 3]], truth: &[Vec<[f32; 3]>]) -> Result<Vec<[Vec<u32>; 2]>, TrainError> {
    let per_cloud = points.len() / truth.len().max(1);
    points
        .par_chunks(per_cloud.max(1))
        .zip(truth)
        .map(|(decoded, truth)| {
            let of_decoded = knn::nearest(truth, decoded, 1)?;
            let of_truth = knn::nearest(decoded, truth, 1)?;
            Ok([of_decoded, of_truth])
        })
        .collect()
}

fn lengths(differences: Tensor<2>) -> Tensor<2> {
    let squared = (differences.clone() * differences).sum_dim(1);
    (squared + TINY).sqrt()
}

fn host_points(points: &Tensor<2>) -> Vec<[f32; 3]> {
    let data = points.clone().inner().into_data();
    let values: Vec<f32> = data.iter().collect();
    let (points, _) = values.as_chunks::<3>();
    points.to_vec()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn two_clouds_by_hand_with_their_gradients() {
        let device = Device::flex().autodiff();
        // First cloud: points at 0 and 4 on a line, truth at 1 and 2; second: both on the truth.
        let decoded = Tensor::<2>::from_data(
            [
                [0.0, 0.0, 0.0],
                [4.0, 0.0, 0.0],
                [0.0, 7.0, 0.0],
                [0.0, 9.0, 0.0],
            ],
            &device,
        )
        .require_grad();
        let truth = vec![
            vec![[1.0, 0.0, 0.0], [2.0, 0.0, 0.0]],
            vec![[0.0, 9.0, 0.0], [0.0, 7.0, 0.0]],
        ];
        let loss = chamfer(decoded.clone(), &truth, &device).unwrap();
        // There 1 + 2 over 4 points, back 1 + 2 (to 0, the first of the two equally near): 3/4 each.
        let value: f32 = loss.clone().into_scalar();
        assert!((value - 0.75).abs() < 1e-4, "{value}");
        let gradients = loss.backward();
        let gradient: Vec<f32> = decoded
            .grad(&gradients)
            .unwrap()
            .into_data()
            .iter()
            .collect();
        // Of point 0: -1 there and -2 back, of point 1: +1 there, an eighth each.
        assert!((gradient[0] + 3.0 / 8.0).abs() < 1e-4, "{gradient:?}");
        assert!((gradient[3] - 1.0 / 8.0).abs() < 1e-4, "{gradient:?}");
        assert!(gradient[6..].iter().all(|g| g.abs() < 1e-3), "{gradient:?}");
    }
}
