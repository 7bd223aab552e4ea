"""The one signal that a draw of a scene does not serve."""

from __future__ import annotations


class Rejected(Exception):
    """A draw that must be redrawn; the message says why and is counted in the scene."""
