//! Bindings of the map.
