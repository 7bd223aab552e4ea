use std::f64::consts::TAU;

use credence_embed::{EmbedError, metric::centred};
use credence_types::{Category, FREE_CLASS, Point};
use rand::{Rng, RngExt as _};

use crate::data::Scene;

/// Points with their classes: observed points of the object and its neighbours, and free space,
/// about half and half.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct LabelledCloud {
    pub(super) points: Vec<Point>,
    pub(super) classes: Vec<u8>,
}

impl LabelledCloud {
    /// `size` points of a scene. Where it has fewer, all of them stand in the cloud about equally
    /// often.
    pub(super) fn from_scene(scene: &Scene, size: usize) -> Self {
        let own = scene.object.iter().map(|p| (p, scene.category));
        let others = scene.neighbours.iter().map(|(p, category)| (p, *category));
        let occupied = scene.object.len() + scene.neighbours.len();
        let (taken, free) = halves(size, occupied, scene.free.len());
        // The lists are in random order: their beginnings are samples of them.
        let own_taken = (taken * scene.object.len()).div_ceil(occupied.max(1));
        let labelled: Vec<(Point, u8)> = own
            .take(own_taken)
            .chain(others.take(taken - own_taken))
            .map(|(p, category)| (wide(*p), category.class()))
            .chain(scene.free.iter().take(free).map(|p| (wide(*p), FREE_CLASS)))
            .collect();
        let (points, classes) = labelled.iter().copied().cycle().take(size).unzip();
        Self { points, classes }
    }

    /// The network's coordinates, turned about the vertical and mirrored at random: of what stands
    /// on a table, neither says anything about its class.
    pub(super) fn turned(&self, rng: &mut impl Rng) -> Result<Vec<[f32; 3]>, EmbedError> {
        let (sin, cos) = rng.random_range(0.0..TAU).sin_cos();
        let (sin, cos) = (sin as f32, cos as f32);
        let mirror = if rng.random::<bool>() { -1.0 } else { 1.0 };
        let mut points = centred(&self.points)?;
        for [x, y, _] in &mut points {
            let mirrored = mirror * *x;
            (*x, *y) = (cos * mirrored - sin * *y, sin * mirrored + cos * *y);
        }
        Ok(points)
    }

    /// Points of objects with their categories.
    pub(super) fn occupied(&self) -> impl Iterator<Item = (usize, Category)> + '_ {
        let categories = self
            .classes
            .iter()
            .map(|&class| Category::from_class(class));
        categories
            .enumerate()
            .filter_map(|(index, category)| Some((index, category?)))
    }
}

/// How many occupied and free points make up `size`: half each, more of one kind where the other
/// is short.
fn halves(size: usize, occupied: usize, free: usize) -> (usize, usize) {
    let taken_free = free.min(size - occupied.min(size / 2));
    (occupied.min(size - taken_free), taken_free)
}

fn wide(point: [f32; 3]) -> Point {
    Point::from(point.map(f64::from))
}

#[cfg(test)]
mod tests {
    use credence_types::stream;

    use super::*;

    fn scene(object: usize, neighbours: usize, free: usize) -> Scene {
        let points = |count: usize, z: f32| (0..count).map(move |i| [i as f32, 1.0, z]);
        Scene {
            category: Category::Mug,
            object: points(object, 0.0).collect(),
            neighbours: points(neighbours, 1.0)
                .map(|p| (p, Category::Can))
                .collect(),
            free: points(free, 2.0).collect(),
            viewpoint: [0.0; 3],
            queries: Vec::new(),
            distances_m: Vec::new(),
            surroundings: Vec::new(),
            nearest: Vec::new(),
        }
    }

    fn counts(cloud: &LabelledCloud) -> [usize; 3] {
        [Category::Mug.class(), Category::Can.class(), FREE_CLASS]
            .map(|class| cloud.classes.iter().map(|c| usize::from(*c == class)).sum())
    }

    #[test]
    fn half_of_a_cloud_is_free_and_neighbours_have_their_share_of_the_rest() {
        for (available, expected) in [
            ([300, 0, 300], [50, 0, 50]),
            ([300, 100, 300], [38, 12, 50]),
            ([20, 0, 300], [20, 0, 80]),
            ([300, 0, 10], [90, 0, 10]),
            // Twenty points for a hundred places: every one five times.
            ([6, 4, 10], [30, 20, 50]),
        ] {
            let [object, neighbours, free] = available;
            let cloud = LabelledCloud::from_scene(&scene(object, neighbours, free), 100);
            assert_eq!(counts(&cloud), expected, "{available:?}");
            let on_level = |(p, class): (&Point, &u8)| match p.z {
                0.0 => *class == Category::Mug.class(),
                1.0 => *class == Category::Can.class(),
                _ => *class == FREE_CLASS,
            };
            assert!(cloud.points.iter().zip(&cloud.classes).all(on_level));
            assert_eq!(cloud.occupied().count(), expected[0] + expected[1]);
        }
    }

    #[test]
    fn turning_keeps_heights_and_distances() {
        let cloud = LabelledCloud::from_scene(&scene(30, 10, 40), 80);
        let plain = centred(&cloud.points).unwrap();
        let turned = cloud.turned(&mut stream(1, "turn")).unwrap();
        assert_ne!(plain, turned);
        let distance = |a: [f32; 3], b: [f32; 3]| (a[0] - b[0]).hypot(a[1] - b[1]);
        for (p, t) in plain.iter().zip(&turned) {
            assert_eq!(p[2], t[2]);
            let (before, after) = (distance(*p, plain[0]), distance(*t, turned[0]));
            assert!((before - after).abs() < 1e-3 * (1.0 + before));
        }
    }
}
