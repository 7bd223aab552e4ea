//! The vocabulary that Credence's stages share.
//!
//! A [`Frame`] is one RGB-D view: colour, depth, [`Intrinsics`] and the camera's [`Pose`] in the
//! world. A segmenter finds [`Instance`]s in it. The map accumulates their points as
//! [`PointCloud`]s and its occupancy as an [`OccupancyTree`]. A completer adds the parts that nobody
//! saw as [`Completion`]s. A classifier gives every test point
//! a [`Prediction`], which is judged against a [`TriMesh`].
//!
//! What was seen of one object is an [`Observation`], in its [`ObjectFrame`]. Random draws come from a [`stream`] per seed and purpose.
//!
//! Units are metres and radians. The world's z axis points up; camera axes follow `OpenCV` (x
//! right, y down, z forward). The centre of the first pixel is (0, 0).

mod category;
mod cloud;
mod completion;
mod error;
mod frame;
mod instance;
mod intrinsics;
mod mesh;
mod object_frame;
mod observation;
mod occupancy;
mod pose;
mod prediction;
mod random;

pub use category::{CLASS_COUNT, Category, FREE_CLASS};
pub use cloud::PointCloud;
pub use completion::Completion;
pub use error::InvalidInput;
pub use frame::{Frame, FrameTruth};
pub use instance::Instance;
pub use intrinsics::Intrinsics;
pub use mesh::TriMesh;
pub use object_frame::{ObjectFrame, all_finite};
pub use observation::Observation;
pub use occupancy::{OccupancyNode, OccupancyTree};
pub use pose::Pose;
pub use prediction::{Prediction, Predictions};
pub use random::{Stream, stream, thinned};

/// A point in metres; which frame it is in stands in the name of the variable that holds it.
pub type Point = nalgebra::Point3<f64>;
