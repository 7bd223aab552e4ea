"""The regression gate: a run against a committed baseline, scene by scene, in quality and speed."""
