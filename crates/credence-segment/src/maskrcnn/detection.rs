use credence_nn::rgbd::{HEIGHT, WIDTH};
use credence_types::Category;

use super::{
    boxes::Edges,
    letterbox::Letterbox,
    network::{CLASSES, MASK_SIDE},
};

/// A value of the mask from which on a pixel belongs to the object.
const INSIDE: f32 = 0.5;

/// An object that the network has found.
#[derive(Debug, Clone, PartialEq)]
pub struct Detection {
    /// Its edges in the network's image, pixels.
    pub edges: Edges,
    /// Probability of each class, the background's first.
    pub classes: [f64; CLASSES],
    /// Its mask in its box, 28x28 probabilities, row-major.
    pub mask: Vec<f32>,
}

impl Detection {
    /// Its most probable category, the first of equals, and how probable.
    pub fn best(&self) -> (Category, f64) {
        best(&self.classes)
    }

    /// Which pixels of the network's image belong to it, row-major.
    pub fn image_mask(&self) -> Vec<bool> {
        let whole = Letterbox::identity();
        self.paste(&whole)
    }

    /// Which pixels of a frame belong to it, row-major.
    pub(super) fn paste(&self, letterbox: &Letterbox) -> Vec<bool> {
        let [width, height] = letterbox.size();
        let [left, top, right, bottom] = self.edges;
        let columns = letterbox.span(left, right, width);
        let places: Vec<Place> = columns
            .clone()
            .map(|column| Place::of(letterbox.to_image(column), [left, right]))
            .collect();
        let mut pixels = vec![false; width * height];
        for row in letterbox.span(top, bottom, height) {
            let y = Place::of(letterbox.to_image(row), [top, bottom]);
            let line = &mut pixels[row * width..][columns.clone()];
            for (pixel, x) in line.iter_mut().zip(&places) {
                let at = |row: usize, column: usize| self.mask[row * MASK_SIDE + column];
                let across = |row| x.between(at(row, x.first), at(row, x.second));
                *pixel = y.between(across(y.first), across(y.second)) >= INSIDE;
            }
        }
        pixels
    }
}

/// The most probable category, the first of equals, and how probable.
pub(super) fn best(classes: &[f64; CLASSES]) -> (Category, f64) {
    let mut best = (Category::ALL[0], classes[1]);
    for (category, probability) in Category::ALL.into_iter().zip(&classes[1..]) {
        if *probability > best.1 {
            best = (category, *probability);
        }
    }
    best
}

/// Two neighbouring values of a mask's side and the weight of the second.
struct Place {
    first: usize,
    second: usize,
    weight: f32,
}

impl Place {
    /// Where a coordinate lies between the edges of a box; beyond the middle of the first and the
    /// last value it is theirs.
    fn of(at: f32, [low, high]: [f32; 2]) -> Self {
        let last = (MASK_SIDE - 1) as f32;
        let place = (at - low) / (high - low) * MASK_SIDE as f32 - 0.5;
        let place = if place.is_finite() {
            place.clamp(0.0, last)
        } else {
            0.0
        };
        let first = place as usize;
        Self {
            first,
            second: (first + 1).min(MASK_SIDE - 1),
            weight: place - first as f32,
        }
    }

    fn between(&self, first: f32, second: f32) -> f32 {
        first + self.weight * (second - first)
    }
}

/// Intersection over union of two masks of one size.
pub fn mask_iou(a: &[bool], b: &[bool]) -> f64 {
    let (mut both, mut either) = (0_usize, 0_usize);
    for (a, b) in a.iter().zip(b) {
        both += usize::from(*a && *b);
        either += usize::from(*a || *b);
    }
    both as f64 / either.max(1) as f64
}

/// The detections that show a pixel and overlap no better one by more than half, by their masks; they
/// come the surest first.
pub(super) fn without_doubles(detections: Vec<Detection>) -> Vec<Detection> {
    let mut kept: Vec<(Detection, Vec<bool>)> = Vec::with_capacity(detections.len());
    for detection in detections {
        let mask = detection.image_mask();
        if !mask.contains(&true) {
            continue;
        }
        let apart = |(other, other_mask): &(Detection, Vec<bool>)| {
            !touch(&detection.edges, &other.edges) || mask_iou(&mask, other_mask) <= 0.5
        };
        if kept.iter().all(apart) {
            kept.push((detection, mask));
        }
    }
    kept.into_iter().map(|(detection, _)| detection).collect()
}

fn touch(a: &Edges, b: &Edges) -> bool {
    a[0].max(b[0]) < a[2].min(b[2]) && a[1].max(b[1]) < a[3].min(b[3])
}

impl Letterbox {
    /// The network's image itself.
    const fn identity() -> Self {
        Self::new([WIDTH, HEIGHT], 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The left half of its box.
    fn half(edges: Edges) -> Detection {
        let mask = (0..MASK_SIDE * MASK_SIDE).map(|i| f32::from(u8::from(i % MASK_SIDE < 14)));
        Detection {
            edges,
            classes: [0.1, 0.0, 0.3, 0.0, 0.0, 0.3, 0.3],
            mask: mask.collect(),
        }
    }

    #[test]
    fn a_mask_is_pasted_where_its_box_is() {
        let detection = half([9.5, 19.5, 19.5, 23.5]);
        let mask = detection.image_mask();
        let inside: Vec<usize> = (0..mask.len()).filter(|at| mask[*at]).collect();
        // Ten pixels across from 10 on, four down from 20 on: the left five are the object.
        let expected: Vec<usize> = (20..24)
            .flat_map(|y| (10..15).map(move |x| y * WIDTH + x))
            .collect();
        assert_eq!(inside, expected);
    }

    #[test]
    fn at_twice_the_resolution_a_mask_has_four_times_the_pixels() {
        let letterbox = Letterbox::new([640, 480], 2.0);
        let mask = half([9.5, 19.5, 29.5, 23.5]).paste(&letterbox);
        let inside: Vec<usize> = (0..mask.len()).filter(|at| mask[*at]).collect();
        // The box is columns 20 to 59 and rows 40 to 47; its middle is the place of column 39.
        let expected: Vec<usize> = (40..48)
            .flat_map(|y| (20..40).map(move |x| y * 640 + x))
            .collect();
        assert_eq!(inside, expected);
    }

    #[test]
    fn boxes_in_padding_and_frames_of_any_shape_are_no_trouble() {
        for (size, scale) in [
            ([100, 240], 1.0),
            ([16, 16], 1.0 / 15.0),
            ([4096, 4096], 17.067),
        ] {
            let letterbox = Letterbox::new(size, scale);
            for edges in [
                [150.0, 20.0, 200.0, 60.0],
                [300.0, 200.0, 319.5, 239.5],
                [319.5, 10.0, 319.5, 20.0],
            ] {
                let mask = half(edges).paste(&letterbox);
                assert_eq!(mask.len(), size[0] * size[1]);
            }
        }
    }

    #[test]
    fn a_box_beyond_the_border_or_of_no_size_is_no_trouble() {
        assert!(
            !half([-50.0, -50.0, -20.0, -20.0])
                .image_mask()
                .contains(&true)
        );
        let thin = half([5.2, 5.2, 5.2, 5.2]).image_mask();
        assert!(!thin.contains(&true));
        let all = half([-400.0, -400.0, 900.0, 900.0]).image_mask();
        // The middle of the box is the place of column 250.
        assert_eq!(all.iter().filter(|v| **v).count(), 251 * HEIGHT);
    }

    #[test]
    fn the_best_category_is_never_the_background_and_the_first_of_equals() {
        assert_eq!(half([0.0; 4]).best(), (Category::Bowl, 0.3));
        let sure_of_nothing = [0.9, 0.0, 0.0, 0.0, 0.0, 0.0, 0.1];
        assert_eq!(best(&sure_of_nothing), (Category::Mug, 0.1));
    }

    #[test]
    fn doubles_go_and_neighbours_stay() {
        let at = |left: f32| half([left, 19.5, left + 40.0, 59.5]);
        // Shifted by 4 of 20 pixels: IoU 16/24; by 10: 10/30.
        let kept = without_doubles(vec![at(9.5), at(13.5), at(19.5)]);
        assert_eq!(kept, [at(9.5), at(19.5)]);
        assert_eq!(mask_iou(&[], &[]), 0.0);
    }
}
