//! What completers make of the objects in view, kept by object in the world.

#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use credence_complete::{
    CompleteError, SeenSpace, SpreadCloud, Uncompleted, fuse, observed_points, refine,
    within_tolerance,
};
use credence_map::{ObjectId, Occupancy, SemanticMap};
use credence_types::{Category, Completion, Frame, Instance, Point};
use nalgebra::Vector3;

use crate::{CompletionConfig, PipelineError};

/// An object's completed shape in the world.
#[derive(Debug, Clone, PartialEq)]
pub struct ObjectCompletion {
    /// What the completer takes the object for.
    pub category: Category,
    /// How sure it is of the object, in \[0, 1\]: what it said at first, of several views the mean.
    /// Neither registration nor fusion changes it; how sure each point is then,
    /// [`confidence`](Self::confidence) tells.
    pub score: f64,
    /// Points on the surface, world coordinates, metres; every prefix is spread evenly.
    pub points_world: Vec<Point>,
    /// Expected distance of each from the true surface, metres.
    pub spread_m: Vec<f64>,
    /// How its registration to the observed points went; `None` without one, and for what several
    /// views gave together.
    pub registration: Option<Registration>,
}

impl ObjectCompletion {
    /// Probability that each point lies within 5 mm of the true surface, for errors of Laplace's
    /// distribution: 1 - exp(-0.005 / spread).
    pub fn confidence(&self) -> Vec<f64> {
        let within = |spread_m: &f64| within_tolerance(*spread_m);
        self.spread_m.iter().map(within).collect()
    }
}

/// How a registration changed the mean distance of the observed points from the completed surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Registration {
    /// Before, metres.
    pub residual_before_m: f64,
    /// After: never more, metres.
    pub residual_after_m: f64,
}

/// What a completer said of one instance, in the camera frame.
pub(crate) type View = Result<(Completion, Option<Registration>), Uncompleted>;

/// Registers the completions of a frame's instances to what the frame measured of each.
pub(crate) fn register(
    frame: &Frame,
    instances: &[Instance],
    views: &mut [View],
) -> Result<(), CompleteError> {
    let up_camera = frame
        .world_from_camera()
        .inverse()
        .transform_vector(&Vector3::z());
    for (instance, view) in instances.iter().zip(views) {
        if let Ok((completion, registration)) = view {
            let observed = observed_points(frame, instance)?;
            let refined = refine(completion, &observed, &up_camera)?;
            *completion = refined.completion;
            *registration = Some(Registration {
                residual_before_m: refined.residual_before_m,
                residual_after_m: refined.residual_after_m,
            });
        }
    }
    Ok(())
}

/// The completions of all objects, view by view.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Completions(BTreeMap<ObjectId, Kept>);

/// What the views gave of one object.
#[derive(Debug, Clone, Default, PartialEq)]
struct Kept {
    completions: Vec<ObjectCompletion>,
    /// The last view's reason for having none.
    uncompleted: Option<Uncompleted>,
}

impl Completions {
    /// Keeps what a view gave of an object: at most `points` of its points.
    pub(crate) fn note(&mut self, id: ObjectId, view: View, frame: &Frame, points: usize) {
        let kept = self.0.entry(id).or_default();
        match view {
            Err(why) => kept.uncompleted = Some(why),
            Ok((completion, registration)) => {
                let pose = frame.world_from_camera();
                let camera = completion.points_camera.iter().take(points);
                kept.completions.push(ObjectCompletion {
                    category: completion.category,
                    score: completion.score,
                    points_world: camera.map(|point| pose.transform_point(point)).collect(),
                    spread_m: completion.spread_m.into_iter().take(points).collect(),
                    registration,
                });
            }
        }
    }

    /// Forgets an object that left the map.
    pub(crate) fn forget(&mut self, id: ObjectId) {
        self.0.remove(&id);
    }

    /// What each view gave of an object, in their order.
    pub(crate) fn of(&self, id: ObjectId) -> &[ObjectCompletion] {
        self.0.get(&id).map_or(&[], |kept| &kept.completions)
    }

    /// Why an object has no completion; `None` if it has one, or no view was asked for one.
    pub(crate) fn uncompleted(&self, id: ObjectId) -> Option<&Uncompleted> {
        let kept = self.0.get(&id)?;
        let why = kept.uncompleted.as_ref();
        why.filter(|_| kept.completions.is_empty())
    }

    /// What all views gave of an object, together.
    pub(crate) fn fused(
        &self,
        id: ObjectId,
        map: &SemanticMap,
        config: &CompletionConfig,
    ) -> Result<Option<ObjectCompletion>, PipelineError> {
        let object = map.object(id)?;
        let views = self.of(id);
        let clouds: Vec<SpreadCloud> = views
            .iter()
            .map(|view| SpreadCloud {
                points_world: view.points_world.clone(),
                spread_m: view.spread_m.clone(),
            })
            .collect();
        if clouds.is_empty() {
            return Ok(None);
        }
        let seen = SeenSpace {
            is_free: &|point| is_free_around(map, point),
            observed_world: &object.cloud().points_world,
            near_m: map.config().resolution_m,
        };
        let fused = fuse(&clouds, &seen, config.points)?;
        let scores = views.iter().map(|view| view.score);
        Ok(Some(ObjectCompletion {
            category: object.category(),
            score: scores.sum::<f64>() / views.len() as f64,
            points_world: fused.points_world,
            spread_m: fused.spread_m,
            registration: None,
        }))
    }
}

/// Whether views looked through a place and everything within a voxel of it.
fn is_free_around(map: &SemanticMap, point: &Point) -> bool {
    let edge_m = map.config().resolution_m;
    let steps = [0.0, -edge_m, edge_m];
    steps.iter().all(|x| {
        steps.iter().all(|y| {
            steps.iter().all(|z| {
                let near = point + Vector3::new(*x, *y, *z);
                map.occupancy().occupancy(&near) == Occupancy::Free
            })
        })
    })
}
