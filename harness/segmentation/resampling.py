"""Intervals of what is no mean over scenes, such as an average precision: percentile bootstrap.

As for the means (`harness.statistics`), objects are drawn with all their scenes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from harness.statistics import LEAST_OBJECTS, MeanEstimate
from harness.statistics.intervals import CONFIDENCE

if TYPE_CHECKING:
    from collections.abc import Sequence

    import numpy.typing as npt

    Floats = npt.NDArray[np.float64]

RESAMPLES = 1000


@dataclass(frozen=True, eq=False)
class Resamples:
    """Draws of objects, with all that is theirs.

    Attributes
    ----------
    weights : (resamples + 1, items) float64
        How often each draw has each item; the first has all of them once.
    objects
        Number of objects.
    """

    weights: Floats
    objects: int

    @classmethod
    def draw(cls, objects: Sequence[str], *, seed: int, resamples: int = RESAMPLES) -> Resamples:
        """Draw resamples of the objects that items belong to.

        Parameters
        ----------
        objects
            The object of each item.
        seed, resamples
            Of the draws, and their number.
        """
        names, member = np.unique(np.array(objects, dtype=np.str_), return_inverse=True)
        count = len(names)
        times = np.ones((resamples + 1, count))
        if count:
            rng = np.random.Generator(np.random.Philox(seed))
            drawn = rng.integers(count, size=(resamples, count))
            for row, chosen in enumerate(drawn, start=1):
                times[row] = np.bincount(chosen, minlength=count)
        return cls(times[:, member], count)

    def estimate(self, values: Floats, *, count: int, objects: int | None = None) -> MeanEstimate:
        """State the value of all items, with its 95 % percentile interval.

        Parameters
        ----------
        values : (resamples + 1,) float64
            Of each draw; NaN where undefined.
        count
            Number of what the value is of.
        objects
            Of how many objects, if not of all; `LEAST_OBJECTS` at least for an interval.
        """
        if np.isnan(values[0]):
            return MeanEstimate(mean=None, low=None, high=None, count=0)
        low = high = None
        drawn = values[1:][~np.isnan(values[1:])]
        if len(drawn) and (self.objects if objects is None else objects) >= LEAST_OBJECTS:
            tail = (1.0 - CONFIDENCE) / 2.0
            low, high = (float(bound) for bound in np.quantile(drawn, (tail, 1.0 - tail)))
        return MeanEstimate(mean=float(values[0]), low=low, high=high, count=count)
