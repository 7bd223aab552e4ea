use credence_types::{Point, Pose, TriMesh};
use nalgebra::Vector3;

use super::{
    MeshTruth,
    mesh::{finite_points, for_each_point, for_each_ray, rays},
};
use crate::ScoreError;

/// The nearest of a scene's meshes.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Nearest {
    /// Unsigned distance to it, metres.
    pub distance_m: f64,
    /// Its position in the scene; the first of equally near ones.
    pub mesh: usize,
}

impl Nearest {
    /// The mesh that the point lies on, if it lies on one.
    pub fn within(&self, tolerance_m: f64) -> Option<usize> {
        (self.distance_m <= tolerance_m).then_some(self.mesh)
    }
}

/// The true meshes of a scene, posed in the world.
#[derive(Debug)]
pub struct SceneTruth {
    meshes: Vec<MeshTruth>,
}

impl SceneTruth {
    /// The truth of meshes with their `world_from_mesh`.
    ///
    /// # Errors
    /// No mesh, and what [`MeshTruth::new`] refuses.
    pub fn new(posed: &[(&TriMesh, Pose)]) -> Result<Self, ScoreError> {
        if posed.is_empty() {
            return Err(ScoreError::NoMesh);
        }
        let meshes = posed
            .iter()
            .map(|(mesh, world_from_mesh)| MeshTruth::posed(mesh, world_from_mesh))
            .collect::<Result<_, _>>()?;
        Ok(Self { meshes })
    }

    /// The meshes, in the order they were given in.
    pub fn meshes(&self) -> &[MeshTruth] {
        &self.meshes
    }

    /// The nearest mesh of each point, in the order of the points.
    ///
    /// # Errors
    /// As [`MeshTruth::distances`].
    pub fn nearest(&self, points_world: &[Point]) -> Result<Vec<Nearest>, ScoreError> {
        let points_world = finite_points("points", points_world)?;
        Ok(for_each_point(&points_world, |point| {
            let mut best = (f64::INFINITY, 0);
            for (index, mesh) in self.meshes.iter().enumerate() {
                let squared = mesh.squared_distance(point, best.0);
                if squared < best.0 {
                    best = (squared, index);
                }
            }
            Nearest {
                distance_m: best.0.sqrt(),
                mesh: best.1,
            }
        }))
    }

    /// Where each ray first meets any of the meshes, as [`MeshTruth::ray_depths`].
    ///
    /// # Errors
    /// As [`MeshTruth::ray_depths`].
    pub fn ray_depths(
        &self,
        origins_world: &[Point],
        directions_world: &[Vector3<f64>],
    ) -> Result<Vec<f64>, ScoreError> {
        let rays = rays(origins_world, directions_world)?;
        Ok(for_each_ray(&rays, |ray| {
            self.meshes.iter().fold(None, |nearest, mesh| {
                let limit = nearest.unwrap_or(f64::MAX);
                mesh.first_hit(ray, limit).or(nearest)
            })
        }))
    }
}
