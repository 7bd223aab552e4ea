"""Objects on the table: a generator of parametric meshes, and sets of meshes to draw from.

`load_object_set` reads the committed benchmark set or any folder with a manifest;
`sim_scenes.objects.generate` makes a mesh of one of six categories from a split, an index and a
seed (it needs manifold3d, so it is not imported here).
"""

from __future__ import annotations

from sim_scenes.objects.errors import ObjectError
from sim_scenes.objects.manifest import CATEGORIES
from sim_scenes.objects.object_set import ObjectModel, ObjectSet, load_object_set

__all__ = ["CATEGORIES", "ObjectError", "ObjectModel", "ObjectSet", "load_object_set"]
