//! Bindings of the pipeline.
