//! Training of Mask R-CNN on pictures that `harness training-pictures` renders.

mod augment;
mod calibrate;
mod command;
mod evaluate;
mod losses;
mod pictures;
mod targets;
mod task;
#[cfg(test)]
mod tests;
mod truth;

pub use command::SegmentArgs;
