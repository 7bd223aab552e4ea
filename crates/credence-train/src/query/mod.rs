//! Training of the query embedding.

mod augment;
mod command;
mod evaluate;
mod losses;
mod task;

#[cfg(test)]
mod tests;

pub use command::QueryArgs;
pub use evaluate::evaluate;
pub use task::QueryTask;
