"""Figures for print, from recorded data alone: `draw` has those of runs and ablations."""
