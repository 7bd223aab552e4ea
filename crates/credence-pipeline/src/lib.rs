//! The stages wired together: frames in, a semantic map and classified points out.
//!
//! A [`Pipeline`] is made from a [`Config`], whose enums name the stages ([`SegmenterChoice`],
//! [`CompleterChoice`], [`ModelChoice`]). [`Pipeline::add_frame`] segments a view, completes the
//! objects in it and maps it; for each tracked object, [`Pipeline::completion`] is its whole shape,
//! [`Pipeline::training_set`] draws what a classifier learns from, and [`Pipeline::classify`] asks
//! it about test points; [`Pipeline::annotate`] writes its confidences into the map. All models
//! answer the same question from the same training and test points. This is the one crate that
//! knows all stages, and it never sees the truth they are judged by.
//!
//! Each stage need be computed once only: [`Pipeline::add_segmented`] takes kept instances, and
//! [`Pipeline::reconfigured`] carries a map over to another configuration of what follows it.

mod classify;
mod completers;
mod completion;
mod config;
mod embedders;
mod error;
mod models;
mod pipeline;
#[cfg(test)]
mod scene;
mod segmenter;
mod training;

pub use classify::Classification;
pub use completion::{ObjectCompletion, Registration};
pub use config::{
    AssociationChoice, CompleterChoice, CompletionConfig, Config, GpConfig, KernelInput, MapConfig,
    MetricConfig, ModelChoice, Platt, PythonFunction, RecalibrationConfig, SegmentationConfig,
    SegmenterChoice, SmoothnessChoice, TrainingConfig, TunedConfig, Weights,
};
pub use credence_complete as complete;
pub use credence_embed as embed;
pub use credence_gp as gp;
pub use credence_map as map;
pub use credence_segment as segment;
pub use error::PipelineError;
pub use models::NetworkView;
pub use pipeline::{Foreign, Pipeline, StageTime};
pub use segmenter::{ChosenSegmenter, Oracle, outer_box};
pub use training::TrainingSet;
