"""What can go wrong with a mesh or a folder of meshes."""

from __future__ import annotations


class ObjectError(ValueError):
    """A mesh or manifest that cannot be used; the message names the file and the remedy."""
