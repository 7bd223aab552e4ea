"""Random draws of shape parameters.

Everything is built on `Generator.random`, the one method whose stream numpy keeps between versions.
"""

from __future__ import annotations

import hashlib
from enum import StrEnum
from typing import TYPE_CHECKING, TypeVar

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Mapping

T = TypeVar("T")


class Split(StrEnum):
    """Disjoint families of shapes."""

    TRAIN = "train"
    VALIDATION = "validation"
    TEST = "test"


def stream(*, split: Split, category: str, index: int, seed: int) -> np.random.Generator:
    """Make the random stream of one object: counter-based, keyed by everything that names it."""
    name = f"credence/objects/{split.value}/{category}/{index}/{seed}"
    digest = hashlib.blake2b(name.encode(), digest_size=16).digest()
    return np.random.Generator(np.random.Philox(key=int.from_bytes(digest, "little")))


def uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """Draw from [low, high)."""
    return low + (high - low) * rng.random()


def chance(rng: np.random.Generator, probability: float) -> bool:
    """Draw True with this probability."""
    return rng.random() < probability


def integer(rng: np.random.Generator, low: int, high: int) -> int:
    """Draw an integer from low to high, both included."""
    return low + int((high - low + 1) * rng.random())


def choose(rng: np.random.Generator, weights: Mapping[T, float]) -> T:
    """Draw a key with probability proportional to its weight."""
    options = list(weights)
    edges = np.cumsum([weights[option] for option in options])
    return options[int(np.searchsorted(edges, rng.random() * edges[-1], side="right"))]
