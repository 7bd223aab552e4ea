"""Rows of one dataclass as Parquet: what they refuse, and files that are the same bytes."""

from __future__ import annotations

import io
import math
from dataclasses import fields
from typing import TYPE_CHECKING, Any, TypeVar, get_type_hints

import polars as pl

from harness.errors import InputError
from harness.runs.atomic import write_atomically

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence
    from pathlib import Path

    RowsCheck = Callable[[pl.DataFrame], str | None]

Row = TypeVar("Row")

_known_types: dict[type, dict[str, tuple[type, bool]]] = {}
_PARQUET_TYPES: dict[type, pl.DataType] = {
    bool: pl.Boolean(),
    float: pl.Float64(),
    int: pl.Int64(),
    str: pl.String(),
}


def check_types(row: object) -> None:
    """Refuse what Parquet would store as something else: NaN, infinities, numpy scalars.

    The message names the row's ``scene_id``.
    """
    where = getattr(row, "scene_id", "a row")
    for name, (kind, nullable) in _column_types(row.__class__).items():
        value: object = getattr(row, name)
        if value is None and nullable:
            continue
        if type(value) is not kind:
            raise ValueError(
                f"{where}: {name} is {value!r} of type {type(value).__name__}; "
                f"it must be {kind.__name__}"
            )
        if isinstance(value, float) and not math.isfinite(value):
            raise ValueError(f"{where}: {name} is {value}; an undefined value is None")


def schema_of(row: type) -> pl.Schema:
    """Columns of a dataclass: its fields."""
    return pl.Schema({name: _PARQUET_TYPES[kind] for name, (kind, _) in _column_types(row).items()})


def write_rows(rows: Sequence[Any], path: Path, *, schema: pl.Schema) -> None:
    """Write dataclasses as Parquet, in their order."""
    columns = {name: [getattr(row, name) for row in rows] for name in schema}
    write_parquet(pl.DataFrame(columns, schema=schema), path)


def write_parquet(frame: pl.DataFrame, path: Path) -> None:
    """Write a table atomically, and as the same bytes wherever it is written."""
    # Every setting that shapes the bytes is spelt out, so that a new default cannot. They go
    # through memory because polars reports a full disk in its own way.
    content = io.BytesIO()
    frame.write_parquet(
        content, compression="zstd", compression_level=3, statistics=True, row_group_size=1 << 16
    )
    write_atomically(path, lambda file: file.write(content.getbuffer()))


def read_rows(path: Path, *, row: type[Row], problem_of: RowsCheck | None = None) -> list[Row]:
    """Read what `write_rows` wrote.

    What a row's own constructor refuses is looked for column by column, and no row is checked by
    itself: a run may hold 100,000 rows of 50 fields.

    Parameters
    ----------
    row
        A dataclass whose fields are the columns.
    problem_of
        Says what is wrong with rows beyond the types of their fields, None where nothing is.

    Raises
    ------
    InputError
        The file is missing, damaged, of another schema, or holds what no row can.
    """
    schema = schema_of(row)
    again = f"delete it and resume the run with `harness bench --out {path.parent}`"
    try:
        frame = pl.read_parquet(path)
    except FileNotFoundError:
        raise InputError(
            f"{path} is missing; finish the run with `harness bench --out {path.parent}`"
        ) from None
    except (OSError, pl.exceptions.PolarsError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"{path} is damaged ({reason}); {again}") from None
    if frame.schema != schema:
        odd = sorted(set(frame.schema.items()) ^ set(schema.items()), key=str)
        raise InputError(
            f"{path} has other columns than this version's ({odd[0][0] if odd else 'order'}); "
            "read it with the version named in its manifest.json"
        )
    problem = _type_problem(frame, row=row) or (problem_of(frame) if problem_of else None)
    if problem:
        raise InputError(f"{path} holds what no run writes ({problem}); {again}")
    return _construct(frame, row=row)


def _type_problem(frame: pl.DataFrame, *, row: type) -> str | None:
    """Say which value `check_types` would refuse."""
    for name, (kind, nullable) in _column_types(row).items():
        column = frame[name]
        refused = [] if nullable else [column.is_null()]
        if kind is float:
            refused.append(~column.is_finite())
        for mask in refused:
            if (places := mask.fill_null(value=False).arg_true()).len():
                value, where = column[places[0]], frame["scene_id"][places[0]]
                return f"{where}: {name} is {'null' if value is None else value}"
    return None


def _construct(frame: pl.DataFrame, *, row: type[Row]) -> list[Row]:
    """Make the rows of a frame that was checked, past their own checks."""
    # A few strings, such as models and classes, stand in many rows: each is kept once.
    known: dict[str, str] = {}
    columns = []
    for column in frame:
        values = column.to_list()
        if column.dtype == pl.String():
            values = [value and known.setdefault(value, value) for value in values]
        columns.append(values)
    rows = [object.__new__(row) for _ in range(frame.height)]
    for name, values in zip(frame.columns, columns, strict=True):
        for item, value in zip(rows, values, strict=True):
            object.__setattr__(item, name, value)
    return rows


def _column_types(row: type) -> dict[str, tuple[type, bool]]:
    """Type of each field of a dataclass, and whether it may be None."""
    if row not in _known_types:
        hints = get_type_hints(row)
        options = {
            item.name: getattr(hints[item.name], "__args__", (hints[item.name],))
            for item in fields(row)
        }
        _known_types[row] = {
            name: (kinds[0], type(None) in kinds) for name, kinds in options.items()
        }
    return _known_types[row]
