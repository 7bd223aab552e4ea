"""Files of training pictures: safetensors, so that the training in Rust maps them as they are.

::

    DIR/manifest.json              format, seed, count, pictures_per_shard, objects (folder, sha256
                                   of its manifest), git, command; written last
        shard-00000.safetensors    pictures 0 to 49, and so on

A shard's tensors are `rgb` uint8 (n, 240, 320, 3), `depth` uint16 (n, 240, 320) in 0.1 mm with 0 =
not measured, `instances` uint8 (n, 240, 320) and `classes` uint8 (n, 16): see
`sim_scenes.pictures.TrainingPicture`. Its metadata name the format, the seed, the first picture's
index, the mesh set, and a checksum.
"""

from __future__ import annotations

import json
import struct
import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from safetensors import SafetensorError, safe_open
from safetensors.numpy import save

from harness.runs.atomic import write_atomically

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence
    from pathlib import Path

    from sim_scenes.pictures import TrainingPicture

FORMAT = 1
PICTURES_PER_SHARD = 50
TENSORS = ("rgb", "depth", "instances", "classes")


class DamagedShardError(ValueError):
    """A file that is not the shard it should be; the message says why."""


@dataclass(frozen=True)
class ShardKey:
    """What a shard's content depends on.

    Attributes
    ----------
    objects
        sha256 of the mesh set's manifest.
    seed
        Of the pictures.
    first, count
        Index of its first picture, and how many it holds.
    """

    objects: str
    seed: int
    first: int
    count: int

    def metadata(self) -> dict[str, str]:
        """As safetensors keeps it: texts."""
        return {
            "format": str(FORMAT),
            "objects": self.objects,
            "seed": str(self.seed),
            "first": str(self.first),
        }


def shard_path(folder: Path, number: int) -> Path:
    """Path of a shard."""
    return folder / f"shard-{number:05d}.safetensors"


def write_shard(path: Path, pictures: Sequence[TrainingPicture], key: ShardKey) -> None:
    """Write a shard, whole or not at all; the same pictures give the same bytes.

    Raises
    ------
    DiskError
        It could not be written.
    """
    tensors = {name: np.stack([getattr(item, name) for item in pictures]) for name in TENSORS}
    checked = {**key.metadata(), "crc32": _checksum(tensors)}
    data = _ordered(save(tensors, metadata=checked))
    write_atomically(path, lambda file: file.write(data))


def check_shard(path: Path, key: ShardKey) -> None:
    """Read a shard and compare it with what it should be.

    Raises
    ------
    DamagedShardError
        It cannot be read, its checksum is wrong, or it holds other pictures.
    """
    try:
        with safe_open(path, framework="numpy") as file:
            found = dict(file.metadata() or {})
            tensors = {name: file.get_tensor(name) for name in TENSORS}
    except (OSError, SafetensorError) as error:
        raise DamagedShardError(f"it cannot be read ({error})") from error
    checksum = found.pop("crc32", None)
    if found != key.metadata():
        raise DamagedShardError(f"it holds {found}, not {key.metadata()}")
    if len(tensors["rgb"]) != key.count:
        raise DamagedShardError(f"it holds {len(tensors['rgb'])} pictures, not {key.count}")
    if checksum != _checksum(tensors):
        raise DamagedShardError("its checksum is wrong")


def shard_metadata(path: Path) -> dict[str, str]:
    """Metadata of a shard; empty where it cannot be read."""
    try:
        with safe_open(path, framework="numpy") as file:
            return dict(file.metadata() or {})
    except (OSError, SafetensorError):
        return {}


def _checksum(tensors: Mapping[str, np.ndarray[Any, Any]]) -> str:
    total = 0
    for name in TENSORS:
        total = zlib.crc32(np.ascontiguousarray(tensors[name]).data, total)
    return f"{total:08x}"


def _ordered(data: bytes) -> bytes:
    """Put the metadata of a safetensors file in order: they come from a map that has none."""
    (length,) = struct.unpack_from("<Q", data)
    header = json.loads(data[8 : 8 + length])
    header["__metadata__"] = dict(sorted(header["__metadata__"].items()))
    text = json.dumps(header, separators=(",", ":")).encode().ljust(length)
    return data[:8] + text + data[8 + length :]
