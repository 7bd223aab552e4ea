use credence_types::{Frame, Instance};

use crate::SegmentError;

/// Finds the objects in one frame.
pub trait Segmenter: Send + Sync {
    /// Instances in a fixed order; none where nothing is in view.
    ///
    /// # Errors
    /// A frame that lacks what the segmenter needs.
    fn segment(&self, frame: &Frame) -> Result<Vec<Instance>, SegmentError>;
}
