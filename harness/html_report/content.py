"""All that the page's markup shows."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from harness.html_report.comparison import RunComparison
    from harness.html_report.grid import Grid, Tone
    from harness.html_report.provenance import Provenance
    from harness.html_report.verdict import Verdict


@dataclass(frozen=True)
class Fact:
    """A number that is said large, and what it counts."""

    value: str
    name: str
    tone: Tone = ""


@dataclass(frozen=True, kw_only=True)
class Page:
    """What the page's markup shows, section by section; scripts draw curves and scenes.

    Attributes
    ----------
    title, subtitle
        The run's name, and what it measured.
    source
        Its folder.
    verdict, facts
        The headline.
    lacking
        Which sections lack data and why.
    losses
        Failures and missed targets.
    comparison
        With another run; None without one.
    tables, tables_about
        A table for each class and test set, and what their numbers are.
    differences
        Of models, paired.
    every_measure, sweep
        All measures at the reported tolerance, and the chief ones at all tolerances.
    curves
        Whether there are any.
    curves_about
        What the curves are, or why there are none.
    calibration
        Numbers of every score; None without curves.
    pictured
        Whether any scene has pictures.
    scenes_about
        By what rule they are ranked.
    scene_table
        The worst.
    timings, timings_lacking
        Stages' times, or why there are none.
    provenance
        Where the numbers come from.
    """

    title: str
    subtitle: str
    source: str
    verdict: Verdict
    facts: Sequence[Fact]
    lacking: Sequence[str]
    losses: Sequence[Grid]
    comparison: RunComparison | None
    tables: Sequence[Grid]
    tables_about: str
    differences: Grid
    every_measure: Grid
    sweep: Grid
    curves: bool
    curves_about: str
    calibration: Grid | None
    pictured: bool
    scenes_about: str
    scene_table: Grid
    timings: Grid | None
    timings_lacking: str
    provenance: Provenance

    @property
    def contents(self) -> list[tuple[str, str]]:
        """Anchors and names of the sections."""
        against = [("comparison", "Against")] if self.comparison else []
        return [
            ("verdict", "Verdict"),
            *against,
            ("tables", "Tables"),
            ("curves", "Risk and reliability"),
            ("scenes", "Scenes"),
            ("timings", "Timings"),
            ("provenance", "Provenance"),
        ]
