use credence_types::{Category, stream};
use parry3d_f64::math::Vector;
use rand::{Rng, RngExt as _};

use super::{
    mesh_set::MeshSet,
    observe::{Observed, observe},
    queries::{Query, ask, ask_around, normals},
    stage::{any_category, look, place},
};
use crate::TrainError;

/// Fewest observed and free points of a scene; one with fewer is drawn anew.
const MIN_POINTS: usize = 200;
/// Draws after which a scene is given up.
const MAX_DRAWS: u32 = 200;
/// Probability and standard deviation of a common vertical error of all observations: a table
/// height that is off.
const SHIFTED: f64 = 0.15;
const SHIFT_M: f64 = 0.003;

/// What one to five depth views show of an object on a table, and points to ask about.
///
/// World metres, z up, the true table at z = 0, the object's box centred at the origin. Every list
/// is in random order, so that its beginning is a random sample of it.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Of the object.
    pub category: Category,
    /// Measured points of the object, at most 2,048, of all views together.
    pub object: Vec<[f32; 3]>,
    /// Measured points of other objects in the object's observed box padded by 3 cm, at most 1,024.
    pub neighbours: Vec<([f32; 3], Category)>,
    /// Points of that box known to be free and at least 1 cm from every measured one, at most 2,048.
    pub free: Vec<[f32; 3]>,
    /// Mean position of the cameras.
    pub viewpoint: [f32; 3],
    /// 1,024 points: half near the object's surface, half anywhere in its true box padded by 1 cm.
    pub queries: Vec<[f32; 3]>,
    /// Distance of each query from the object's true surface.
    pub distances_m: Vec<f32>,
    /// 512 more points to ask about, anywhere in the true box padded by 6 cm.
    pub surroundings: Vec<[f32; 3]>,
    /// The true surface's points nearest to the queries, then to the surroundings.
    pub nearest: Vec<[f32; 3]>,
}

impl Scene {
    /// Scene `index` of a seed: a function of its arguments alone. A draw whose object hides, or
    /// shows fewer than 200 points or as few free ones, is replaced by the next draw of the index.
    ///
    /// # Errors
    /// No draw serves: the meshes are too large, too small or too thin to be seen.
    pub fn generate(meshes: &MeshSet, seed: u64, index: u64) -> Result<Self, TrainError> {
        // Drawn once, or else large objects, which are often cut, would come up less.
        let category = any_category(&mut stream(seed, &format!("category {index}")));
        (0..MAX_DRAWS)
            .find_map(|draw| {
                let mut rng = stream(seed, &format!("scene {index}/{draw}"));
                Self::draw(meshes, category, &mut rng)
            })
            .ok_or(TrainError::Scene {
                index,
                draws: MAX_DRAWS,
            })
    }

    fn draw(meshes: &MeshSet, category: Category, rng: &mut impl Rng) -> Option<Self> {
        let placed = place(meshes, category, rng);
        let views = look(&placed, rng)?;
        let Observed {
            object,
            neighbours,
            free,
        } = observe(&placed, &views, rng);
        if object.len().min(free.len()) < MIN_POINTS {
            return None;
        }
        let shift = if rng.random::<f64>() < SHIFTED {
            SHIFT_M * normals(rng).z
        } else {
            0.0
        };
        let shifted = |point: &Vector| narrow(*point + Vector::new(0.0, 0.0, shift));
        let eyes: Vector = views.iter().map(|view| view.camera.eye).sum();
        let queries = ask(&placed[0], rng);
        let around = ask_around(&placed[0], rng);
        let points = |queries: &[Query]| queries.iter().map(|q| narrow(q.point)).collect();
        Some(Self {
            category,
            object: object.iter().map(shifted).collect(),
            neighbours: neighbours.iter().map(|(p, c)| (shifted(p), *c)).collect(),
            free: free.iter().map(shifted).collect(),
            viewpoint: narrow(eyes / views.len() as f64),
            queries: points(&queries),
            distances_m: queries.iter().map(|q| q.distance_m() as f32).collect(),
            surroundings: points(&around),
            nearest: queries
                .iter()
                .chain(&around)
                .map(|q| narrow(q.nearest))
                .collect(),
        })
    }
}

fn narrow(point: Vector) -> [f32; 3] {
    point.to_array().map(|c| c as f32)
}
