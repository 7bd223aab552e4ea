"""Figures, each a module that draws one from a file of results."""
