use credence_map::{Aabb, FreeSampling, KeepAway, ObjectId, SemanticMap};
use credence_types::{FREE_CLASS, Point};
use nalgebra::Vector3;
use rand::{SeedableRng as _, seq::index};
use rand_chacha::ChaCha20Rng;

use crate::{PipelineError, TrainingConfig};

/// Stream of the draw of observed points; free space has the map's own.
const OBSERVED_STREAM: u64 = 1;

/// What a classifier learns about one object: observed points of its surroundings, labelled with
/// their category, and points known to be free.
#[derive(Debug, Clone, PartialEq)]
pub struct TrainingSet {
    /// World coordinates, metres; observed points first, then free ones, each in random order.
    pub points_world: Vec<Point>,
    /// Class of each point: 0 is free space, 1 to 6 the categories.
    pub classes: Vec<u8>,
}

impl TrainingSet {
    /// Draws the training points of an object: see [`TrainingConfig`].
    ///
    /// Observed points come from the object and from whatever else was seen in its padded box, all
    /// alike, so that a neighbour is neither free space nor ignored.
    pub(crate) fn draw(
        map: &SemanticMap,
        id: ObjectId,
        config: &TrainingConfig,
        seed: u64,
    ) -> Result<Self, PipelineError> {
        let surroundings = padded_box(&map.object(id)?.cloud().points_world, config)?;
        let observed: Vec<(Point, u8)> = map
            .objects()
            .flat_map(|object| {
                let class = object.category().class();
                let points = &object.cloud().points_world;
                points.iter().map(move |point| (*point, class))
            })
            .filter(|(point, _)| surroundings.contains(point))
            .collect();
        let wanted = ((config.points as f64 * config.object_share).round() as usize)
            .clamp(1, config.points - 1);
        let mut rng = ChaCha20Rng::seed_from_u64(seed);
        rng.set_stream(OBSERVED_STREAM);
        let chosen = index::sample(&mut rng, observed.len(), wanted.min(observed.len()));
        let (mut points_world, mut classes): (Vec<Point>, Vec<u8>) =
            chosen.iter().map(|index| observed[index]).unzip();

        let sampling = FreeSampling {
            within: surroundings,
            count: config.points - points_world.len(),
            min_distance_m: config.free_margin_m,
            seed,
        };
        points_world.extend(map.sample_free(&sampling, KeepAway::Objects)?);
        classes.resize(points_world.len(), FREE_CLASS);
        Ok(Self {
            points_world,
            classes,
        })
    }
}

fn padded_box(points: &[Point], config: &TrainingConfig) -> Result<Aabb, PipelineError> {
    let padding = Vector3::repeat(config.box_padding_m);
    let (low, high) = points.iter().fold(
        (
            Point::from(Vector3::repeat(f64::INFINITY)),
            Point::from(Vector3::repeat(f64::NEG_INFINITY)),
        ),
        |(low, high), point| (low.inf(point), high.sup(point)),
    );
    Ok(Aabb::new(low - padding, high + padding)?)
}
