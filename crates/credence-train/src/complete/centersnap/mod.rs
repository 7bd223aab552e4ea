//! Training of `CenterSnap` on pictures that are drawn as they are needed.

mod calibrate;
mod command;
mod evaluate;
mod example;
mod losses;
mod task;
mod truth;

#[cfg(test)]
mod tests;

pub(super) use command::run;
