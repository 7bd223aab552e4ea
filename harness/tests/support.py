"""What several test modules share besides fixtures."""

from __future__ import annotations

import resource
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator

HEIGHT, WIDTH = 48, 64
LOOKING_DOWN = np.diag([1.0, -1.0, -1.0, 1.0])


def frame(**change: Any) -> dict[str, Any]:
    """Arguments of `Pipeline.add_frame`: a plane 0.5 m below, on it a mug's flat lid 5 cm up."""
    instance_ids = np.zeros((HEIGHT, WIDTH), dtype=np.uint16)
    instance_ids[16:32, 20:44] = 1
    return {
        "rgb": np.zeros((HEIGHT, WIDTH, 3), dtype=np.uint8),
        "depth_m": np.where(instance_ids == 1, 0.45, 0.5).astype(np.float32),
        "intrinsics": (60.0, 60.0, 31.5, 23.5),
        "world_from_camera": LOOKING_DOWN,
        "instance_ids": instance_ids,
        "categories": {1: "mug"},
    } | change


@contextmanager
def full_disk(limit: int) -> Iterator[None]:
    """Let every file end after so many bytes, as on a full disk."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
