use credence_embed::query::{Sample, Support};
use credence_nn::NnError;
use rand::{Rng, RngExt as _, seq::SliceRandom as _};

use crate::{
    TrainError,
    augment::{Placement, SUPPORT, split},
    data::Scene,
};

/// A point counts as on the surface within this distance: the tolerance of the scores.
pub(super) const ON_SURFACE_M: f32 = 0.005;

/// Observed and free points among an example's queries: the Gaussian process asks for them too.
const SUPPORT_QUERIES: usize = 16;

/// One observation's queries and what should be said of them.
#[derive(Debug, Clone)]
pub struct Example {
    /// What the network sees.
    pub sample: Sample,
    /// Of each query, 1 on the surface and 0 off it.
    pub labels: Vec<f32>,
    /// Of each query, its distance from the surface in metres.
    pub distances_m: Vec<f32>,
    /// Position of the category among all.
    pub category: usize,
}

/// An example for training: random support, random queries, and a frame that is a little wrong.
pub(super) fn training_example(
    scene: &Scene,
    queries: usize,
    rng: &mut impl Rng,
) -> Result<Example, TrainError> {
    let (object, spare_object) = with_spare(&scene.object, rng);
    let (free, spare_free) = with_spare(&scene.free, rng);
    let mut order: Vec<usize> = (0..scene.queries.len()).collect();
    let own = queries.saturating_sub(2 * SUPPORT_QUERIES).min(order.len());
    let (chosen, _) = order.partial_shuffle(rng, own);
    let mut asked: Vec<([f32; 3], f32)> = Vec::with_capacity(queries);
    asked.extend(
        chosen
            .iter()
            .map(|i| (scene.queries[*i], scene.distances_m[*i])),
    );
    for (points, distance) in [(spare_object, 0.0), (spare_free, f32::INFINITY)] {
        for _ in 0..SUPPORT_QUERIES {
            asked.push((points[rng.random_range(0..points.len())], distance));
        }
    }
    let placement = Placement::varied(&object, scene, rng)?;
    let place = |point: &[f32; 3]| placement.place(point);
    let support = Support::new(
        object.iter().map(place).collect(),
        free.iter().map(place).collect(),
    )?;
    let points: Vec<[f32; 3]> = asked.iter().map(|(point, _)| place(point)).collect();
    let distances = asked
        .iter()
        .map(|(_, distance)| distance * placement.scale as f32);
    Ok(Example::new(scene, &support, &points, distances.collect())?)
}

/// An example for validation: the scene as it is, every query.
pub(super) fn validation_example(scene: &Scene) -> Result<Example, TrainError> {
    let most = SUPPORT.1 as usize;
    let placement = Placement::exact(&scene.object[..most.min(scene.object.len())], scene)?;
    let place = |point: &[f32; 3]| placement.place(point);
    let support = Support::new(
        scene.object.iter().take(most).map(place).collect(),
        scene.free.iter().take(most).map(place).collect(),
    )?;
    let points: Vec<[f32; 3]> = scene.queries.iter().map(place).collect();
    Ok(Example::new(
        scene,
        &support,
        &points,
        scene.distances_m.clone(),
    )?)
}

impl Example {
    fn new(
        scene: &Scene,
        support: &Support,
        queries: &[[f32; 3]],
        distances_m: Vec<f32>,
    ) -> Result<Self, NnError> {
        let on = |distance: &f32| f32::from(*distance <= ON_SURFACE_M);
        Ok(Self {
            sample: Sample::new(support, queries)?,
            labels: distances_m.iter().map(on).collect(),
            distances_m,
            category: usize::from(scene.category.class()) - 1,
        })
    }
}

/// Points for the support, and points that queries are drawn from: the rest, or all if there is
/// none.
fn with_spare(points: &[[f32; 3]], rng: &mut impl Rng) -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
    let (chosen, rest) = split(points, rng);
    let spare = if rest.is_empty() {
        chosen.clone()
    } else {
        rest
    };
    (chosen, spare)
}
