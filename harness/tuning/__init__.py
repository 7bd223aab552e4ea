"""Hyperparameters and recalibration, chosen by the likelihood of validation scenes."""
