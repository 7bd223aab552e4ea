"""An ablation's records in one table."""

from __future__ import annotations

from typing import TYPE_CHECKING

import polars as pl

from harness.ablation.spec import axis_values
from harness.runs.records import RECORD_SCHEMA, read_records

if TYPE_CHECKING:
    from collections.abc import Sequence

    from harness.ablation.spec import Cell
    from harness.runs.directory import RunDirectory

AXIS = "grid."
"""Start of a column that holds a cell's step on an axis."""


def read_cell(run: RunDirectory) -> pl.DataFrame:
    """Read a cell's records at the tolerance that it reports.

    Raises
    ------
    InputError
        The records are missing or damaged.
    """
    tolerance_m = run.config().protocol.reported_tolerance_m
    read_records(run.records_path)  # says what is wrong with a file that it refuses
    records = pl.read_parquet(run.records_path)
    return records.filter(pl.col("tolerance_m") == tolerance_m)


def ablation_frame(cells: Sequence[tuple[Cell, pl.DataFrame]]) -> pl.DataFrame:
    """Put the records of all cells below each other.

    Parameters
    ----------
    cells
        With their records.

    Returns
    -------
    frame
        ``cell``, a `AXIS` column for every axis, and the columns of a record.
    """
    if not cells:
        return pl.DataFrame(schema=RECORD_SCHEMA)
    order = [cell for cell, _ in cells]
    steps = {axis: axis_values(order, axis) for axis in order[0].labels}
    parts = []
    for place, (cell, records) in enumerate(cells):
        labels = {AXIS + axis: pl.lit(_plain(values, place)) for axis, values in steps.items()}
        columns = [pl.lit(cell.index, dtype=pl.Int64).alias("cell")]
        columns += [value.alias(name) for name, value in labels.items()]
        parts.append(records.select(*columns, *records.columns))
    return pl.concat(parts)


def _plain(values: Sequence[object], place: int) -> object:
    """One cell's step; all of an axis are floats if any is."""
    value = values[place]
    return float(value) if any(isinstance(item, float) for item in values) else value  # type: ignore[arg-type]
