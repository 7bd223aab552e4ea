"""What the gate judges, by which margins, and how surely: the one table that decides.

A margin is the loss that a revision may have without a word. It has to lie well below the losses
that shall be caught: 2 points of precision are 10 margins. The figures of what is caught and what
false alarms cost are measured by ``python -m harness.benchmarks.gate_power RUN``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class Gated:
    """A metric that the gate judges.

    Attributes
    ----------
    key
        The record's field.
    heading
        Name in print.
    better
        Which values are better.
    margin
        Loss of the mean over a cell's scenes that is let pass, in the metric's unit.
    undefined
        Value of a scene where the answers leave the metric undefined, so that a model cannot escape
        by giving no answer; None where it is undefined by the truth alone: a scene counts then only
        where both runs define it.
    """

    key: str
    heading: str
    better: Literal["higher", "lower"]
    margin: float
    undefined: float | None = None


GATED = (
    # Without a positive prediction none is right, as in scikit-learn's zero_division=0.
    Gated("precision", "precision", "higher", 0.002, undefined=0.0),
    Gated("recall", "recall", "higher", 0.005),
    Gated("accuracy", "accuracy", "higher", 0.002),
    # Undefined where all points lie on the mesh, as in many completions.
    Gated("auroc", "AUROC", "higher", 0.005),
    Gated("aurc", "AURC", "lower", 0.002),
    # Null where the map takes the target for something else: sure of what is wrong.
    Gated("ece_recalibrated", "recal. ECE", "lower", 0.005, undefined=1.0),
    Gated("log_loss", "log loss", "lower", 0.01),
)
"""In the order in which they are shown."""

UNJUDGED = frozenset({"metric_literal"})
"""Models whose metrics are not judged, only their lost scenes. The seed's Eq. 1 read to the letter
has no sound covariance, and its answers hinge on last bits: with it, 7 of 100 revisions of equal
quality fail where the differences are centred and objects redrawn, without it 1."""

LEAST_POINTS = 0.9
"""Share of the baseline's test points that a scene must still have: a completion that gives few
points, all of them right, must not pass for a better one."""

LEVEL = 0.05
"""Share of false ones among the losses that are called found (Benjamini-Hochberg), in each of three
families: the rows of single cells, those of each model and test set over all classes, and those of
each model over all. A loss in some objects alone, such as 4 points in every second, is found with
the objects of all classes together, and hardly with those of one."""

FLOOR = 0.25
"""Least standard error, in margins: differences below it are not told apart, so that rows without
any spread, such as those of identical answers, have a test at all."""

LEAST_OBJECTS = 5
"""A row with fewer objects is not judged, a class with fewer is refused."""

SLOWER = 1.25
"""A stage is too slow if it surely takes more than so many times the baseline's time."""

SURELY = 0.99
"""Confidence of the lower bound of a stage's median ratio that is held against `SLOWER`."""

LEAST_SECONDS = 0.02
"""Stages that took less in the baseline's median scene are not judged by themselves."""

UNSTEADY = 1.5
"""The machine was not steady if the calibration took so many times longer after than before, or
the other way round: no stage is judged then."""
