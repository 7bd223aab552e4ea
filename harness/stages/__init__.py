"""Stages of a scene's evaluation, each computed once for all configurations that agree on it."""
