//! Parts of a mask that the depth shows to be of something else.
//!
//! A mask that is a pixel too wide takes in a band of the table behind the object, and a completer
//! that is told of it imagines an object that reaches there. Where the depth jumps, the object ends.

use credence_types::{Frame, Instance, InvalidInput};

/// Neighbouring measurements lie on one surface if their depths differ by less than this share: the
/// sensor's own measure of an edge (`sim_scenes.sensor`).
const JUMP: f32 = 0.02;
/// Pixels between neighbours at most: about edges, every second measurement is lost.
const REACH: usize = 2;
/// A part of the mask with fewer of its measured pixels is of something else.
const LEAST_SHARE: f64 = 0.05;

/// The instance without the small parts of its mask whose depth is apart from the rest. Pixels
/// without depth stay.
///
/// # Errors
/// A mask that does not fit the frame.
pub fn trimmed(frame: &Frame, instance: &Instance) -> Result<Instance, InvalidInput> {
    instance.check_fits(frame.intrinsics())?;
    let parts = parts(frame, instance.mask());
    let measured: usize = parts.iter().map(Vec::len).sum();
    let mut mask = instance.mask().to_vec();
    for part in parts {
        if (part.len() as f64) < LEAST_SHARE * measured as f64 {
            for pixel in part {
                mask[pixel] = false;
            }
        }
    }
    Instance::new(0, mask, *instance.class_scores(), instance.score())
}

/// The measured pixels of a mask by the surface that they lie on.
fn parts(frame: &Frame, mask: &[bool]) -> Vec<Vec<usize>> {
    let [width, height] = [frame.intrinsics().width(), frame.intrinsics().height()];
    let depth_m = frame.depth_m();
    let mut left: Vec<bool> = mask
        .iter()
        .zip(depth_m)
        .map(|(inside, depth)| *inside && !depth.is_nan())
        .collect();
    let around = |at: usize, size: usize| at.saturating_sub(REACH)..=(at + REACH).min(size - 1);
    let mut parts = Vec::new();
    for first in 0..left.len() {
        if !std::mem::take(&mut left[first]) {
            continue;
        }
        let mut part = vec![first];
        let mut next = 0;
        while let Some(&pixel) = part.get(next) {
            next += 1;
            for row in around(pixel / width, height) {
                for column in around(pixel % width, width) {
                    let other = row * width + column;
                    let jump = (depth_m[other] - depth_m[pixel]).abs();
                    if left[other] && jump < JUMP * depth_m[pixel].min(depth_m[other]) {
                        left[other] = false;
                        part.push(other);
                    }
                }
            }
        }
        parts.push(part);
    }
    parts
}

#[cfg(test)]
mod tests {
    use credence_types::{Category, Intrinsics, Pose};

    use super::*;

    const WIDTH: usize = 20;

    /// A table at 0.6 m with a box before it at 0.5 m, in columns 5 to 14 of ten rows.
    fn frame(change: impl Fn(usize, usize, &mut f32)) -> Frame {
        let camera = Intrinsics::new([WIDTH, 10], [20.0; 2], [9.5, 4.5]).unwrap();
        let mut depth_m = Vec::new();
        for pixel in 0..WIDTH * 10 {
            let (column, row) = (pixel % WIDTH, pixel / WIDTH);
            let mut depth = if (5..15).contains(&column) { 0.5 } else { 0.6 };
            change(column, row, &mut depth);
            depth_m.push(depth);
        }
        let rgb = vec![[0; 3]; WIDTH * 10];
        Frame::new(rgb, depth_m, camera, Pose::identity(), None).unwrap()
    }

    fn instance(columns: std::ops::Range<usize>) -> Instance {
        let mask = (0..WIDTH * 10).map(|pixel| columns.contains(&(pixel % WIDTH)));
        Instance::certain(0, mask.collect(), Category::Mug).unwrap()
    }

    fn kept(frame: &Frame, instance: &Instance) -> Vec<usize> {
        let mask = trimmed(frame, instance).unwrap().mask().to_vec();
        (0..WIDTH)
            .filter(|column| mask[5 * WIDTH + column])
            .collect()
    }

    #[test]
    fn a_band_of_the_table_goes_and_the_object_stays() {
        // 4 of 104 pixels: the mask takes in a bit of the table.
        let table = frame(|_, row, depth| {
            if row != 5 && *depth > 0.55 {
                *depth = f32::NAN;
            }
        });
        let wide = instance(3..17);
        assert_eq!(kept(&table, &wide), (5..15).collect::<Vec<_>>());
        assert_eq!(trimmed(&table, &wide).unwrap().score(), wide.score());
    }

    #[test]
    fn a_large_part_apart_is_kept_for_something_may_stand_before_the_object() {
        // Three columns of the table are a fifth of the mask.
        assert_eq!(
            kept(&frame(|_, _, _| ()), &instance(2..15)),
            (2..15).collect::<Vec<_>>()
        );
    }

    #[test]
    fn slopes_and_lost_pixels_do_not_part_a_surface() {
        let slope = frame(|column, row, depth| {
            // 3 mm a pixel, and every second one lost.
            *depth = 0.5 + 0.003 * column as f32;
            if (column + row).is_multiple_of(2) {
                *depth = f32::NAN;
            }
        });
        assert_eq!(kept(&slope, &instance(0..20)), (0..20).collect::<Vec<_>>());
    }

    #[test]
    fn a_mask_without_any_depth_stays_and_one_of_another_size_is_refused() {
        let blind = frame(|column, _, depth| {
            if column > 0 {
                *depth = f32::NAN;
            }
        });
        assert_eq!(kept(&blind, &instance(3..9)), (3..9).collect::<Vec<_>>());
        let small = Instance::certain(0, vec![true; 4], Category::Mug).unwrap();
        assert!(trimmed(&blind, &small).is_err());
    }
}
