use credence_segment::maskrcnn::{CLASSES, Input, MaskRcnn, MaskRcnnNetwork, mask_iou};
use credence_types::Category;
use rayon::prelude::*;

use super::{
    pictures::{LabelledPicture, PictureSet},
    truth::{LEAST_PIXELS, truths},
};
use crate::{TrainError, run::Figures};

/// A mask that overlaps an object's by this is the object's.
const OVERLAP: f64 = 0.5;
/// A detection from this score on is taken by the map.
const TAKEN: f64 = 0.5;

/// What the network looks at, as the figures name it.
pub(super) const INPUTS: [(Input, &str); 2] =
    [(Input::Colour, "colour"), (Input::ColourAndDepth, "rgbd")];

/// A detection and the object that it is of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Judged {
    /// Probability of each class.
    pub(super) classes: [f64; CLASSES],
    /// Its category and the probability of it.
    pub(super) best: (Category, f64),
    /// The category of the object whose mask it overlaps by half, and by how much; none of a mask
    /// that is no object's or another detection's already.
    pub(super) object: Option<(Category, f64)>,
}

impl Judged {
    /// Whether it has the right category.
    pub(super) fn is_right(&self) -> bool {
        self.object
            .is_some_and(|(category, _)| category == self.best.0)
    }
}

/// Detections in pictures, and how many objects of each category are there.
#[derive(Debug)]
pub(super) struct Outcome {
    pub(super) detections: Vec<Judged>,
    pub(super) objects: [usize; Category::ALL.len()],
    pub(super) pictures: usize,
}

/// Looks at the first pictures of a set.
///
/// # Errors
/// Pictures that cannot be read.
pub(super) fn judge(
    segmenter: &MaskRcnn,
    pictures: &PictureSet,
    count: usize,
) -> Result<Outcome, TrainError> {
    let count = count.min(pictures.len());
    let per_picture: Vec<(Vec<Judged>, Vec<Category>)> = (0..count)
        .into_par_iter()
        .map(|index| judge_one(segmenter, &pictures.get(index)?))
        .collect::<Result<_, TrainError>>()?;
    let mut outcome = Outcome {
        detections: Vec::new(),
        objects: [0; Category::ALL.len()],
        pictures: count,
    };
    for (detections, objects) in per_picture {
        outcome.detections.extend(detections);
        for category in objects {
            outcome.objects[usize::from(category.class()) - 1] += 1;
        }
    }
    Ok(outcome)
}

/// The surest detection takes its object first; objects that hardly show, and what overlaps
/// them, do not count.
fn judge_one(
    segmenter: &MaskRcnn,
    picture: &LabelledPicture,
) -> Result<(Vec<Judged>, Vec<Category>), TrainError> {
    let truths = truths(picture);
    let mut left: Vec<(usize, Vec<bool>)> = truths
        .iter()
        .enumerate()
        .map(|(index, truth)| {
            let mask = picture.owners.iter().map(|owner| *owner == truth.number);
            (index, mask.collect())
        })
        .collect();
    let mut judged = Vec::new();
    for detection in segmenter.look(&picture.image)? {
        let mask = detection.image_mask();
        let overlaps = left.iter().map(|(_, truth)| mask_iou(&mask, truth));
        let best = overlaps.enumerate().max_by(|a, b| a.1.total_cmp(&b.1));
        let matched = best.filter(|(_, overlap)| *overlap >= OVERLAP);
        let object = matched.map(|(place, overlap)| {
            let (index, _) = left.remove(place);
            (truths[index], overlap)
        });
        if object.is_some_and(|(truth, _)| truth.pixels < LEAST_PIXELS) {
            continue;
        }
        judged.push(Judged {
            classes: detection.classes,
            best: detection.best(),
            object: object.map(|(truth, overlap)| (truth.category, overlap)),
        });
    }
    let counted = truths.iter().filter(|t| t.pixels >= LEAST_PIXELS);
    Ok((judged, counted.map(|t| t.category).collect()))
}

/// Names of the figures, in the order of the log.
pub(super) fn figure_names() -> Vec<String> {
    let of = |(_, input): (Input, &str)| {
        ["ap50", "recall", "strays", "iou"].map(|figure| format!("{figure}_{input}"))
    };
    INPUTS.into_iter().flat_map(of).collect()
}

/// Figures on pictures of meshes that the network has not seen, without and with depth: the mean
/// over the categories of the average precision at a mask overlap of half, where a detection takes
/// its object whatever category it says (COCO's takes one of its own); and, among detections
/// that the map would take, the share of objects found and named rightly, the detections per
/// picture that are of none, and the mean overlap of the right ones.
///
/// # Errors
/// Pictures that cannot be read.
pub(super) fn evaluate(
    network: &MaskRcnnNetwork,
    pictures: &PictureSet,
    count: usize,
) -> Result<Figures, TrainError> {
    let mut figures = Figures::new();
    for (input, name) in INPUTS {
        let outcome = judge(&MaskRcnn::new(network.clone(), input), pictures, count)?;
        let taken = outcome.detections.iter().filter(|d| d.best.1 >= TAKEN);
        let (right, wrong): (Vec<&Judged>, Vec<&Judged>) = taken.partition(|d| d.is_right());
        let overlaps = right
            .iter()
            .filter_map(|d| d.object)
            .map(|(_, overlap)| overlap);
        let objects: usize = outcome.objects.iter().sum();
        let share = |count: f64, of: usize| count / of.max(1) as f64;
        for (figure, value) in [
            ("ap50", mean_precision(&outcome)),
            ("recall", share(right.len() as f64, objects)),
            ("strays", share(wrong.len() as f64, outcome.pictures)),
            (
                "iou",
                share(overlaps.fold(0.0, |sum, o| sum + o), right.len()),
            ),
        ] {
            figures.insert(format!("{figure}_{name}"), value);
        }
    }
    Ok(figures)
}

/// Mean over the categories that are there.
fn mean_precision(outcome: &Outcome) -> f64 {
    let of = |category: Category| {
        let objects = outcome.objects[usize::from(category.class()) - 1];
        let own = outcome.detections.iter().filter(|d| d.best.0 == category);
        let own = own.map(|d| (d.best.1, d.is_right())).collect();
        (objects > 0).then(|| average_precision(own, objects))
    };
    let each: Vec<f64> = Category::ALL.into_iter().filter_map(of).collect();
    each.iter().sum::<f64>() / each.len().max(1) as f64
}

/// Area under precision over recall, precision being the best at any higher recall (Everingham et
/// al. 2010), of detections by score and rightness.
fn average_precision(mut detections: Vec<(f64, bool)>, objects: usize) -> f64 {
    detections.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut right = 0;
    let precisions: Vec<(bool, f64)> = detections
        .iter()
        .enumerate()
        .map(|(rank, (_, is_right))| {
            right += usize::from(*is_right);
            (*is_right, right as f64 / (rank + 1) as f64)
        })
        .collect();
    let (mut best, mut area) = (0.0_f64, 0.0);
    for (is_right, precision) in precisions.into_iter().rev() {
        best = best.max(precision);
        if is_right {
            area += best / objects as f64;
        }
    }
    area
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn average_precision_by_hand() {
        // Right, wrong, right, of three objects: 1/3 at 1, 1/3 at 2/3, the third never.
        let found = average_precision(vec![(0.2, true), (0.9, true), (0.5, false)], 3);
        assert!((found - (1.0 + 2.0 / 3.0) / 3.0).abs() < 1e-12, "{found}");
        assert_eq!(average_precision(vec![(0.9, false)], 2), 0.0);
        assert_eq!(average_precision(vec![(0.9, true)], 1), 1.0);
    }
}
