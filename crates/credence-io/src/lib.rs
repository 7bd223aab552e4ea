//! Credence: io.
