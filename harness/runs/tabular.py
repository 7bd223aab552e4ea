"""Rows of one dataclass as Parquet: what they refuse, and files that are the same bytes."""

from __future__ import annotations

import io
import math
from dataclasses import asdict, fields
from typing import TYPE_CHECKING, Any, TypeVar, get_type_hints

import polars as pl

from harness.errors import InputError
from harness.runs.atomic import write_atomically

if TYPE_CHECKING:
    from collections.abc import Sequence
    from pathlib import Path

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
    write_parquet(pl.DataFrame([asdict(row) for row in rows], schema=schema), path)


def write_parquet(frame: pl.DataFrame, path: Path) -> None:
    """Write a table atomically, and as the same bytes wherever it is written."""
    # Every setting that shapes the bytes is spelt out, so that a new default cannot. They go
    # through memory because polars reports a full disk in its own way.
    content = io.BytesIO()
    frame.write_parquet(
        content, compression="zstd", compression_level=3, statistics=True, row_group_size=1 << 16
    )
    write_atomically(path, lambda file: file.write(content.getbuffer()))


def read_rows(path: Path, *, row: type[Row]) -> list[Row]:
    """Read what `write_rows` wrote.

    Raises
    ------
    InputError
        The file is missing, damaged or of another schema.
    """
    schema = schema_of(row)
    try:
        frame = pl.read_parquet(path)
    except FileNotFoundError:
        raise InputError(f"{path} is missing; finish the run with `harness bench --out`") from None
    except (OSError, pl.exceptions.PolarsError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(f"{path} is damaged ({reason}); delete it and resume the run") from None
    if frame.schema != schema:
        odd = sorted(set(frame.schema.items()) ^ set(schema.items()), key=str)
        raise InputError(
            f"{path} has other columns than this version's ({odd[0][0] if odd else 'order'}); "
            "read it with the version named in its manifest.json"
        )
    return [row(**values) for values in frame.to_dicts()]


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
