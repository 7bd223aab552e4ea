"""All figures of a run and of ablations, written as PDF and PNG."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING

from harness.errors import InputError
from harness.figures.overview import draw_overview
from harness.figures.reliability import draw_reliability
from harness.figures.risk import draw_risk_coverage
from harness.figures.seed_table import draw_seed_table
from harness.figures.source import NothingToDrawError, RunSource, newest_run
from harness.figures.style import publication, write_figure, write_web_figure
from harness.figures.sweep import draw_sweep, read_sweeps, tolerance_sweep
from harness.figures.thresholds import draw_thresholds
from harness.figures.tracked import draw_beside, draw_tracked

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence
    from pathlib import Path

    from matplotlib.figure import Figure

Drawing = tuple["Figure", str]


def _draw_tolerance(source: RunSource) -> Drawing:
    return draw_sweep(tolerance_sweep(source), classes=source.config.run.classes)


OF_RUN: Mapping[str, Callable[[RunSource], Drawing]] = {
    "fig1": draw_overview,
    "fig3": draw_tracked,
    "fig5": draw_beside,
    "fig6": draw_thresholds,
    "risk-coverage": draw_risk_coverage,
    "reliability": draw_reliability,
    "table3": draw_seed_table,
    "tolerance": _draw_tolerance,
}
"""Figures of a run by name; the seed's go by its numbers."""

ABLATION = "ablation"
NAMES = (*OF_RUN, ABLATION)


@dataclass(frozen=True)
class FigureOptions:
    """Which figures to draw.

    Attributes
    ----------
    run
        A finished run's folder; by default the newest in ``results``.
    out
        Folder to write, by default ``figures`` in the run's.
    only
        Names among `NAMES`; all where none is given.
    ablations
        Folders that ``harness ablate`` wrote.
    web
        Write small PNGs for web pages, and no PDF.
    """

    run: Path | None = None
    out: Path | None = None
    only: Sequence[str] = ()
    ablations: Sequence[Path] = ()
    web: bool = False


@dataclass(frozen=True)
class DrawnFigure:
    """A figure that was written: its name, what it shows, and its files."""

    name: str
    caption: str
    files: tuple[Path, ...]


@dataclass(frozen=True)
class SkippedFigure:
    """A figure whose data there is not, and why."""

    name: str
    why: str


@dataclass(frozen=True)
class FiguresResult:
    """What was drawn.

    Attributes
    ----------
    run
        The run's folder; None where ablations alone were drawn.
    out
        Where the files are.
    """

    run: Path | None
    out: Path
    drawn: Sequence[DrawnFigure] = field(default_factory=tuple)
    skipped: Sequence[SkippedFigure] = field(default_factory=tuple)


def draw_figures(
    options: FigureOptions, *, progress: Callable[[str], object] | None = None
) -> FiguresResult:
    """Draw figures from what was recorded; nothing is simulated or computed again.

    Parameters
    ----------
    options
        Which, and where to.
    progress
        Told each figure's name before it is drawn.

    Raises
    ------
    InputError
        A name that no figure has; a folder that holds no finished run or no ablation, or cannot be
        written; damaged data.
    """
    names = _chosen(options)
    source = None
    if any(name in OF_RUN for name in names):
        source = RunSource.open(options.run or newest_run())
    elif not options.ablations:
        raise InputError("--only ablation needs an ablation; pass its folder as --ablation DIR")
    root = source.run.folder if source is not None else options.ablations[0]
    out = options.out or root / "figures"
    write = write_web_figure if options.web else write_figure
    drawn: list[DrawnFigure] = []
    skipped: list[SkippedFigure] = []
    # What is bad input is found before the first figure is drawn.
    for name, draw in list(_drawings(names, source, options.ablations)):
        if progress is not None:
            progress(name)
        try:
            with publication():
                figure, caption = draw()
                _make(out)
                files = write(figure, out / name)
        except NothingToDrawError as nothing:
            skipped.append(SkippedFigure(name, str(nothing)))
        else:
            drawn.append(DrawnFigure(name, caption, files))
    return FiguresResult(
        run=None if source is None else source.run.folder,
        out=out,
        drawn=tuple(drawn),
        skipped=tuple(skipped),
    )


def _chosen(options: FigureOptions) -> Sequence[str]:
    for name in options.only:
        if name not in NAMES:
            raise InputError(f"--only {name}: there is no such figure; pass {', '.join(NAMES)}")
    return [name for name in NAMES if name in options.only] or list(NAMES)


def _drawings(
    names: Sequence[str], source: RunSource | None, ablations: Sequence[Path]
) -> Iterator[tuple[str, Callable[[], Drawing]]]:
    """Yield what to draw, with the name of its file."""
    for name in names:
        if name in OF_RUN and source is not None:
            yield name, partial(OF_RUN[name], source)
    if ABLATION not in names:
        return
    taken: set[str] = set()
    for folder in ablations:
        sweeps = read_sweeps(folder)
        stem = f"{ABLATION}-{folder.resolve().name}"
        if stem in taken:
            raise InputError(
                f"two ablations are named {folder.resolve().name}; pass one, or rename a folder"
            )
        taken.add(stem)
        if not sweeps:
            yield stem, partial(_skip, f"{folder} varies nothing: no axis has two steps")
        for axis, sweep in sweeps.items():
            name = stem if len(sweeps) == 1 else f"{stem}-{axis}"
            yield name, partial(draw_sweep, sweep)


def _skip(why: str) -> Drawing:
    raise NothingToDrawError(why)


def _make(out: Path) -> None:
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            f"cannot write to {out}: {error.strerror}; pass a writable --out"
        ) from None
