//! Shape completion: from what a frame shows of an object to its whole surface.
//!
//! A [`Completer`] gives every segmented instance of a frame a completion, points on the
//! surface, seen and unseen, with a spread each, or says why it has none.

pub mod centersnap;
pub mod cloud;
mod completer;
mod error;
mod even;
mod fuse;
mod observed;
mod refine;
mod search;
mod spread;

pub use completer::{Completer, Uncompleted};
pub use error::CompleteError;
pub use even::even_order;
pub use fuse::{SeenSpace, SpreadCloud, fuse};
pub use observed::observed_points;
pub use refine::{Refined, refine};
pub use spread::within_tolerance;
