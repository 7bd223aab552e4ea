//! Python bindings: the extension module `harness._native`.
//!
//! Conversion and error mapping only; every computation lives in the crates below.
#![expect(
    clippy::needless_pass_by_value,
    reason = "pyo3 extracts arguments by value"
)]

mod arrays;
mod completer;
mod completion;
mod errors;
mod frame;
mod function;
mod gp;
mod map;
mod pipeline;
mod predictions;
mod score;
mod segmentation;
mod segmenter;
mod stages;
mod training;

use pyo3::prelude::*;

#[pymodule]
mod _native {
    #[pymodule_export]
    use super::{
        completion::PyCompletion,
        gp::{gp_log_likelihood, gp_posterior},
        map::{PyMappedObject, PyOccupancyMap, PyVoxels},
        pipeline::{PyPipeline, check_pipeline_config},
        predictions::{PyHyperparameters, PyPredictions},
        score::{PyMeshTruth, binary_metrics, nearest_observation},
        segmentation::{PyDetection, PySegmenter},
        training::PyTrainingSet,
    };
}
