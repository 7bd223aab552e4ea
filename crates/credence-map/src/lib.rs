//! Credence: map.
