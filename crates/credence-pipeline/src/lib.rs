//! Credence: pipeline.

pub use credence_gp as gp;
pub use credence_map as map;
pub use credence_types as types;
