"""What an ablation shows: every cell's means, and how they differ from the first that has any."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import polars as pl

from harness.protocol import test_set_of
from harness.same_scene import are_alike
from harness.statistics import (
    MeanEstimate,
    PairedTest,
    benjamini_hochberg,
    mean_estimate,
    paired_test,
)
from harness.table.columns import DIFFERENCE_COLUMNS

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from harness.ablation.spec import Cell, Label

METRICS = tuple(column.key for column in DIFFERENCE_COLUMNS)
"""What cells are compared by."""

_FIRST = " of the first"

Group = tuple[str, str, str]
"""Class, test set and model: what is compared between cells. Where each cell has a model of its
own, it is `VARIED`."""

VARIED = "(varied)"


@dataclass(frozen=True)
class Entry:
    """A metric of a cell.

    Attributes
    ----------
    cell
        The cell's index.
    group
        Class, test set and model.
    completion
        The completion that made the test set's points.
    estimate
        Mean over scenes, with its interval.
    difference
        Less that of the first cell that has the group, on the scenes that are the same in both;
        None of that cell.
    q_value
        Its p-value, corrected by Benjamini and Hochberg over all differences of the ablation; None
        where there is none.
    """

    cell: int
    group: Group
    completion: str
    metric: str
    estimate: MeanEstimate
    difference: PairedTest | None
    q_value: float | None


@dataclass(frozen=True)
class Summary:
    """All entries, and the cells' steps.

    Attributes
    ----------
    labels
        Each cell's step on every axis.
    entries
        By metric, then group, then cell.
    """

    labels: Sequence[Mapping[str, Label]]
    entries: Sequence[Entry]

    def csv(self) -> str:
        """Write every entry as a line, at full precision."""
        rows = []
        for item in self.entries:
            category, test_set, model = item.group
            row: dict[str, object] = {"cell": item.cell}
            row |= {f"grid.{axis}": str(step) for axis, step in self.labels[item.cell].items()}
            row |= {
                "category": category,
                "test_set": test_set,
                "completion": item.completion,
                "model": model,
                "metric": item.metric,
                "mean": item.estimate.mean,
                "low": item.estimate.low,
                "high": item.estimate.high,
                "scenes": item.estimate.count,
            }
            test = item.difference
            row |= {
                "difference": test.mean if test else None,
                "difference_low": test.low if test else None,
                "difference_high": test.high if test else None,
                "p_value": test.p_value if test else None,
                "q_value": item.q_value,
                "effect_size": test.effect_size if test else None,
                "minimum_detectable": test.minimum_detectable if test else None,
                "paired_scenes": test.scenes if test else None,
                "objects": test.objects if test else None,
            }
            rows.append(row)
        text = io.StringIO()
        pl.DataFrame(rows, infer_schema_length=None).write_csv(text)
        return text.getvalue()


def summarise_cells(cells: Sequence[Cell], frame: pl.DataFrame, *, seed: int) -> Summary:
    """Summarise an ablation's records.

    Parameters
    ----------
    cells
        In order.
    frame
        Their records: see `harness.ablation.frame.ablation_frame`.
    seed
        Of the resampling and the permutations.
    """
    ok = frame.filter(pl.col("status") == "ok").with_columns(
        pl.col("completion")
        .replace_strict(
            {name: test_set_of(name) for name in frame["completion"].unique()},
            return_dtype=pl.String,
        )
        .alias("test_set")
    )
    alone = ok.group_by("cell").agg(pl.col("model").n_unique())["model"].to_list()
    if set(alone) == {1} and ok["model"].n_unique() > 1:
        ok = ok.with_columns(pl.lit(VARIED).alias("model"))
    order = {name: place for place, name in enumerate(ok["category"].unique(maintain_order=True))}
    parts = {
        (str(category), str(test_set), str(model), int(cell)): part
        for (category, test_set, model, cell), part in ok.partition_by(
            ["category", "test_set", "model", "cell"], as_dict=True
        ).items()
    }
    first: dict[Group, int] = {}
    for key in parts:
        first[key[:3]] = min(key[3], first.get(key[:3], key[3]))
    entries = [
        Entry(
            cell=key[3],
            group=key[:3],
            completion=" and ".join(sorted(parts[key]["completion"].unique())),
            metric=metric,
            estimate=_mean(parts[key], metric, seed=seed),
            difference=(
                None
                if key[3] == first[key[:3]]
                else _less(parts[key], parts[*key[:3], first[key[:3]]], metric, seed)
            ),
            q_value=None,
        )
        for metric in METRICS
        for key in sorted(parts, key=lambda key: (order[key[0]], *key))
    ]
    return Summary([cell.labels for cell in cells], _with_q_values(entries))


def _mean(part: pl.DataFrame, metric: str, *, seed: int) -> MeanEstimate:
    return mean_estimate(
        part[metric].cast(pl.Float64).fill_null(np.nan).to_numpy(),
        objects=part["object_name"].to_numpy().astype(np.str_),
        seed=seed,
    )


def _less(part: pl.DataFrame, first: pl.DataFrame, metric: str, seed: int) -> PairedTest:
    """Compare a cell with the first one, scene by scene, where both are of the same scene."""
    both = part.join(first, on="scene_id", suffix=_FIRST).filter(are_alike(suffix=_FIRST))
    both = both.sort("scene_id")
    differences = (both[metric] - both[metric + _FIRST]).cast(pl.Float64).fill_null(np.nan)
    return paired_test(
        differences.to_numpy(), objects=both["object_name"].to_numpy().astype(np.str_), seed=seed
    )


def _with_q_values(entries: Sequence[Entry]) -> list[Entry]:
    p_values = [item.difference.p_value if item.difference else None for item in entries]
    given = np.array([np.nan if p is None else p for p in p_values], dtype=np.float64)
    q_values = benjamini_hochberg(given)
    return [
        Entry(
            item.cell,
            item.group,
            item.completion,
            item.metric,
            item.estimate,
            item.difference,
            None if np.isnan(q) else float(q),
        )
        for item, q in zip(entries, q_values, strict=True)
    ]
