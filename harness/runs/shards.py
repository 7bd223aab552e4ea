"""Parts of one plan, for schedulers of batches: each part is a run of its own in its own folder."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Self, TypeVar

from harness.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

Item = TypeVar("Item")

_REMEDY = "should be I/N, the I-th of N parts, such as 1/4"


@dataclass(frozen=True, order=True)
class Shard:
    """One of the parts that a plan is dealt out to.

    Attributes
    ----------
    index
        Which part, from 1.
    count
        Number of parts.
    """

    index: int
    count: int

    @classmethod
    def parse(cls, text: str) -> Self:
        """Read ``I/N``.

        Raises
        ------
        InputError
            It is none.
        """
        if (found := re.fullmatch(r"(\d{1,6})/(\d{1,6})", text)) is None:
            raise InputError(f"--shard {text}: {_REMEDY}")
        index, count = (int(group) for group in found.groups())
        if not 1 <= index <= count:
            raise InputError(f"--shard {text}: {_REMEDY}; I runs from 1 to N")
        return cls(index, count)

    def take(self, items: Sequence[Item]) -> list[Item]:
        """Take every N-th item: neighbours in a plan are alike, and so each part has of all."""
        return list(items[self.index - 1 :: self.count])

    def __str__(self) -> str:
        return f"{self.index}/{self.count}"
