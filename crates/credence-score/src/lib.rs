//! Credence: score.
