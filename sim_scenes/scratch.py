"""Files that PyBullet insists on: it takes meshes and textures from disk only.

Vertex arrays would do for meshes, but PyBullet leaks them: 5 MB a scene.
"""

from __future__ import annotations

import functools
import hashlib
import itertools
import os
import shutil
import tempfile
from multiprocessing.util import Finalize
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

if TYPE_CHECKING:
    from sim_scenes.geometry import Floats, Ints
    from sim_scenes.textures import Picture

_texture_numbers = itertools.count()


@functools.cache
def _folder_of(process: int) -> Path:
    folder = Path(tempfile.mkdtemp(prefix=f"sim_scenes-{process}-"))
    # Unlike atexit this also runs when a pool's worker ends, and not in a forked child.
    Finalize(None, shutil.rmtree, args=(folder,), kwargs={"ignore_errors": True}, exitpriority=0)
    return folder


def scratch_folder() -> Path:
    """Return the folder of this process for such files; it goes when the process ends."""
    return _folder_of(os.getpid())


def mesh_file(
    vertices: Floats, faces: Ints, *, normals: Floats | None = None, uv: Floats | None = None
) -> Path:
    """Write an OBJ file, once per content: PyBullet caches meshes by name.

    Coordinates are written with nine digits, which is exact for float32.
    """
    arrays = [vertices, faces, *(a for a in (normals, uv) if a is not None)]
    state = hashlib.blake2b(digest_size=16)
    for array in arrays:
        state.update(np.ascontiguousarray(array).tobytes())
    path = scratch_folder() / f"{state.hexdigest()}.obj"
    if path.exists():
        return path
    lines = _rows("v %.9g %.9g %.9g", vertices)
    if uv is not None:
        lines += _rows("vt %.9g %.9g", uv)
    if normals is not None:
        lines += _rows("vn %.9g %.9g %.9g", normals)
    # A corner reads vertex/texture/normal; the three share their numbers.
    corner = "%d" + ("/%d" if uv is not None else "/" if normals is not None else "")
    corner += "/%d" if normals is not None else ""
    repeated = np.repeat(faces + 1, corner.count("%d"), axis=1)
    lines += _rows(f"f {corner} {corner} {corner}", repeated)
    path.write_text("\n".join(lines) + "\n", encoding="ascii")
    return path


def _rows(template: str, table: Floats | Ints) -> list[str]:
    return [template % tuple(row) for row in table.tolist()]


def texture_file(picture: Picture) -> Path:
    """Write a picture (h, w, 3) under a name never used before, as PyBullet may cache by name.

    The caller deletes it once it is loaded.
    """
    path = scratch_folder() / f"texture-{next(_texture_numbers)}.png"
    Image.fromarray(picture).save(path, compress_level=0)
    return path
