use credence_complete::centersnap::has_front;
use parry3d_f64::math::Vector;
use rand::{Rng, RngExt as _};
use std::f64::consts::TAU;

use crate::data::Mesh;

/// Lengths that a shape's axes are stretched by, so that proportions vary beyond the meshes'.
const STRETCH: [f64; 2] = [0.88, 1.14];

/// How a mesh is brought into the normalised object frame.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Turn {
    /// Angle about the vertical.
    pub(crate) yaw_rad: f64,
    /// Factors along the mesh's axes, before it is turned.
    pub(crate) stretch: [f64; 3],
}

impl Turn {
    /// The mesh as it is.
    pub(crate) const NONE: Self = Self {
        yaw_rad: 0.0,
        stretch: [1.0; 3],
    };

    /// Random proportions; any azimuth for a category that has no front.
    fn draw(mesh: &Mesh, rng: &mut impl Rng) -> Self {
        let yaw = rng.random::<f64>() * TAU;
        Self {
            yaw_rad: if has_front(mesh.category) { 0.0 } else { yaw },
            stretch: [(); 3].map(|()| rng.random_range(STRETCH[0]..STRETCH[1])),
        }
    }
}

/// Points uniform over the mesh's surface, in the normalised object frame: z up, the middle of the
/// mesh's box at the origin, the box's diagonal 1.
pub(crate) fn canonical_cloud(
    mesh: &Mesh,
    turn: Turn,
    count: usize,
    rng: &mut impl Rng,
) -> Vec<[f32; 3]> {
    let stretch = Vector::from_array(turn.stretch);
    let [x, y] = mesh.half_extents;
    let diagonal = (Vector::new(2.0 * x, 2.0 * y, mesh.height) * stretch).length();
    let middle = Vector::new(0.0, 0.0, mesh.height / 2.0);
    let (sin, cos) = turn.yaw_rad.sin_cos();
    (0..count)
        .map(|_| {
            let p = (mesh.surface_point(rng) - middle) * stretch / diagonal;
            [cos * p.x - sin * p.y, sin * p.x + cos * p.y, p.z].map(|c| c as f32)
        })
        .collect()
}

/// A cloud to train on.
pub(super) fn training_cloud(mesh: &Mesh, count: usize, rng: &mut impl Rng) -> Vec<[f32; 3]> {
    let turn = Turn::draw(mesh, rng);
    canonical_cloud(mesh, turn, count, rng)
}
