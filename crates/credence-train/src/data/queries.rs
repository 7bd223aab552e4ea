//! Points to ask about, and the truth.

use parry3d_f64::math::Vector;
use rand::{Rng, RngExt as _};

use super::stage::Placed;

/// Queries per scene, half of each kind.
pub(super) const QUERIES: usize = 1024;
/// Standard deviations of the noise on surface points, one drawn per point.
const SIGMAS_M: [f64; 4] = [0.001, 0.003, 0.006, 0.015];
/// Padding of the true box that the other half fills.
const BOX_PADDING_M: f64 = 0.01;

/// Further queries per scene, which tell where the object is from farther away.
pub(super) const SURROUNDINGS: usize = 512;
/// Padding of the true box that they fill: a completer looks this far beyond what was seen.
const SURROUNDINGS_PADDING_M: f64 = 0.06;

/// A query point and the surface's point nearest to it, in the world, metres.
#[derive(Debug, Clone, Copy)]
pub(super) struct Query {
    pub(super) point: Vector,
    pub(super) nearest: Vector,
}

impl Query {
    fn new(target: &Placed<'_>, point: Vector) -> Self {
        let nearest = target.nearest(point);
        Self { point, nearest }
    }

    pub(super) fn distance_m(&self) -> f64 {
        self.point.distance(self.nearest)
    }
}

/// Query points of both kinds, mixed.
pub(super) fn ask(target: &Placed<'_>, rng: &mut impl Rng) -> Vec<Query> {
    let mut points: Vec<Vector> = (0..QUERIES / 2)
        .map(|_| {
            let sigma = SIGMAS_M[rng.random_range(0..SIGMAS_M.len())];
            target.world_point(target.mesh.surface_point(rng)) + sigma * normals(rng)
        })
        .collect();
    points.extend((0..QUERIES / 2).map(|_| anywhere(target, BOX_PADDING_M, rng)));
    // Fisher and Yates.
    for at in (1..points.len()).rev() {
        points.swap(at, rng.random_range(0..=at));
    }
    points
        .into_iter()
        .map(|point| Query::new(target, point))
        .collect()
}

/// Query points all around the object.
pub(super) fn ask_around(target: &Placed<'_>, rng: &mut impl Rng) -> Vec<Query> {
    (0..SURROUNDINGS)
        .map(|_| Query::new(target, anywhere(target, SURROUNDINGS_PADDING_M, rng)))
        .collect()
}

/// A world point in the target's own box, padded but for its underside.
fn anywhere(target: &Placed<'_>, padding_m: f64, rng: &mut impl Rng) -> Vector {
    let padding = padding_m / target.scale;
    let [x, y] = target.mesh.half_extents.map(|half| half + padding);
    let [a, b, c] = [(); 3].map(|()| rng.random::<f64>());
    target.world_point(Vector::new(
        x * (2.0 * a - 1.0),
        y * (2.0 * b - 1.0),
        (target.mesh.height + padding) * c,
    ))
}

/// Three independent standard normal numbers, by Box and Muller's transform.
pub(super) fn normals(rng: &mut impl Rng) -> Vector {
    let drawn = [(); 3].map(|()| {
        let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
        radius * (std::f64::consts::TAU * rng.random::<f64>()).cos()
    });
    Vector::from_array(drawn)
}
