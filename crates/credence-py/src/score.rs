//! Bindings of the score.
