use credence_embed::{
    EmbedError,
    query::{Sample, Support},
};
use credence_types::{ObjectFrame, Point};
use rand::{Rng, RngExt as _, seq::SliceRandom as _};

use crate::data::Scene;

/// A point counts as on the surface within this distance: the tolerance of the scores.
pub(super) const ON_SURFACE_M: f32 = 0.005;

/// Units of the object's frame per metre.
const UNITS_PER_M: f64 = 10.0;

/// Support points of a kind, the fewest and the most.
const SUPPORT: (f64, f64) = (200.0, 1800.0);

/// Range of the scale.
const SCALE: (f64, f64) = (0.9, 1.1);

/// Standard deviation of the frame's error, metres: of the midrange, and of the table's height.
const JITTER_M: [f64; 3] = [0.005, 0.005, 0.008];

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
) -> Result<Example, EmbedError> {
    let (object, spare_object) = split(&scene.object, rng);
    let (free, spare_free) = split(&scene.free, rng);
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
    let scale = rng.random_range(SCALE.0..SCALE.1);
    let mirror = if rng.random() { -1.0 } else { 1.0 };
    let shift = JITTER_M.map(|sigma_m| sigma_m * UNITS_PER_M * normal(rng));
    let world: Vec<Point> = object.iter().map(wide).collect();
    let frame = ObjectFrame::new(&world, wide(&scene.viewpoint), 0.0)?;
    let place = |point: &[f32; 3]| {
        let [x, y, z] = frame.locate(&wide(point));
        let at = [x, y * mirror, z];
        [0, 1, 2].map(|axis| (at[axis] * scale + shift[axis]) as f32)
    };
    let support = Support::new(
        object.iter().map(place).collect(),
        free.iter().map(place).collect(),
    )?;
    let points: Vec<[f32; 3]> = asked.iter().map(|(point, _)| place(point)).collect();
    let distances = asked.iter().map(|(_, distance)| distance * scale as f32);
    Example::new(scene, &support, &points, distances.collect())
}

/// An example for validation: the scene as it is, every query.
pub(super) fn validation_example(scene: &Scene) -> Result<Example, EmbedError> {
    let most = SUPPORT.1 as usize;
    let object: Vec<Point> = scene.object.iter().take(most).map(wide).collect();
    let frame = ObjectFrame::new(&object, wide(&scene.viewpoint), 0.0)?;
    let place = |point: &[f32; 3]| frame.locate(&wide(point)).map(|c| c as f32);
    let support = Support::new(
        scene.object.iter().take(most).map(place).collect(),
        scene.free.iter().take(most).map(place).collect(),
    )?;
    let points: Vec<[f32; 3]> = scene.queries.iter().map(place).collect();
    Example::new(scene, &support, &points, scene.distances_m.clone())
}

impl Example {
    fn new(
        scene: &Scene,
        support: &Support,
        queries: &[[f32; 3]],
        distances_m: Vec<f32>,
    ) -> Result<Self, EmbedError> {
        let on = |distance: &f32| f32::from(*distance <= ON_SURFACE_M);
        Ok(Self {
            sample: Sample::new(support, queries)?,
            labels: distances_m.iter().map(on).collect(),
            distances_m,
            category: usize::from(scene.category.class()) - 1,
        })
    }
}

/// A random part of the points for the support, as likely of one size as of twice that, and the
/// points that queries are drawn from: the rest, or all if there is none.
fn split(points: &[[f32; 3]], rng: &mut impl Rng) -> (Vec<[f32; 3]>, Vec<[f32; 3]>) {
    let most = (points.len() as f64).min(SUPPORT.1).max(SUPPORT.0);
    let count = rng.random_range(SUPPORT.0.ln()..=most.ln()).exp().round() as usize;
    let mut points = points.to_vec();
    let (chosen, rest) = points.partial_shuffle(rng, count);
    let (chosen, rest) = (chosen.to_vec(), rest.to_vec());
    let spare = if rest.is_empty() {
        chosen.clone()
    } else {
        rest
    };
    (chosen, spare)
}

fn wide(point: &[f32; 3]) -> Point {
    Point::from(point.map(f64::from))
}

/// A standard normal number, by Box and Muller.
fn normal(rng: &mut impl Rng) -> f64 {
    let radius = (-2.0 * (1.0 - rng.random::<f64>()).ln()).sqrt();
    radius * (std::f64::consts::TAU * rng.random::<f64>()).cos()
}
