"""Counter-based random streams, one per seed and purpose.

A stream depends on nothing but its seed and its name: a draw added to one purpose moves no other.
"""

from __future__ import annotations

import hashlib

import numpy as np


def stream(seed: int, purpose: str) -> np.random.Generator:
    """Return the random stream of one purpose.

    Parameters
    ----------
    seed
        The scene's seed.
    purpose
        Name of what is drawn, such as ``"placement/0"``.
    """
    key = hashlib.blake2b(f"{seed}/{purpose}".encode(), digest_size=16).digest()
    return np.random.Generator(np.random.Philox(key=int.from_bytes(key, "little")))
