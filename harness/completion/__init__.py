"""How good completed shapes are: measured against the true meshes, beside simple baselines."""
