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

/// Query points in the world, metres, the two kinds mixed, and their distances from the surface.
pub(super) fn ask(target: &Placed<'_>, rng: &mut impl Rng) -> Vec<(Vector, f64)> {
    let mut points: Vec<Vector> = (0..QUERIES / 2)
        .map(|_| {
            let sigma = SIGMAS_M[rng.random_range(0..SIGMAS_M.len())];
            target.world_point(target.mesh.surface_point(rng)) + sigma * normals(rng)
        })
        .collect();
    let padding = BOX_PADDING_M / target.scale;
    let [x, y] = target.mesh.half_extents.map(|half| half + padding);
    points.extend((0..QUERIES / 2).map(|_| {
        let [a, b, c] = [(); 3].map(|()| rng.random::<f64>());
        target.world_point(Vector::new(
            x * (2.0 * a - 1.0),
            y * (2.0 * b - 1.0),
            (target.mesh.height + padding) * c,
        ))
    }));
    // Fisher and Yates.
    for at in (1..points.len()).rev() {
        points.swap(at, rng.random_range(0..=at));
    }
    points
        .into_iter()
        .map(|point| (point, target.distance_m(point)))
        .collect()
}

/// Three independent standard normal numbers, by Box and Muller's transform.
pub(super) fn normals(rng: &mut impl Rng) -> Vector {
    let drawn = [(); 3].map(|()| {
        let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
        radius * (std::f64::consts::TAU * rng.random::<f64>()).cos()
    });
    Vector::from_array(drawn)
}
