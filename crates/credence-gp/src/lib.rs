//! Credence: gp.
