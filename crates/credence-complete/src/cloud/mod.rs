//! Completion of a segmented partial cloud.
//!
//! A network is asked, from points around what was seen, where the object's surface is nearest and
//! how sure that is (a displacement field in the manner of Neural Pull, Ma et al. 2021, conditioned
//! on the observation). Points that follow its answers land on the surface, seen and unseen.

mod completer;
mod field;
mod network;
mod observe;
mod surface;

pub use completer::{CloudCompleter, Surface};
pub use network::{Decoded, SurfaceNetwork};
