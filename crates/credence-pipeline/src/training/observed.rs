use std::collections::BTreeMap;

use credence_map::{ObjectId, SemanticMap, TrackedObject};
use credence_types::{Category, Point, stream};
use nalgebra::Vector3;
use rand::seq::index;

use super::{padded_box, sample_free, wanted};
use crate::{PipelineError, TrainingConfig};

/// What was seen of one object: what a network embeds points by.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Observed {
    pub(crate) category: Category,
    /// Points on it, world coordinates, metres.
    pub(crate) points_world: Vec<Point>,
    /// Free points around it.
    pub(crate) free_world: Vec<Point>,
    /// Mean camera centre of the views of it.
    pub(crate) viewpoint_world: Point,
}

impl Observed {
    /// Every `parts`-th point from the `part`-th on: as the points are in random order, a random
    /// part of the observation.
    pub(crate) fn part(&self, part: usize, parts: usize) -> Self {
        let of = |points: &[Point]| points.iter().skip(part).step_by(parts).copied().collect();
        Self {
            points_world: of(&self.points_world),
            free_world: of(&self.free_world),
            ..*self
        }
    }

    /// A neighbour as its own training set would have it: a network that is to say where the
    /// neighbour is must see it as it was trained to see objects, not the part that reaches into
    /// another object's box. Where nothing around it was seen free, the free points around the
    /// object asked about are all there is.
    pub(super) fn whole(
        map: &SemanticMap,
        object: &TrackedObject,
        viewpoints: &Viewpoints,
        config: &TrainingConfig,
        seed: u64,
        free_beside: &[Point],
    ) -> Result<Self, PipelineError> {
        let cloud = &object.cloud().points_world;
        let from_cloud = wanted(config).min(cloud.len());
        let mut rng = stream(seed, &format!("pipeline/neighbour/{}", object.id()));
        let points_world: Vec<Point> = index::sample(&mut rng, cloud.len(), from_cloud)
            .iter()
            .map(|index| cloud[index])
            .collect();
        let within = padded_box(cloud, config)?;
        let count = config.points - from_cloud;
        let free_world = match sample_free(map, object.id(), within, count, config, seed) {
            Err(PipelineError::NoFreeSpace { .. }) => free_beside.to_vec(),
            sampled => sampled?,
        };
        Ok(Self {
            category: object.category(),
            free_world,
            points_world,
            viewpoint_world: viewpoints.of(object.id())?,
        })
    }
}

/// Where the objects were seen from.
#[derive(Debug, Clone, Default)]
pub(crate) struct Viewpoints(BTreeMap<ObjectId, Sum>);

/// Camera centres, added up.
#[derive(Debug, Clone, Copy, Default)]
struct Sum {
    centres_world: Vector3<f64>,
    views: u32,
}

impl Viewpoints {
    /// Notes that a camera saw an object.
    pub(crate) fn note(&mut self, id: ObjectId, camera_world: &Point) {
        let sum = self.0.entry(id).or_default();
        sum.centres_world += camera_world.coords;
        sum.views += 1;
    }

    /// Forgets an object that left the map.
    pub(crate) fn forget(&mut self, id: ObjectId) {
        self.0.remove(&id);
    }

    /// Mean camera centre of the views of an object, world coordinates, metres.
    pub(crate) fn of(&self, id: ObjectId) -> Result<Point, PipelineError> {
        let sum = self.0.get(&id).ok_or(PipelineError::NoViewpoint)?;
        Ok((sum.centres_world / f64::from(sum.views)).into())
    }
}
