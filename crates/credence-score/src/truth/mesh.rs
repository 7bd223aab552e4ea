use std::sync::OnceLock;

use credence_types::{Point, TriMesh};
use nalgebra::Vector3;
use parry3d_f64::{
    bounding_volume::Aabb,
    math::Vector,
    partitioning::{Bvh, BvhBuildStrategy},
    query::{Ray, RayCast as _},
    shape::Triangle,
};
use rayon::prelude::*;

use super::{order::morton_order, tree::FaceTree};
use crate::{ScoreError, error::same_length};

/// Largest coordinate that is taken for metres of a real scene: beyond it products of coordinates
/// lose the precision that the scores need.
pub const MAX_COORDINATE_M: f64 = 1e6;

/// Height over longest edge below which a face counts as a line without area: its normal would be
/// rounding noise, and on an object of 0.1 m it is thinner than a nanometre.
const DEGENERATE_RATIO: f64 = 1e-8;

/// Points that a thread takes at a time.
const POINTS_PER_TASK: usize = 512;

/// A true mesh, ready to be measured against.
///
/// Any triangle soup will do: it need not be watertight or oriented, vertices may be duplicated.
/// Faces without area have no surface and are left out.
#[derive(Debug)]
pub struct MeshTruth {
    tree: FaceTree,
    ray_tree: OnceLock<Bvh>,
    degenerate_faces: usize,
}

impl MeshTruth {
    /// The truth of a mesh, in the frame of its vertices.
    ///
    /// # Errors
    /// No face with an area, a vertex beyond [`MAX_COORDINATE_M`].
    pub fn new(mesh: &TriMesh) -> Result<Self, ScoreError> {
        let vertices = finite_points("vertices", mesh.vertices())?;
        let faces = mesh.faces();
        let scale = vertices
            .iter()
            .fold(0.0_f64, |scale, v| scale.max(v.abs().max_element()));
        let kept: Vec<Triangle> = faces
            .iter()
            .map(|&[a, b, c]| {
                Triangle::new(
                    vertices[a as usize],
                    vertices[b as usize],
                    vertices[c as usize],
                )
            })
            .filter(has_area)
            .collect();
        if kept.is_empty() {
            return Err(ScoreError::NoSurface { faces: faces.len() });
        }
        Ok(Self {
            degenerate_faces: faces.len() - kept.len(),
            tree: FaceTree::new(kept, scale),
            ray_tree: OnceLock::new(),
        })
    }

    /// Number of faces that were left out because they have no area.
    pub const fn degenerate_faces(&self) -> usize {
        self.degenerate_faces
    }

    /// The unsigned distance from each point to the closest point of the mesh, metres, in the
    /// order of the points.
    ///
    /// # Errors
    /// A point that is not finite or beyond [`MAX_COORDINATE_M`].
    pub fn distances(&self, points: &[Point]) -> Result<Vec<f64>, ScoreError> {
        let points = finite_points("points", points)?;
        Ok(for_each_point(&points, |point| {
            self.tree.squared_distance(point).sqrt()
        }))
    }

    /// Where each ray first meets the mesh, from whichever side, in multiples of its direction's
    /// length; NaN where it misses.
    ///
    /// With directions scaled to z = 1 in the camera, as [`credence_types::Intrinsics::ray`]
    /// yields, the result is the depth that a camera reports. Rays that run exactly along a face
    /// pass it by.
    ///
    /// # Errors
    /// Arrays of different lengths, an origin that is not finite or beyond [`MAX_COORDINATE_M`],
    /// a direction that is zero or not finite.
    pub fn ray_depths(
        &self,
        origins: &[Point],
        directions: &[Vector3<f64>],
    ) -> Result<Vec<f64>, ScoreError> {
        let rays = rays(origins, directions)?;
        Ok(rays
            .par_iter()
            .with_min_len(POINTS_PER_TASK)
            .map(|ray| self.first_hit(ray).unwrap_or(f64::NAN))
            .collect())
    }

    /// Where a ray first meets the mesh.
    fn first_hit(&self, ray: &Ray) -> Option<f64> {
        let faces = self.tree.faces();
        let tree = self.ray_tree.get_or_init(|| {
            let boxes: Vec<Aabb> = faces.iter().map(Triangle::local_aabb).collect();
            Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes)
        });
        tree.cast_ray(ray, f64::MAX, |face, best| {
            faces[face as usize].cast_local_ray(ray, best, false)
        })
        .map(|(_, depth)| depth)
    }
}

/// Maps every point in parallel, near ones together, and returns the results in the points' order.
fn for_each_point(points: &[Vector], map: impl Fn(Vector) -> f64 + Sync) -> Vec<f64> {
    let order = morton_order(points);
    let values: Vec<f64> = order
        .par_iter()
        .with_min_len(POINTS_PER_TASK)
        .map(|&index| map(points[index]))
        .collect();
    let mut results = vec![0.0; points.len()];
    for (index, value) in order.into_iter().zip(values) {
        results[index] = value;
    }
    results
}

/// Rays from checked origins and directions.
fn rays(origins: &[Point], directions: &[Vector3<f64>]) -> Result<Vec<Ray>, ScoreError> {
    same_length(("directions", directions.len()), ("origins", origins.len()))?;
    let origins = finite_points("origins", origins)?;
    origins
        .into_iter()
        .zip(directions)
        .enumerate()
        .map(|(index, (origin, direction))| {
            let length = direction.norm();
            if length > 0.0 && length.is_finite() {
                Ok(Ray::new(origin, Vector::from_array((*direction).into())))
            } else {
                Err(ScoreError::Direction {
                    index,
                    direction: (*direction).into(),
                })
            }
        })
        .collect()
}

/// parry's vectors of points that are finite and within [`MAX_COORDINATE_M`].
pub(crate) fn finite_points(
    name: &'static str,
    points: &[Point],
) -> Result<Vec<Vector>, ScoreError> {
    points
        .iter()
        .enumerate()
        .map(|(index, point)| {
            if point.iter().all(|c| c.abs() <= MAX_COORDINATE_M) {
                Ok(Vector::new(point.x, point.y, point.z))
            } else {
                Err(ScoreError::Point {
                    name,
                    index,
                    point: point.coords.into(),
                })
            }
        })
        .collect()
}

/// Whether a face is more than a line: twice its area is its longest edge times its height.
fn has_area(face: &Triangle) -> bool {
    let [ab, bc, ca] = [face.b - face.a, face.c - face.b, face.a - face.c];
    let longest = ab
        .length_squared()
        .max(bc.length_squared())
        .max(ca.length_squared());
    ab.cross(ca).length() > DEGENERATE_RATIO * longest
}
