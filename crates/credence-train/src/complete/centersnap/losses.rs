use burn::tensor::{Device, Tensor, TensorData, activation::log_softmax};
use credence_complete::centersnap::{CELLS, CenterSnapNetwork, ImageBatch, LATENT, POSE};
use credence_nn::loss::one_hot;

use super::example::{CATEGORIES, Example};

/// Weights of the parts: as published where the paper gives them.
const HEAT: f64 = 100.0;
const LATENT_WEIGHT: f64 = 0.1;
const POSE_WEIGHT: f64 = 0.1;
const DEPTH: f64 = 0.1;
const SEGMENTS: f64 = 0.1;

/// The loss of a batch and its parts: heat, latent, pose, depth, segments.
///
/// 100 MSE(heat) + 0.1 L1(latent) + 0.1 L1(pose) where the heat is over 0.3, and the auxiliary
/// parts. The square error is summed over the categories, of which one at most is warm in a cell.
/// The L1 norms are summed over the pose's 13 numbers, and over the latent's 128 as if they were
/// 11, the root: independent errors then weigh as much in both.
pub(super) fn losses(
    network: &CenterSnapNetwork,
    examples: Vec<Example>,
    device: &Device,
) -> [Tensor<1>; 6] {
    let cells_per_image = CELLS[0] * CELLS[1];
    let rows = examples.len() * cells_per_image;
    let (mut colour, mut depth) = (Vec::new(), Vec::new());
    let (mut heat, mut seen, mut known) = (Vec::new(), Vec::new(), Vec::new());
    let (mut warm, mut latents, mut poses) = (Vec::new(), Vec::new(), Vec::new());
    let mut segments = Vec::with_capacity(rows);
    for (number, example) in examples.into_iter().enumerate() {
        for (cell, object, pose) in &example.warm {
            warm.push(number * cells_per_image + cell);
            latents.extend(example.latents[*object]);
            poses.extend(pose);
        }
        colour.push(example.colour);
        depth.push(example.depth);
        heat.extend(example.heat);
        seen.extend(example.seen_depth.iter().map(|depth| depth.unwrap_or(0.0)));
        known.extend(
            example
                .seen_depth
                .iter()
                .map(|depth| f32::from(depth.is_some())),
        );
        segments.extend(example.segments);
    }
    let tensor = |values: Vec<f32>, columns: usize| {
        let shape = [values.len() / columns, columns];
        Tensor::<2>::from_data(TensorData::new(values, shape), device)
    };
    let cells = network.forward(&ImageBatch::of_rows(colour, depth, device));

    let heat_error = cells.heat - tensor(heat, CATEGORIES);
    let heat_loss = (heat_error.clone() * heat_error).sum() / rows as f64;
    let known = tensor(known, 1);
    let count = known.clone().sum().clamp_min(1.0);
    let depth_loss = ((cells.depth - tensor(seen, 1)).abs() * known).sum() / count;
    let truth = one_hot(segments.into_iter(), CATEGORIES + 1, device);
    let segment_loss = -(log_softmax(cells.segments, 1) * truth).sum_dim(1).mean();
    let [latent_loss, pose_loss] = if warm.is_empty() {
        // Nothing but empty tables.
        [(); 2].map(|()| Tensor::zeros([1], device))
    } else {
        let count = warm.len() as f64;
        let (shape, pose) = network.objects(&cells.features, &warm);
        let per_root = count * (LATENT as f64).sqrt();
        [
            (shape - tensor(latents, LATENT)).abs().sum() / per_root,
            (pose - tensor(poses, POSE)).abs().sum() / count,
        ]
    };
    let total = heat_loss.clone() * HEAT
        + latent_loss.clone() * LATENT_WEIGHT
        + pose_loss.clone() * POSE_WEIGHT
        + depth_loss.clone() * DEPTH
        + segment_loss.clone() * SEGMENTS;
    [
        total,
        heat_loss,
        latent_loss,
        pose_loss,
        depth_loss,
        segment_loss,
    ]
}
