use std::{ops::Range, time::Instant};

use credence_complete::CompleteError;
use credence_map::ObjectId;
use credence_types::{Frame, Instance};

use super::Pipeline;
use crate::{
    ObjectCompletion, PipelineError,
    completion::{View, register},
};

impl Pipeline {
    /// What the completer makes of the instances, one by one; nothing without one or the other.
    pub(super) fn complete(
        &mut self,
        frame: &Frame,
        instances: &[Instance],
    ) -> Result<Vec<View>, PipelineError> {
        if instances.is_empty() {
            return Ok(Vec::new());
        }
        let Some(completer) = self.completers.get()? else {
            return Ok(Vec::new());
        };
        let start = Instant::now();
        let completed = completer.complete(frame, instances)?;
        if completed.len() != instances.len() {
            return Err(CompleteError::Count {
                found: completed.len(),
                expected: instances.len(),
            }
            .into());
        }
        let mut views: Vec<View> = completed
            .into_iter()
            .map(|completed| completed.map(|completion| (completion, None)))
            .collect();
        self.note("complete", None, start.elapsed());
        if self.config.completion.refine {
            let start = Instant::now();
            register(frame, instances, &mut views)?;
            self.note("refine", None, start.elapsed());
        }
        Ok(views)
    }

    /// The completed shape of an object: what all views gave, together. `None` if no view
    /// completed it: see [`uncompleted`](Self::uncompleted).
    ///
    /// # Errors
    /// An id that is not tracked, frames that are not [completed again](Self::complete_frame).
    pub fn completion(&mut self, id: ObjectId) -> Result<Option<ObjectCompletion>, PipelineError> {
        self.check_completed()?;
        let start = Instant::now();
        let config = &self.config.completion;
        let fused = self.completions.fused(id, &self.map, config)?;
        if fused.is_some() {
            self.note("fuse", None, start.elapsed());
        }
        Ok(fused)
    }

    /// What each view that completed an object gave of it, in their order.
    ///
    /// # Errors
    /// An id that is not tracked, frames that are not [completed again](Self::complete_frame).
    pub fn view_completions(&self, id: ObjectId) -> Result<&[ObjectCompletion], PipelineError> {
        self.check_completed()?;
        self.map.object(id)?;
        Ok(self.completions.of(id))
    }

    /// Why an object has no completion, by the last view of it; `None` if it has one.
    ///
    /// # Errors
    /// An id that is not tracked, frames that are not [completed again](Self::complete_frame).
    pub fn uncompleted(&self, id: ObjectId) -> Result<Option<String>, PipelineError> {
        self.check_completed()?;
        self.map.object(id)?;
        if self.completers.is_none() {
            let why = "no completer is chosen; set completer in the configuration";
            return Ok(Some(why.to_owned()));
        }
        Ok(self.completions.uncompleted(id).map(ToString::to_string))
    }

    /// The frames, by index from 0, that are to be [completed again](Self::complete_frame).
    pub const fn frames_to_complete(&self) -> Range<usize> {
        self.completed_frames..self.frames.len()
    }

    /// Completes the objects of the next of the [frames](Self::frames_to_complete) that a
    /// [reconfigured](Self::reconfigured) pipeline holds in its map, but not under its completer.
    /// With all of them done, the pipeline is as if it had added them under its configuration.
    ///
    /// # Arguments
    ///
    /// * `instances`: those that the frame was mapped with.
    ///
    /// # Errors
    /// A frame out of order, or one that was not mapped with this pose and as many instances; one
    /// that the completer refuses. Nothing is changed then.
    pub fn complete_frame(
        &mut self,
        index: usize,
        frame: &Frame,
        instances: &[Instance],
    ) -> Result<(), PipelineError> {
        let left = self.frames_to_complete();
        if left.start != index || left.is_empty() {
            let next = if left.is_empty() {
                format!("all {} frames are completed", self.frames.len())
            } else {
                format!("frame {} is the next", left.start)
            };
            return Err(PipelineError::CompletionOrder { index, next });
        }
        self.frames[index].check_is(index, frame, instances)?;
        for instance in instances {
            instance.check_fits(frame.intrinsics())?;
        }
        let views = self.complete(frame, instances)?;
        let points = self.config.completion.points;
        self.frames[index].note(&mut self.completions, views, frame, points);
        self.completed_frames += 1;
        Ok(())
    }

    pub(super) fn check_completed(&self) -> Result<(), PipelineError> {
        let left = self.frames_to_complete();
        if left.is_empty() {
            return Ok(());
        }
        Err(PipelineError::NotCompleted {
            completed: left.start,
            frames: left.end,
        })
    }
}
