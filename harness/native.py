"""The one door to Rust: everything that Python uses of the compiled extension.

Points are ``(n, 3) float64`` arrays in world metres, C-contiguous. Classes are indices: 0 is free
space, 1 to 6 the categories of `CLASS_NAMES`. A wrong shape or type raises an error that names the
argument; a file that cannot be read or written raises OSError; a value that makes no sense raises
ValueError.
"""

from __future__ import annotations

from harness._native import (
    Hyperparameters,
    MappedObject,
    MeshTruth,
    OccupancyMap,
    Pipeline,
    Predictions,
    TrainingSet,
    Voxels,
    binary_metrics,
    check_pipeline_config,
    gp_log_likelihood,
    gp_posterior,
    nearest_observation,
)

CLASS_NAMES = ("free", "bottle", "bowl", "camera", "can", "laptop", "mug")

__all__ = [
    "CLASS_NAMES",
    "Hyperparameters",
    "MappedObject",
    "MeshTruth",
    "OccupancyMap",
    "Pipeline",
    "Predictions",
    "TrainingSet",
    "Voxels",
    "binary_metrics",
    "check_pipeline_config",
    "gp_log_likelihood",
    "gp_posterior",
    "nearest_observation",
]
