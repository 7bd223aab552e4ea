"""What the gate catches and how often it cries wolf, by simulation on recorded runs, as Markdown.

    python -m harness.benchmarks.gate_power RUN [OTHER] [--repeats 1000]

OTHER is a run of the same scenes and equal quality whose bits differ throughout, such as one with a
hundredth more depth noise and 10 fewer training points. Three kinds of revisions are made of them:

- ``same``: RUN's own records, as an unchanged revision yields them;
- ``swapped``: RUN plus the differences of OTHER, each object's with all its scenes and metrics from
  a random side. Two runs of equal quality could as well have come in the other order, so this is a
  revision of equal quality, as noisy as OTHER;
- ``centred``: RUN plus OTHER's differences less their mean, of objects drawn with replacement.

Into each of them a loss of precision is planted: answers of one model are flipped, point by point
at random, so that the precision of every scene falls by 2 points in the mean. True negatives become
false positives, or true positives where too few negatives are there. Precision, recall and accuracy
follow; the other metrics stay as they are, which makes the loss harder to find. An uneven loss is
one of 4 points in half of the objects, drawn anew each time.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from scipy.stats import binomtest

from harness.bench import QUICK_SCENES
from harness.errors import InputError
from harness.gate.acceptance import reported
from harness.gate.losses import judge_losses
from harness.gate.pairs import Paired, families, pair_runs
from harness.protocol import test_set_of
from harness.results import finished_run
from harness.runs.records import read_records

if TYPE_CHECKING:
    from collections.abc import Sequence

    from harness.gate.pairs import Cell
    from harness.runs.records import Record

Floats = npt.NDArray[np.float64]

POINTS_LOST = 0.02
"""Planted loss of precision."""

COUNTED = ("precision", "recall", "accuracy")
"""Metrics that follow from the counts."""

KINDS = ("same", "swapped", "centred")
SEED = 20


@dataclass(frozen=True, eq=False)
class Study:
    """What revisions are made of; rows and scenes as in `paired`.

    Attributes
    ----------
    paired
        RUN beside OTHER.
    counts
        By cell: tp, tn, fp, fn as (4, scenes) float64, NaN where the scene is not of the cell.
    margins : (rows,) float64
    """

    paired: Paired
    counts: dict[Cell, Floats]
    margins: Floats


def read_study(run: Path, other: Path) -> Study:
    """Read two recorded runs."""
    records, others = (
        reported(read_records(item.records_path), item.config())
        for item in (finished_run(run), finished_run(other))
    )
    return make_study(records, others, names=f"{run} and {other}")


def make_study(records: Sequence[Record], others: Sequence[Record], *, names: str) -> Study:
    """Lay two runs side by side."""
    paired = pair_runs(records, others, names=names)
    place = {str(scene_id): index for index, scene_id in enumerate(paired.scene_ids)}
    cells = {
        (row.cell.category, row.cell.test_set, row.cell.model): row.cell for row in paired.rows
    }
    counts = {cell: np.full((4, len(place)), np.nan) for cell in cells.values()}
    for record in records:
        if record.status == "ok":
            cell = cells[record.category, test_set_of(record.completion), record.model]
            values = (record.tp, record.tn, record.fp, record.fn)
            counts[cell][:, place[record.scene_id]] = [value or 0 for value in values]
    margins = np.array([row.metric.margin for row in paired.rows])
    return Study(paired, counts, margins)


def planted_losses(counts: Floats, *, loss: float, random: np.random.Generator) -> list[Floats]:
    """Flip answers so that precision falls; returns what each of `COUNTED` loses by scene.

    With precision p = TP / (TP + FP), ``TP / (p - loss) - TP - FP`` more false positives make it
    ``p - loss``; where there are not twice as many true negatives to take them from,
    ``loss (TP + FP)`` true positives turn into false ones.

    Parameters
    ----------
    counts : (4, scenes) float64
        TP, TN, FP and FN.
    """
    tp, tn, fp, fn = np.nan_to_num(counts)
    with np.errstate(divide="ignore", invalid="ignore"):
        more = np.nan_to_num(tp / (tp / (tp + fp) - loss) - tp - fp, posinf=0.0)
        from_negatives = (more > 0) & (tn >= 2 * more)
        share_tn = np.where(from_negatives, more / tn, 0.0)
        share_tp = np.where(~from_negatives & (tp > 0), loss * (tp + fp) / tp, 0.0)
        new = random.binomial(tn.astype(int), share_tn.clip(0.0, 1.0))
        turned = random.binomial(tp.astype(int), share_tp.clip(0.0, 1.0))
        points = tp + tn + fp + fn
        return [
            tp / (tp + fp) - (tp - turned) / (tp + fp + new),
            # Points that are no longer on the mesh are asked for no longer.
            tp / (tp + fn) - (tp - turned) / (tp - turned + fn),
            (new + turned) / points,
        ]


def simulate(
    study: Study,
    *,
    kind: str,
    planted: Sequence[Cell],
    scenes_per_class: int,
    repeats: int,
    models: Sequence[str] | None = None,
    uneven: bool = False,
) -> int:
    """Count the revisions of a kind that fail.

    Parameters
    ----------
    planted
        Cells that lose `POINTS_LOST`.
    scenes_per_class
        The first of each class.
    models
        Judge these alone; by default all.
    uneven
        Half of the objects lose twice as much, the others nothing.
    """
    random = np.random.default_rng(SEED)
    paired = study.paired
    index = np.array([int(str(name).rsplit("-", 1)[-1]) for name in paired.scene_ids])
    some = np.flatnonzero(index < scenes_per_class)
    kept = [
        place for place, row in enumerate(paired.rows) if models is None or row.cell.model in models
    ]
    rows = [paired.rows[place] for place in kept]
    margins, noise = study.margins[kept], np.stack([row.losses for row in rows])[:, some]
    if kind == "same":
        noise = noise * 0.0
    _, member = np.unique(paired.objects[some], return_inverse=True)
    classes = np.array([str(name).rsplit("-", 1)[0] for name in paired.scene_ids[some]])
    pooled = families(rows)
    limits_of = [margins] + [
        np.array([metric.margin for _, metric in family.rows]) for family in pooled
    ]
    place_of = {(row.cell, row.metric.key): place for place, row in enumerate(rows)}
    defined = np.isfinite(noise)
    sums = np.where(defined, noise, 0.0).sum(axis=1, keepdims=True)
    middle = sums / np.maximum(defined.sum(axis=1, keepdims=True), 1)
    failed = 0
    for _ in range(repeats):
        losses, objects, chosen = noise, member, np.arange(some.size)
        if kind == "swapped":
            losses = noise * random.choice((-1.0, 1.0), size=member.max() + 1)[member]
        losses = losses.copy()
        if kind == "centred":
            losses -= middle
            chosen, objects = draw_objects(member, classes=classes, random=random)
        hit = np.ones(some.size)
        if uneven:
            hit = (random.permutation(member.max() + 1) % 2 == 0)[member].astype(np.float64)
        for cell in planted:
            loss = POINTS_LOST * (2 if uneven else 1)
            found = planted_losses(study.counts[cell], loss=loss, random=random)
            for key, values in zip(COUNTED, found, strict=True):
                losses[place_of[cell, key]] += values[some] * hit
        losses = losses[:, chosen]
        tested = [losses, *(family.means(losses) for family in pooled)]
        failed += any(
            judge_losses(values, objects=objects, margins=limits).worse.any()
            for values, limits in zip(tested, limits_of, strict=True)
        )
    return failed


def draw_objects(
    member: npt.NDArray[np.int64], *, classes: npt.NDArray[np.str_], random: np.random.Generator
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64]]:
    """Draw objects of each class with all their scenes, until there are as many scenes as before.

    Parameters
    ----------
    member, classes : (scenes,)
        Object and class of each scene.

    Returns
    -------
    chosen, objects : (scenes,) int64
        The scenes, and which draw each of them came with.
    """
    chosen: list[int] = []
    objects: list[int] = []
    draw = 0
    for category in np.unique(classes):
        of_class = classes == category
        names, wanted = np.unique(member[of_class]), len(chosen) + np.count_nonzero(of_class)
        while len(chosen) < wanted:
            scenes = np.flatnonzero(of_class & (member == random.choice(names)))
            scenes = scenes[: wanted - len(chosen)]
            chosen += scenes.tolist()
            objects += [draw] * scenes.size
            draw += 1
    return np.array(chosen), np.array(objects)


def share(failed: int, repeats: int) -> str:
    """Write a share in per cent, with its 95 % interval (Clopper and Pearson 1934)."""
    low, high = binomtest(failed, repeats).proportion_ci()
    return f"{100 * failed / repeats:.1f} [{100 * low:.1f}, {100 * high:.1f}]"


def main(arguments: Sequence[str] | None = None) -> int:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("run", type=Path, metavar="RUN")
    parser.add_argument("other", type=Path, metavar="OTHER", nargs="?")
    parser.add_argument("--repeats", type=int, default=1000)
    options = parser.parse_args(arguments)
    try:
        study = read_study(options.run, options.other or options.run)
    except InputError as error:
        sys.stderr.write(f"gate_power: {error}\n")
        return 2
    kinds = KINDS if options.other else KINDS[:1]
    cells = list(study.counts)
    models = sorted({cell.model for cell in cells})
    sizes = (len(study.paired.scene_ids), QUICK_SCENES)
    print(f"Revisions that fail, %, of {options.repeats}; all scenes, and with --quick")
    print(f"\n| planted | {' | '.join(f'{kind} | quick' for kind in kinds)} |")
    print(f"|---|{'--:|' * 2 * len(kinds)}")
    sound = [model for model in models if model != "metric_literal"]
    lines: list[tuple[str, list[Cell], Sequence[str] | None, bool]] = [
        ("nothing", [], None, False),
        ("nothing, metric_literal not judged", [], sound, False),
    ]
    for uneven, how in ((False, "all cells"), (True, "all cells, uneven")):
        lines += [
            (f"{model}, {how}", [cell for cell in cells if cell.model == model], None, uneven)
            for model in models
        ]
    lines += [
        (f"{cell.category} {cell.test_set} {cell.model} alone", [cell], None, False)
        for cell in cells
    ]
    for name, planted, judged, uneven in lines:
        entries = [
            share(
                simulate(
                    study,
                    kind=kind,
                    planted=planted,
                    scenes_per_class=size,
                    repeats=options.repeats,
                    models=judged,
                    uneven=uneven,
                ),
                options.repeats,
            )
            for kind in kinds
            for size in sizes
        ]
        print(f"| {name} | {' | '.join(entries)} |", flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
