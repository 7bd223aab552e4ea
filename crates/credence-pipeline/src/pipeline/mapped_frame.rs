use credence_map::{InsertReport, ObjectId};
use credence_types::{Frame, Instance, Pose};

use crate::{
    PipelineError,
    completion::{Completions, View},
};

/// What a frame did to the map, by which its completions find their objects: small, as the frame
/// itself and its masks are not kept.
#[derive(Debug, Clone)]
pub(super) struct MappedFrame {
    world_from_camera: Pose,
    /// The object of each instance.
    objects: Vec<Option<ObjectId>>,
    deleted: Vec<ObjectId>,
}

impl MappedFrame {
    pub(super) fn new(frame: &Frame, report: &InsertReport) -> Self {
        Self {
            world_from_camera: *frame.world_from_camera(),
            objects: report.objects.clone(),
            deleted: report.deleted.clone(),
        }
    }

    /// Keeps what the completer made of the frame's instances, at most `points` points each.
    pub(super) fn note(
        &self,
        completions: &mut Completions,
        views: Vec<View>,
        frame: &Frame,
        points: usize,
    ) {
        for id in &self.deleted {
            completions.forget(*id);
        }
        for (id, view) in self.objects.iter().zip(views) {
            if let Some(id) = id {
                completions.note(*id, view, frame, points);
            }
        }
    }

    /// Checks that a frame and its instances may be those that were mapped.
    pub(super) fn check_is(
        &self,
        index: usize,
        frame: &Frame,
        instances: &[Instance],
    ) -> Result<(), PipelineError> {
        let other = |mapped: String| Err(PipelineError::OtherFrame { index, mapped });
        if *frame.world_from_camera() != self.world_from_camera {
            return other("another pose of the camera".to_owned());
        }
        let (expected, found) = (self.objects.len(), instances.len());
        if found != expected {
            return other(format!(
                "another number of detections ({expected}, not {found})"
            ));
        }
        Ok(())
    }
}
