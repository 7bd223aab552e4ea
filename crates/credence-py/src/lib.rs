//! Python bindings: the extension module `harness._native`.
//!
//! Conversion and error mapping only; every computation lives in the crates below.

mod arrays;
mod errors;
mod gp;
mod map;
mod pipeline;
mod score;

use pyo3::prelude::*;

#[pymodule]
mod _native {}
