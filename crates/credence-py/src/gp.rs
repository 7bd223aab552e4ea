//! Bindings of the gp.
