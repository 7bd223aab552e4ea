//! The meshes that scenes are drawn from.

use std::{fs, path::Path, sync::OnceLock};

use credence_types::Category;
use parry3d_f64::{
    bounding_volume::Aabb,
    math::Vector,
    partitioning::{Bvh, BvhBuildStrategy},
    query::PointQuery as _,
    shape::Triangle,
};
use rand::{Rng, RngExt as _};
use rayon::prelude::*;
use serde::Deserialize;

use super::ply;
use crate::TrainError;

/// Name of the list of meshes in their folder.
const MANIFEST: &str = "MANIFEST.json";

/// The meshes of a folder, of all six categories.
#[derive(Debug)]
pub struct MeshSet {
    /// In the manifest's order.
    meshes: Vec<Mesh>,
    /// Indices into `meshes`, in the order of [`Category::ALL`].
    of_category: [Vec<usize>; Category::ALL.len()],
    fingerprint: u64,
}

/// A mesh in metres, z up, its lowest point at z = 0 and the middle of its box above the origin.
#[derive(Debug)]
pub(crate) struct Mesh {
    pub(crate) category: Category,
    pub(crate) vertices: Vec<Vector>,
    /// Those with area.
    pub(crate) faces: Vec<[u32; 3]>,
    /// Half its box along x and y, and its height.
    pub(crate) half_extents: [f64; 2],
    pub(crate) height: f64,
    /// Of the circle about the z axis that holds it.
    pub(super) radius: f64,
    /// Sums of the faces' areas up to and with each.
    areas: Vec<f64>,
    /// Built when the mesh is first a target.
    tree: OnceLock<Bvh>,
}

#[derive(Deserialize)]
struct Entry {
    path: String,
    category: String,
}

impl MeshSet {
    /// Reads the meshes that `MANIFEST.json` in a folder lists.
    ///
    /// # Errors
    /// A manifest or mesh that is missing, cut short or not what `harness assets` writes; a
    /// category without meshes.
    pub fn open(folder: &Path) -> Result<Self, TrainError> {
        let path = folder.join(MANIFEST);
        let text = read(&path)?;
        let bad = |problem: String| TrainError::Mesh {
            path: path.clone(),
            problem,
        };
        let entries: Vec<Entry> = serde_json::from_slice(&text)
            .map_err(|err| bad(format!("it is not a list of meshes: {err}")))?;
        let loaded: Vec<(Mesh, u64)> = entries
            .par_iter()
            .map(|entry| {
                let category: Category = entry
                    .category
                    .parse()
                    .map_err(|err| bad(format!("{}: {err}", entry.path)))?;
                Mesh::open(&folder.join(&entry.path), category)
            })
            .collect::<Result<_, _>>()?;
        let mut of_category: [Vec<usize>; Category::ALL.len()] = Default::default();
        let mut fingerprint = Fingerprint::default();
        for (index, (mesh, hash)) in loaded.iter().enumerate() {
            of_category[usize::from(mesh.category.class()) - 1].push(index);
            fingerprint.add(&[mesh.category.class()]);
            fingerprint.add(&hash.to_le_bytes());
        }
        if let Some(missing) = of_category.iter().position(Vec::is_empty) {
            return Err(bad(format!("it lists no {}", Category::ALL[missing])));
        }
        Ok(Self {
            meshes: loaded.into_iter().map(|(mesh, _)| mesh).collect(),
            of_category,
            fingerprint: fingerprint.0,
        })
    }

    /// Number of meshes.
    pub fn len(&self) -> usize {
        self.meshes.len()
    }

    /// Never: a set without meshes does not open.
    pub fn is_empty(&self) -> bool {
        self.meshes.is_empty()
    }

    /// A hash of every mesh's bytes and category.
    pub(super) fn fingerprint(&self) -> u64 {
        self.fingerprint
    }

    /// All meshes, in the manifest's order.
    pub(crate) fn meshes(&self) -> &[Mesh] {
        &self.meshes
    }

    /// A mesh of a category, each as likely.
    pub(crate) fn draw(&self, category: Category, rng: &mut impl Rng) -> &Mesh {
        let of_category = &self.of_category[usize::from(category.class()) - 1];
        &self.meshes[of_category[rng.random_range(0..of_category.len())]]
    }
}

impl Mesh {
    fn open(path: &Path, category: Category) -> Result<(Self, u64), TrainError> {
        let bytes = read(path)?;
        let mut fingerprint = Fingerprint::default();
        fingerprint.add(&bytes);
        let mesh = ply::parse(&bytes)
            .and_then(|parsed| Self::new(parsed, category))
            .map_err(|problem| TrainError::Mesh {
                path: path.to_path_buf(),
                problem,
            })?;
        Ok((mesh, fingerprint.0))
    }

    pub(super) fn new(parsed: ply::Triangles, category: Category) -> Result<Self, String> {
        let ply::Triangles { vertices, faces } = parsed;
        let mut vertices: Vec<Vector> = vertices
            .into_iter()
            .map(|[x, y, z]| Vector::new(x.into(), y.into(), z.into()))
            .collect();
        let area = |face: &[u32; 3]| {
            let [a, b, c] = face.map(|corner| vertices[corner as usize]);
            (b - a).cross(c - a).length() / 2.0
        };
        let mut total = 0.0;
        let (mut areas, mut with_area) = (Vec::new(), Vec::new());
        for face in faces {
            let area = area(&face);
            if area > 0.0 {
                total += area;
                areas.push(total);
                with_area.push(face);
            }
        }
        if with_area.is_empty() {
            return Err("its faces have no area".to_owned());
        }
        let unbounded = Vector::splat(f64::INFINITY);
        let (low, high) = vertices
            .iter()
            .fold((unbounded, -unbounded), |(low, high), vertex| {
                (low.min(*vertex), high.max(*vertex))
            });
        let size = high - low;
        if size.max_element() >= MAX_SIZE_M {
            return Err(format!(
                "it measures {:.3} m, at least {MAX_SIZE_M} m: its unit is not the metre",
                size.max_element()
            ));
        }
        let origin = Vector::new(low.x.midpoint(high.x), low.y.midpoint(high.y), low.z);
        for vertex in &mut vertices {
            *vertex -= origin;
        }
        let radius = vertices.iter().map(|v| v.x.hypot(v.y)).fold(0.0, f64::max);
        Ok(Self {
            category,
            vertices,
            faces: with_area,
            half_extents: [size.x / 2.0, size.y / 2.0],
            height: size.z,
            radius,
            areas,
            tree: OnceLock::new(),
        })
    }

    /// Diagonal of its box.
    pub(crate) fn diagonal(&self) -> f64 {
        let [x, y] = self.half_extents;
        (4.0 * (x * x + y * y) + self.height * self.height).sqrt()
    }

    fn triangle(&self, face: usize) -> Triangle {
        let [a, b, c] = self.faces[face].map(|corner| self.vertices[corner as usize]);
        Triangle::new(a, b, c)
    }

    /// Unit normal of a face, of either sign.
    pub(super) fn normal(&self, face: usize) -> Vector {
        let Triangle { a, b, c } = self.triangle(face);
        (b - a).cross(c - a).normalize_or_zero()
    }

    /// A point on the surface, uniform by area.
    pub(crate) fn surface_point(&self, rng: &mut impl Rng) -> Vector {
        let total = self.areas.last().copied().unwrap_or_default();
        let at = rng.random::<f64>() * total;
        let face = self.areas.partition_point(|sum| *sum <= at);
        let Triangle { a, b, c } = self.triangle(face.min(self.faces.len() - 1));
        let (mut along, mut across) = (rng.random::<f64>(), rng.random::<f64>());
        if along + across > 1.0 {
            (along, across) = (1.0 - along, 1.0 - across);
        }
        a + along * (b - a) + across * (c - a)
    }

    /// The surface's point nearest to a point.
    pub(super) fn nearest(&self, point: Vector) -> Vector {
        let tree = self.tree.get_or_init(|| {
            let bounds: Vec<Aabb> = (0..self.faces.len())
                .map(|face| self.triangle(face).local_aabb())
                .collect();
            Bvh::from_leaves(BvhBuildStrategy::Binned, &bounds)
        });
        let nearest = tree.project_point(point, f64::MAX, |face, _| {
            Some(
                self.triangle(face as usize)
                    .project_local_point(point, false),
            )
        });
        nearest.map_or(Vector::splat(f64::INFINITY), |(_, (_, projection))| {
            projection.point
        })
    }
}

/// Larger meshes are in another unit: nothing on this table is wider than a laptop.
const MAX_SIZE_M: f64 = 1.0;

fn read(path: &Path) -> Result<Vec<u8>, TrainError> {
    fs::read(path).map_err(|source| TrainError::Read {
        path: path.to_path_buf(),
        source,
    })
}

/// A 64-bit hash in the manner of FNV-1a (Fowler, Noll and Vo), eight bytes at a time: it notices
/// changed files, not forged ones.
#[derive(Debug, Clone, Copy)]
pub(super) struct Fingerprint(pub(super) u64);

impl Default for Fingerprint {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Fingerprint {
    pub(super) fn add(&mut self, bytes: &[u8]) {
        let (words, rest) = bytes.as_chunks::<8>();
        let rest = rest.iter().map(|byte| u64::from(*byte));
        for word in words
            .iter()
            .map(|word| u64::from_le_bytes(*word))
            .chain(rest)
        {
            self.0 = (self.0 ^ word).wrapping_mul(0x0100_0000_01b3);
        }
        self.0 ^= self.0 >> 32;
    }
}
