//! Losses.

pub mod a_softmax;
mod angular_margin;

pub use angular_margin::{AngularMargin, one_hot};
