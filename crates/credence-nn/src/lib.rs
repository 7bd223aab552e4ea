//! What Credence's networks share: layers, losses, nearest neighbours and weight files.
//!
//! Nothing here knows what the networks are for. Tensors are burn's; the device is a run-time
//! value, and a device with `autodiff()` makes the same code trainable.

pub mod conv;
pub mod edge_conv;
mod error;
mod host;
pub mod knn;
mod leaky_relu;
pub mod loss;
mod mlp;
pub mod nms;
mod parameters;
mod provenance;
pub mod query;
pub mod rgbd;
mod roi_align;
mod row_norm;
mod strongest;
pub mod weights;

pub use error::NnError;
pub use host::read;
pub use leaky_relu::leaky_relu;
pub use mlp::{Mlp, ResidualMlp};
pub use parameters::seed_parameters;
pub use provenance::Provenance;
pub use roi_align::{Roi, roi_align};
pub use row_norm::RowNorm;
pub use strongest::strongest_rows;
