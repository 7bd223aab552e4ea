use credence_types::{Frame, Instance};

use crate::{PipelineError, SegmenterChoice};

/// Finds the objects in one frame.
pub trait Segmenter: Send + Sync {
    /// Instances in a fixed order; none where nothing is in view.
    ///
    /// # Errors
    /// A frame that lacks what the segmenter needs.
    fn segment(&self, frame: &Frame) -> Result<Vec<Instance>, PipelineError>;
}

impl SegmenterChoice {
    pub(crate) fn build(self) -> Box<dyn Segmenter> {
        match self {
            Self::Oracle => Box::new(Oracle),
        }
    }
}

/// The true masks, each with score 1: the ablation that takes segmentation out of the question.
#[derive(Debug, Clone, Copy)]
pub struct Oracle;

impl Segmenter for Oracle {
    fn segment(&self, frame: &Frame) -> Result<Vec<Instance>, PipelineError> {
        let truth = frame.truth().ok_or(PipelineError::NoTrueMasks)?;
        let mut instances = Vec::new();
        for (id, category) in &truth.categories {
            let mask: Vec<bool> = truth.instance_ids.iter().map(|i| i == id).collect();
            if mask.contains(&true) {
                instances.push(Instance::certain(instances.len(), mask, *category)?);
            }
        }
        Ok(instances)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use credence_types::{Category, FrameTruth, Intrinsics, Pose};

    use super::*;

    fn frame(truth: Option<FrameTruth>) -> Frame {
        let intrinsics = Intrinsics::new([3, 1], [1.0, 1.0], [1.0, 0.0]).unwrap();
        Frame::new(
            vec![[0; 3]; 3],
            vec![1.0; 3],
            intrinsics,
            Pose::identity(),
            truth,
        )
        .unwrap()
    }

    #[test]
    fn the_oracle_returns_the_true_masks_of_what_is_in_view() {
        let truth = FrameTruth {
            instance_ids: vec![2, 0, 2],
            categories: BTreeMap::from([(1, Category::Bowl), (2, Category::Mug)]),
        };
        let instances = Oracle.segment(&frame(Some(truth))).unwrap();
        assert_eq!(
            instances,
            [Instance::certain(0, vec![true, false, true], Category::Mug).unwrap()]
        );
    }

    #[test]
    fn the_oracle_needs_true_masks() {
        let message = Oracle.segment(&frame(None)).unwrap_err().to_string();
        assert!(message.contains("segmenter = \"oracle\" needs true masks"));
    }
}
