"""Multiply a run's scenes to a run of 100,000 records, to time what reads runs.

    python -m harness.benchmarks.many_records RUN OUT [--records 100000]

OUT is a finished run as `harness show`, `compare`, `report` and `gate` read it: every scene of RUN
stands in it many times, under new names and seeds, of the same objects. It has no recordings. Then
time what reads it, such as

    /usr/bin/time -v harness show OUT
"""

from __future__ import annotations

import argparse
import json
import math
import time
from pathlib import Path

import polars as pl

from harness.errors import InputError
from harness.results import finished_run
from harness.runs.atomic import write_text
from harness.runs.directory import CONFIG, MANIFEST
from harness.runs.tabular import write_parquet

RECORDS = 100_000


def multiply_run(source: Path, out: Path, *, records: int = RECORDS) -> int:
    """Write a run with at least so many records; returns their number.

    Raises
    ------
    InputError
        `source` is no finished run, or `out` is taken.
    """
    run = finished_run(source)
    if out.exists():
        raise InputError(f"{out} exists; pass another folder")
    config = run.config()
    frame = pl.read_parquet(run.records_path)
    copies = math.ceil(records / frame.height)
    out.mkdir(parents=True)
    for path in (run.records_path, run.confusion_path, run.timings_path):
        table = pl.read_parquet(path)
        parts = [_renamed(table, copy=copy, scenes=config.run.scenes) for copy in range(copies)]
        # Stable: what is sorted within a scene stays so.
        whole = pl.concat(parts).sort("scene_id", maintain_order=True)
        write_parquet(whole, out / path.name)
    scenes = config.run.scenes * copies
    config = config.model_copy(update={"run": config.run.model_copy(update={"scenes": scenes})})
    write_text(out / CONFIG, config.to_toml())
    manifest = run.manifest() | {"config": config.model_dump(mode="json")}
    write_text(out / MANIFEST, json.dumps(manifest, indent=2))
    return frame.height * copies


def _renamed(table: pl.DataFrame, *, copy: int, scenes: int) -> pl.DataFrame:
    """Give a copy's scenes the numbers after those of the copies before it."""
    number = pl.col("scene_id").str.extract(r"(\d+)$").cast(pl.Int64) + copy * scenes
    named = pl.format(
        "{}-{}",
        pl.col("scene_id").str.replace(r"-\d+$", ""),
        number.cast(pl.String).str.zfill(6),
    )
    changes = {"scene_id": named}
    if "seed" in table.columns:
        # Seeds are below 2^63.
        changes["seed"] = pl.col("seed") // 2 + copy
    return table.with_columns(**changes)


def main() -> None:
    """Write the run."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("run", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--records", type=int, default=RECORDS)
    options = parser.parse_args()
    start = time.perf_counter()
    count = multiply_run(options.run, options.out, records=options.records)
    print(f"{count} records in {options.out} after {time.perf_counter() - start:.1f} s")


if __name__ == "__main__":
    main()
