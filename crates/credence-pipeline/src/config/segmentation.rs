use serde::{Deserialize, Serialize};

use super::{PythonFunction, Weights, python::named_or_python, strict::refuse_empty};
use crate::PipelineError;

/// The segmenters by name.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub enum SegmenterChoice {
    /// "maskrcnn": the network that finds objects by colour alone.
    MaskRcnn,
    /// "`maskrcnn_rgbd`": the network that looks at depth too.
    #[default]
    MaskRcnnRgbd,
    /// "oracle": the true masks that the simulator or the dataset delivers.
    Oracle,
    /// "python:module.function": a callable that Python imports.
    Python(PythonFunction),
}

named_or_python!(
    SegmenterChoice,
    "segmenter",
    [
        MaskRcnn = "maskrcnn",
        MaskRcnnRgbd = "maskrcnn_rgbd",
        Oracle = "oracle"
    ]
);

/// Settings of instance segmentation, for the segmenters that are networks of ours.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct SegmentationConfig {
    /// Weights of the network: "embedded" or a file.
    pub weights: Weights,
    /// Detections of a lower score are dropped.
    pub least_score: f64,
    /// Whether scores are calibrated: probabilities that the detection is right. Otherwise they
    /// are as the network gives them.
    pub calibrated: bool,
    /// Whether small parts of a mask whose depth is apart from the rest of it are dropped.
    pub trim: bool,
}

impl Default for SegmentationConfig {
    fn default() -> Self {
        Self {
            weights: Weights::default(),
            least_score: 0.5,
            calibrated: true,
            trim: true,
        }
    }
}

impl SegmentationConfig {
    pub(super) fn check(&self) -> Result<(), PipelineError> {
        if !(0.0..=1.0).contains(&self.least_score) {
            return Err(PipelineError::Config(format!(
                "segmentation.least_score is {}; it must lie in [0, 1]",
                self.least_score
            )));
        }
        refuse_empty("segmentation.weights", &self.weights)
    }
}
