"""Files that PyBullet insists on: it takes meshes and textures from disk only.

Vertex arrays would do for meshes, but PyBullet leaks them: 5 MB a scene.
"""

from __future__ import annotations

import contextlib
import fcntl
import functools
import hashlib
import itertools
import os
import shutil
import tempfile
import time
from multiprocessing.util import Finalize
from pathlib import Path
from typing import IO, TYPE_CHECKING

import numpy as np
from PIL import Image

if TYPE_CHECKING:
    from sim_scenes.geometry import Floats, Ints
    from sim_scenes.textures import Picture

PREFIX = "sim_scenes-"
LOCK = "in-use"
# A folder this young may not have been locked yet.
YOUNG_S = 60.0

_texture_numbers = itertools.count()


@functools.cache
def _folder_of(process: int) -> Path:
    """Make a folder that goes when this process ends or, if it is killed, with a later one."""
    remove_orphans()
    folder = Path(tempfile.mkdtemp(prefix=f"{PREFIX}{process}-"))
    lock = (folder / LOCK).open("w", encoding="ascii")
    fcntl.flock(lock, fcntl.LOCK_EX)
    # Unlike atexit this also runs when a pool's worker ends, and not in a forked child. It holds
    # on to the lock as well.
    Finalize(None, _remove, args=(folder, lock), exitpriority=0)
    return folder


def _remove(folder: Path, lock: IO[str]) -> None:
    shutil.rmtree(folder, ignore_errors=True)
    lock.close()


def remove_orphans() -> None:
    """Remove the folders of processes that were killed: nobody holds their locks."""
    for path in Path(tempfile.gettempdir()).glob(f"{PREFIX}*/{LOCK}"):
        # Another user's folder cannot be opened, a living process's lock not be had.
        with contextlib.suppress(OSError), path.open("r+", encoding="ascii") as lock:
            if time.time() - path.stat().st_mtime > YOUNG_S:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
                shutil.rmtree(path.parent, ignore_errors=True)


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
    # A bitmap is written in a tenth of the time that a PNG takes, even one that is not compressed.
    path = scratch_folder() / f"texture-{next(_texture_numbers)}.bmp"
    Image.fromarray(picture).save(path)
    return path
