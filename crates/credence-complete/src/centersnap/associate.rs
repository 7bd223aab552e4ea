use credence_nn::rgbd::{HEIGHT, WIDTH};
use credence_types::{Frame, Instance, Point};

use super::{
    detect::Detection,
    image::{CENTRE, FOCAL_PX, sources},
};

/// Pixels of a side of the squares that silhouettes are compared by: 2,048 points leave no holes.
const SQUARE: usize = 4;
const ACROSS: usize = WIDTH / SQUARE;
const DOWN: usize = HEIGHT / SQUARE;

/// Squares between a mask and a detection's cell that is still next to it.
const NEXT_TO: usize = 3;

/// Least overlap, intersection over union, of a mask with its object's silhouette. A mask shows the
/// visible part only, so that much less than the whole may be right.
const LEAST_OVERLAP: f64 = 0.2;

/// The detection of each instance: its cell lies in the mask or next to it, and its cloud covers
/// the mask. The surest and best covering pairs come first; no detection belongs to two instances.
///
/// The masks fit the frame.
pub(super) fn associate(
    frame: &Frame,
    instances: &[Instance],
    detections: &[Detection],
) -> Vec<Option<usize>> {
    let sources: Vec<Option<usize>> = sources(frame).collect();
    let silhouettes: Vec<Silhouette> = detections
        .iter()
        .map(|detection| Silhouette::of_points(&detection.points_camera))
        .collect();
    let mut pairs = Vec::new();
    for (i, instance) in instances.iter().enumerate() {
        let mask = Silhouette::of_mask(instance.mask(), &sources);
        for (d, (detection, silhouette)) in detections.iter().zip(&silhouettes).enumerate() {
            let overlap = mask.overlap(silhouette);
            if overlap >= LEAST_OVERLAP && mask.is_next_to(detection.pixel) {
                pairs.push((overlap * detection.score, i, d));
            }
        }
    }
    pairs.sort_by(|a, b| b.0.total_cmp(&a.0).then((a.1, a.2).cmp(&(b.1, b.2))));
    let mut of_instance = vec![None; instances.len()];
    let mut taken = vec![false; detections.len()];
    for (_, i, d) in pairs {
        if of_instance[i].is_none() && !taken[d] {
            of_instance[i] = Some(d);
            taken[d] = true;
        }
    }
    of_instance
}

/// The squares of the network's image that something covers.
struct Silhouette {
    covered: Vec<bool>,
}

impl Silhouette {
    fn of_mask(mask: &[bool], sources: &[Option<usize>]) -> Self {
        let mut covered = vec![false; ACROSS * DOWN];
        for (pixel, source) in sources.iter().enumerate() {
            if source.is_some_and(|source| mask[source]) {
                covered[pixel / WIDTH / SQUARE * ACROSS + pixel % WIDTH / SQUARE] = true;
            }
        }
        Self { covered }
    }

    fn of_points(points_camera: &[Point]) -> Self {
        let mut covered = vec![false; ACROSS * DOWN];
        for point in points_camera.iter().filter(|point| point.z > 0.0) {
            let at = |axis: usize| FOCAL_PX * point[axis] / point.z + CENTRE[axis];
            if let Some(square) = square_at([at(0), at(1)]) {
                covered[square] = true;
            }
        }
        Self { covered }
    }

    /// Intersection over union; 0 where there is neither.
    fn overlap(&self, other: &Self) -> f64 {
        let squares = || self.covered.iter().zip(&other.covered);
        let both = squares().filter(|(a, b)| **a && **b).count();
        let either = squares().filter(|(a, b)| **a || **b).count();
        both as f64 / either.max(1) as f64
    }

    /// Whether a pixel of the network's image lies within three squares of it.
    fn is_next_to(&self, pixel: [f64; 2]) -> bool {
        let Some(square) = square_at(pixel) else {
            return false;
        };
        let (row, column) = (square / ACROSS, square % ACROSS);
        let around =
            |at: usize, size: usize| at.saturating_sub(NEXT_TO)..(at + NEXT_TO + 1).min(size);
        around(row, DOWN)
            .any(|row| around(column, ACROSS).any(|column| self.covered[row * ACROSS + column]))
    }
}

/// The square that holds a pixel of the network's image.
fn square_at([u, v]: [f64; 2]) -> Option<usize> {
    let (column, row) = (u.round(), v.round());
    let inside = (0.0..WIDTH as f64).contains(&column) && (0.0..HEIGHT as f64).contains(&row);
    inside.then(|| row as usize / SQUARE * ACROSS + column as usize / SQUARE)
}

#[cfg(test)]
mod tests {
    use credence_types::{Category, Intrinsics, Pose};
    use nalgebra::{Matrix3, Vector3};

    use super::*;
    use crate::centersnap::ObjectPose;

    /// The network's own camera, everything half a metre away.
    fn frame() -> Frame {
        let camera = Intrinsics::new([WIDTH, HEIGHT], [FOCAL_PX; 2], CENTRE).unwrap();
        let pixels = WIDTH * HEIGHT;
        Frame::new(
            vec![[0; 3]; pixels],
            vec![0.5; pixels],
            camera,
            Pose::identity(),
            None,
        )
        .unwrap()
    }

    /// Rows and columns of a square of the image, from its upper left corner.
    fn square([left, top]: [usize; 2], side: usize) -> impl Iterator<Item = [usize; 2]> {
        (top..top + side).flat_map(move |row| (left..left + side).map(move |column| [column, row]))
    }

    fn instance(corner: [usize; 2], side: usize) -> Instance {
        let mut mask = vec![false; WIDTH * HEIGHT];
        for [column, row] in square(corner, side) {
            mask[row * WIDTH + column] = true;
        }
        Instance::certain(0, mask, Category::Can).unwrap()
    }

    fn detection(corner: [usize; 2], side: usize, score: f64) -> Detection {
        let points = square(corner, side).map(|[column, row]| {
            let at = |pixel: usize, axis: usize| (pixel as f64 - CENTRE[axis]) / FOCAL_PX * 0.5;
            Point::new(at(column, 0), at(row, 1), 0.5)
        });
        Detection {
            category: Category::Can,
            score,
            pixel: corner.map(|c| c as f64 + side as f64 / 2.0),
            pose: ObjectPose {
                rotation: Matrix3::identity(),
                centre_m: Vector3::zeros(),
                scale_m: 1.0,
            },
            size_m: [0.0; 3],
            points_camera: points.collect(),
            spread_m: Vec::new(),
        }
    }

    #[test]
    fn each_instance_gets_the_detection_that_covers_it_and_no_two_the_same() {
        let instances = [
            instance([40, 40], 40),
            instance([100, 40], 40),
            // Under the first detection as well, but worse.
            instance([60, 60], 40),
            instance([200, 160], 40),
        ];
        let detections = [
            detection([104, 40], 40, 0.6),
            detection([44, 44], 40, 0.9),
            // Off the last instance's mask by less than half, and twice as sure elsewhere.
            detection([200, 176], 40, 0.5),
            detection([280, 0], 20, 1.0),
        ];
        let found = associate(&frame(), &instances, &detections);
        assert_eq!(found, [Some(1), Some(0), None, Some(2)]);
        assert_eq!(associate(&frame(), &instances, &[]), [None; 4]);
        assert_eq!(associate(&frame(), &[], &detections), []);
    }

    #[test]
    fn the_surer_of_two_equal_detections_is_taken() {
        let detections = [detection([40, 40], 40, 0.4), detection([40, 40], 40, 0.8)];
        assert_eq!(
            associate(&frame(), &[instance([40, 40], 40)], &detections),
            [Some(1)]
        );
    }

    #[test]
    fn a_small_part_of_an_object_is_no_part_of_it() {
        let instances = [instance([40, 40], 16)];
        assert_eq!(
            associate(&frame(), &instances, &[detection([40, 40], 60, 1.0)]),
            [None]
        );
    }
}
