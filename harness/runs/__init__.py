"""Runs: the scenes to compute, the processes that compute them, the folder that keeps them."""
