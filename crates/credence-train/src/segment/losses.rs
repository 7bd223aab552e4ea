use burn::tensor::{
    Device, Int, Tensor, TensorData,
    activation::{log_softmax, relu},
};
use credence_nn::{loss::one_hot, read};
use credence_segment::maskrcnn::{
    Anchors, CLASSES, ImageBatch, ImageRows, MASK_SIDE, MaskRcnnNetwork, Pyramid, Region, mask_row,
};
use credence_types::stream;
use rayon::prelude::*;

use super::{
    targets::{AnchorTarget, RegionTarget, anchor_targets, region_targets},
    truth::Truth,
};
use crate::TrainError;

/// Where the square of an error becomes its size, as in torchvision.
const SMOOTH: f64 = 1.0 / 9.0;

/// A picture and what it truly shows.
#[derive(Debug, Clone)]
pub(super) struct Example {
    pub(super) rows: ImageRows,
    pub(super) truths: Vec<Truth>,
    pub(super) owners: Vec<u8>,
}

/// The loss of a batch and its parts: objectness and box of the proposals; class, box and mask of
/// the regions (He et al. 2017, all of weight 1).
///
/// # Errors
/// None that a CPU gives.
pub(super) fn losses(
    network: &MaskRcnnNetwork,
    anchors: &Anchors,
    examples: Vec<Example>,
    (seed, step): (u64, u64),
    device: &Device,
) -> Result<[Tensor<1>; 6], TrainError> {
    let images = examples.len();
    let (rows, truths): (Vec<_>, Vec<_>) = examples
        .into_iter()
        .map(|example| (example.rows, (example.truths, example.owners)))
        .unzip();
    let pyramid = network.features(&ImageBatch::new(rows, device));
    let (objectness, boxes) = network.propose(&pyramid);
    let scores = read(objectness.clone().detach())?;
    let told = read(boxes.clone().detach())?;
    let told = told.as_chunks::<4>().0;
    let targets: Vec<(Vec<AnchorTarget>, Vec<RegionTarget>)> = truths
        .par_iter()
        .enumerate()
        .map(|(image, (truths, owners))| {
            let mut rng = stream(seed, &format!("train/segment/{step}/targets/{image}"));
            let rows = (0..anchors.edges().len()).map(|a| anchors.row(a, image, images));
            let told: Vec<(f32, [f32; 4])> = rows.map(|row| (scores[row], told[row])).collect();
            let of_anchors = anchor_targets(anchors, truths, &mut rng);
            let of_regions = region_targets((anchors, &told), image, (truths, owners), &mut rng);
            (of_anchors, of_regions)
        })
        .collect();
    let (of_anchors, of_regions): (Vec<_>, Vec<_>) = targets.into_iter().unzip();
    let of_anchors = of_anchors.into_iter().enumerate().flat_map(|(image, all)| {
        let row = move |t: AnchorTarget| (anchors.row(t.anchor, image, images), t.told);
        all.into_iter().map(row)
    });
    let [object_loss, proposal_loss] =
        anchor_losses(objectness, boxes, &of_anchors.collect::<Vec<_>>());
    let mut of_regions = of_regions.concat();
    of_regions.sort_by_key(|target| target.region.level());
    let [class_loss, box_loss] = region_losses(network, &pyramid, &of_regions, device);
    let mask_loss = mask_loss(network, &pyramid, &of_regions, device);
    let total = object_loss.clone()
        + proposal_loss.clone()
        + class_loss.clone()
        + box_loss.clone()
        + mask_loss.clone();
    Ok([
        total,
        object_loss,
        proposal_loss,
        class_loss,
        box_loss,
        mask_loss,
    ])
}

/// Objectness and box at the rows that are sampled.
fn anchor_losses(
    objectness: Tensor<2>,
    boxes: Tensor<2>,
    sampled: &[(usize, Option<[f32; 4]>)],
) -> [Tensor<1>; 2] {
    let device = objectness.device();
    let count = sampled.len().max(1) as f64;
    let rows: Vec<usize> = sampled.iter().map(|(row, _)| *row).collect();
    let is_object: Vec<f32> = sampled
        .iter()
        .map(|(_, t)| f32::from(u8::from(t.is_some())))
        .collect();
    let is_object = tensor(is_object, 1, &device);
    let object_loss = cross_entropy(select(objectness, &rows, &device), is_object).sum() / count;
    let (rows, told): (Vec<usize>, Vec<[f32; 4]>) = sampled
        .iter()
        .filter_map(|(row, told)| Some((*row, (*told)?)))
        .unzip();
    let box_loss = if rows.is_empty() {
        // Nothing but empty tables.
        Tensor::zeros([1], &device)
    } else {
        let error = select(boxes, &rows, &device) - tensor(told.concat(), 4, &device);
        smooth_l1(error).sum() / count
    };
    [object_loss, box_loss]
}

/// Class and box of the regions that are sampled.
fn region_losses(
    network: &MaskRcnnNetwork,
    pyramid: &Pyramid,
    targets: &[RegionTarget],
    device: &Device,
) -> [Tensor<1>; 2] {
    if targets.is_empty() {
        return [(); 2].map(|()| Tensor::zeros([1], device));
    }
    let regions: Vec<Region> = targets.iter().map(|target| target.region).collect();
    let regarded = network.regard(pyramid, &regions);
    let count = targets.len() as f64;
    let truth = one_hot(targets.iter().map(|t| t.class), CLASSES, device);
    let class_loss = -(log_softmax(regarded.classes, 1) * truth).sum() / count;
    let told = targets.iter().flat_map(|t| t.told.unwrap_or_default());
    let known = targets
        .iter()
        .map(|t| f32::from(u8::from(t.told.is_some())));
    let error = regarded.boxes - tensor(told.collect(), 4, device);
    let known = tensor(known.collect(), 1, device);
    let box_loss = (smooth_l1(error) * known).sum() / count;
    [class_loss, box_loss]
}

/// Masks of the objects that are sampled, each in the channel of its category.
fn mask_loss(
    network: &MaskRcnnNetwork,
    pyramid: &Pyramid,
    targets: &[RegionTarget],
    device: &Device,
) -> Tensor<1> {
    let masked: Vec<(&RegionTarget, &Vec<bool>)> = targets
        .iter()
        .filter_map(|target| Some((target, target.mask.as_ref()?)))
        .collect();
    if masked.is_empty() {
        return Tensor::zeros([1], device);
    }
    let regions: Vec<Region> = masked.iter().map(|(target, _)| target.region).collect();
    let logits = network.masks(pyramid, &regions);
    let channels = CLASSES - 1;
    let values = MASK_SIDE * MASK_SIDE;
    let mut truth = vec![0.0; masked.len() * values * channels];
    let mut asked = truth.clone();
    for (number, (target, mask)) in masked.iter().enumerate() {
        for (value, inside) in mask.iter().enumerate() {
            let row = number * values + mask_row(value / MASK_SIDE, value % MASK_SIDE);
            let at = row * channels + target.class - 1;
            asked[at] = 1.0;
            truth[at] = f32::from(u8::from(*inside));
        }
    }
    let error = cross_entropy(logits, tensor(truth, channels, device));
    (error * tensor(asked, channels, device)).sum() / (masked.len() * values) as f64
}

/// Of logits, against probabilities: max(x, 0) - x z + ln(1 + exp(-|x|)).
fn cross_entropy(logits: Tensor<2>, truth: Tensor<2>) -> Tensor<2> {
    let size = logits.clone().abs();
    relu(logits.clone()) - logits * truth + (-size).exp().log1p()
}

/// d^2 / 2b up to b, d - b/2 beyond.
fn smooth_l1(error: Tensor<2>) -> Tensor<2> {
    let size = error.abs();
    let small = size.clone().clamp_max(SMOOTH);
    small.clone() * (size - small * 0.5) / SMOOTH
}

fn tensor(values: Vec<f32>, columns: usize, device: &Device) -> Tensor<2> {
    let shape = [values.len() / columns, columns];
    Tensor::from_data(TensorData::new(values, shape), device)
}

fn select(x: Tensor<2>, rows: &[usize], device: &Device) -> Tensor<2> {
    let indices: Vec<i32> = rows.iter().map(|row| (*row as u32).cast_signed()).collect();
    let indices = TensorData::new(indices, [rows.len()]);
    x.select(0, Tensor::<1, Int>::from_data(indices, device))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn values(tensor: Tensor<2>) -> Vec<f32> {
        tensor.into_data().iter().collect()
    }

    fn close(found: Vec<f32>, expected: &[f32]) {
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.into_iter().zip(expected) {
            assert!((found - expected).abs() < 1e-5, "{found} is not {expected}");
        }
    }

    #[test]
    fn the_losses_of_a_few_numbers_by_hand() {
        let device = Device::flex();
        let of = |values: &[f32]| tensor(values.to_vec(), 1, &device);
        // -ln of the sigmoid of 2, of its complement, and no overflow far out.
        let found = cross_entropy(of(&[2.0, 2.0, -90.0, 90.0]), of(&[1.0, 0.0, 1.0, 1.0]));
        close(values(found), &[0.126_928, 2.126_928, 90.0, 0.0]);
        let found = smooth_l1(of(&[0.0, 1.0 / 18.0, -1.0 / 9.0, 2.0]));
        close(
            values(found),
            &[0.0, 1.0 / 72.0, 1.0 / 18.0, 2.0 - 1.0 / 18.0],
        );
    }

    #[test]
    fn sampled_anchors_alone_are_learned_from() {
        let device = Device::flex();
        let objectness = tensor(vec![2.0, 9.0, 2.0, -7.0], 1, &device);
        let boxes = tensor(vec![1.0; 16], 4, &device);
        let sampled = [(0, Some([1.0, 1.0, 1.0, 3.0])), (2, None)];
        let [object, told] = anchor_losses(objectness.clone(), boxes.clone(), &sampled);
        let scalar = |t: Tensor<1>| t.into_scalar::<f32>();
        assert!((scalar(object) - f32::midpoint(0.126_928, 2.126_928)).abs() < 1e-5);
        assert!((scalar(told) - (2.0 - 1.0 / 18.0) / 2.0).abs() < 1e-5);
        let [_, none] = anchor_losses(objectness, boxes, &sampled[1..]);
        assert_eq!(scalar(none), 0.0);
    }
}
