//! What Credence's networks share: layers, losses, nearest neighbours and weight files.
//!
//! Nothing here knows what the networks are for. Tensors are burn's; the device is a run-time
//! value, and a device with `autodiff()` makes the same code trainable.

pub mod edge_conv;
mod error;
pub mod knn;
pub mod loss;
mod mlp;
mod parameters;
mod provenance;
pub mod weights;

pub use error::NnError;
pub use mlp::{Mlp, ResidualMlp};
pub use parameters::seed_parameters;
pub use provenance::Provenance;
