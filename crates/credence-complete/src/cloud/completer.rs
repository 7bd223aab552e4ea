use std::path::Path;

use burn::tensor::Device;
use credence_nn::{
    query::{Support, Widths},
    weights,
};
use credence_types::{
    Completion, Frame, Instance, ObjectFrame, Observation, Point, all_finite, thinned,
};
use rayon::prelude::*;

use super::{
    SurfaceNetwork,
    field::Field,
    observe::observe,
    surface::{SurfacePoints, find_surface},
};
use crate::{
    CompleteError, Completer, Uncompleted, completer::check_measured, even_order, within_tolerance,
};

/// The weights that come with the crate.
const WEIGHTS: &[u8] = include_bytes!("../../../../assets/weights/cloud.safetensors");

/// Support points of a kind that are looked at; more are thinned at random.
const MOST: usize = 1800;

/// Completes segmented partial clouds.
///
/// The score of a completion is the share of its points that it expects within 5 mm of the true
/// surface.
#[derive(Debug)]
pub struct CloudCompleter {
    network: SurfaceNetwork,
    table_height_m: f64,
    points: usize,
}

/// An object's completed surface in the world.
#[derive(Debug, Clone, PartialEq)]
pub struct Surface {
    /// In an even order, world metres.
    pub points_world: Vec<Point>,
    /// Expected distance of each point from the true surface, metres.
    pub spread_m: Vec<f64>,
}

impl CloudCompleter {
    /// The completer that comes with the crate.
    ///
    /// # Arguments
    ///
    /// * `table_height_m`: height of the surface that the objects stand on, world metres.
    /// * `points`: points of a completion.
    ///
    /// # Errors
    /// None, unless the crate was built with weights of another network.
    pub fn embedded(table_height_m: f64, points: usize) -> Result<Self, CompleteError> {
        let network = SurfaceNetwork::new(Widths::default(), &Device::flex());
        let network =
            weights::from_bytes(network, WEIGHTS.to_vec(), "the built-in cloud.safetensors")?;
        Ok(Self::new(network, table_height_m, points))
    }

    /// The completer whose weights are in a file; otherwise as [`embedded`](Self::embedded).
    ///
    /// # Errors
    /// A file that is missing, truncated, or holds another network's weights.
    pub fn from_file(
        path: &Path,
        table_height_m: f64,
        points: usize,
    ) -> Result<Self, CompleteError> {
        let network = SurfaceNetwork::new(Widths::default(), &Device::flex());
        let network = weights::load(network, path)?;
        Ok(Self::new(network, table_height_m, points))
    }

    /// A network at hand; otherwise as [`embedded`](Self::embedded).
    pub const fn new(network: SurfaceNetwork, table_height_m: f64, points: usize) -> Self {
        Self {
            network,
            table_height_m,
            points,
        }
    }

    /// Completes one object from what was seen of it, be it in one view or in several.
    ///
    /// # Errors
    /// No points of the object or no free ones, a coordinate that is not finite.
    pub fn complete_observation(&self, seen: &Observation) -> Result<Surface, CompleteError> {
        all_finite("object", &seen.object)?;
        all_finite("free", &seen.free)?;
        let object = thinned(&seen.object, MOST, "complete/cloud/object");
        let free = thinned(&seen.free, MOST, "complete/cloud/free");
        let frame = ObjectFrame::new(&object, seen.viewpoint, seen.table_height_m)?;
        let placed = |points: &[Point]| -> Vec<[f32; 3]> {
            let place = |point| frame.locate(point).map(|c| c as f32);
            points.iter().map(place).collect()
        };
        let object = placed(&object);
        let support = Support::new(object.clone(), placed(&free))?;
        let field = Field::new(&self.network, support)?;
        let SurfacePoints { points, spreads } =
            find_surface(|queries| field.ask(queries), &object)?;
        let points: Vec<Point> = points
            .iter()
            .map(|point| frame.world_point(point.map(f64::from)))
            .collect();
        let order = even_order(&points, self.points);
        Ok(Surface {
            points_world: order.iter().map(|index| points[*index]).collect(),
            spread_m: order
                .iter()
                .map(|index| f64::from(spreads[*index]) * ObjectFrame::UNIT_M)
                .collect(),
        })
    }

    fn complete_one(
        &self,
        frame: &Frame,
        instance: &Instance,
        seen: &Observation,
    ) -> Result<Result<Completion, Uncompleted>, CompleteError> {
        if let Err(few) = check_measured(seen.object.len()) {
            return Ok(Err(few));
        }
        if seen.free.is_empty() {
            let why = "the camera saw no free space around it".to_owned();
            return Ok(Err(Uncompleted::Declined(why)));
        }
        let Surface {
            points_world,
            spread_m,
        } = self.complete_observation(seen)?;
        if points_world.is_empty() {
            let why = "the network found no surface near its points".to_owned();
            return Ok(Err(Uncompleted::Declined(why)));
        }
        let camera_from_world = frame.world_from_camera().inverse();
        let points_camera = points_world
            .iter()
            .map(|point| camera_from_world.transform_point(point));
        let within = spread_m.iter().map(|spread_m| within_tolerance(*spread_m));
        Ok(Ok(Completion {
            category: instance.category(),
            score: within.sum::<f64>() / spread_m.len() as f64,
            points_camera: points_camera.collect(),
            spread_m,
        }))
    }
}

impl Completer for CloudCompleter {
    fn complete(
        &self,
        frame: &Frame,
        instances: &[Instance],
    ) -> Result<Vec<Result<Completion, Uncompleted>>, CompleteError> {
        let seen = observe(frame, instances, self.table_height_m)?;
        instances
            .par_iter()
            .zip(&seen)
            .map(|(instance, seen)| self.complete_one(frame, instance, seen))
            .collect()
    }
}
