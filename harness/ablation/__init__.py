"""Ablations: a grid of configurations on the same scenes, whose shared stages are computed once."""
