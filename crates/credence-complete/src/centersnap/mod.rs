//! `CenterSnap` (Irshad et al. 2022): all objects of a frame at once, each as a point.
//!
//! One network looks at colour and depth and tells, every eight pixels, how likely an object's
//! centre is there, of which category, and that object's shape as 128 numbers and pose as 13. The
//! decoder of a point auto-encoder turns the shape's numbers into 2,048 points.
//!
//! It departs from the paper where two cores ask for it or little is lost: a backbone of 24 to 160
//! channels; a heat map per category, so that a peak has one; a pose told from the cell (see
//! [`Anchor`]) instead of in the camera frame; and an object told by the warm cells about its peak
//! together, which takes a twentieth off the distance from the truth.

mod associate;
mod autoencoder;
mod completer;
mod detect;
mod image;
mod network;
mod pose;

pub use autoencoder::{AutoEncoder, DECODED_POINTS, LATENT};
pub use detect::{CenterSnap, Detection, Told};
pub use image::{BLOCK, CELLS, STRIDE, anchors};
pub use network::{Cells, CenterSnapNetwork, ImageBatch, StatisticValues, Statistics};
pub use pose::{Anchor, ObjectPose, POSE, facing, has_front};
