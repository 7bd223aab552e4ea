//! The loop that every training shares: schedule, log, checkpoints, resumption.
//!
//! What happens at a step depends on the step's number and the parameters alone, so a run that was
//! killed and started again ends with the same weights as one that was not.

mod checkpoint;
mod log;
mod progress;
mod schedule;
mod train;

#[cfg(test)]
mod tests;

pub use progress::note;
pub use schedule::Schedule;
pub use train::{Figures, Outcome, Plan, Task, train};
