"""Whether mean losses are beyond their margins: one-sided tests of many rows, by object.

Why not the sign-change test of `harness.statistics`: with n objects its p-value is never below
1 / 2^n, 0.004 with the 8 objects of a class in a quick run. In a family of some 170 rows a single
loss would have to have p < 0.0003, so that no loss, however large, could be found. Student's test
of objects with all their scenes (Liang and Zeger 1986) has no such floor. It errs on the side of
silence where differences have long tails, and the margin keeps the true null far from its edge.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import stdtr, stdtrit

from harness.gate.margins import FLOOR, LEAST_OBJECTS, LEVEL
from harness.statistics import POWER, benjamini_hochberg

Floats = npt.NDArray[np.float64]
CONFIDENCE = 0.95


@dataclass(frozen=True, eq=False)
class LossTests:
    """Tests of rows; every array is (rows,), NaN where undefined.

    Attributes
    ----------
    mean
        Mean loss over the scenes that define it, positive where the revision is worse.
    half_width
        Half of the 95 % interval of the mean.
    q_values
        Benjamini-Hochberg's, over all rows that are judged.
    minimum_detectable
        Smallest true loss that is found with a probability of `POWER` where no other row loses.
    scenes, objects
        Numbers of those that define the loss.
    """

    mean: Floats
    half_width: Floats
    q_values: Floats
    minimum_detectable: Floats
    scenes: npt.NDArray[np.int64]
    objects: npt.NDArray[np.int64]

    @property
    def judged(self) -> npt.NDArray[np.bool_]:
        """Rows (rows,) with objects enough."""
        return self.objects >= LEAST_OBJECTS

    @property
    def worse(self) -> npt.NDArray[np.bool_]:
        """Rows (rows,) whose loss is surely beyond its margin."""
        return self.judged & (np.nan_to_num(self.q_values, nan=1.0) <= LEVEL)


def judge_losses(
    losses: Floats, *, objects: npt.NDArray[np.str_] | npt.NDArray[np.int64], margins: Floats
) -> LossTests:
    """Test whether mean losses are greater than their margins.

    ``t = (mean - margin) / sqrt(SE^2 + (FLOOR margin)^2)`` against Student's distribution with
    objects - 1 degrees of freedom, where ``SE^2 = n / (n - 1) sum over n objects of
    (sum - size mean)^2 / scenes^2``, an object's sum being that of all its scenes.

    Parameters
    ----------
    losses : (rows, scenes) float64
        By how much each scene is worse than in the baseline; NaN where undefined.
    objects : (scenes,) str or int64
        The object of each scene.
    margins : (rows,) float64
        Losses that are let pass, positive.
    """
    _, member = np.unique(objects, return_inverse=True)
    membership = np.eye(member.max(initial=-1) + 1)[member]
    defined = ~np.isnan(losses)
    sizes = defined.astype(np.float64) @ membership
    sums = np.where(defined, losses, 0.0) @ membership
    scenes = defined.sum(axis=1)
    count = np.count_nonzero(sizes, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = sums.sum(axis=1) / scenes
        apart = np.sum((sums - sizes * np.nan_to_num(mean)[:, np.newaxis]) ** 2, axis=1)
        error = np.sqrt(count / (count - 1) * apart) / scenes
    judged = count >= LEAST_OBJECTS
    freedom = np.where(judged, count - 1, 1)
    scale = np.hypot(error, FLOOR * margins)
    p_values = np.where(judged, stdtr(freedom, (margins - mean) / scale), np.nan)
    strictest = LEVEL / max(1, int(np.count_nonzero(judged)))
    found = margins + (stdtrit(freedom, 1 - strictest) + stdtrit(freedom, POWER)) * scale
    return LossTests(
        mean=mean,
        half_width=np.where(judged, stdtrit(freedom, (1 + CONFIDENCE) / 2) * error, np.nan),
        q_values=benjamini_hochberg(p_values),
        minimum_detectable=np.where(judged, found, np.nan),
        scenes=scenes,
        objects=count,
    )
