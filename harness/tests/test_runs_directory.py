"""Manifests and continued runs that do not fit."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any

import pytest

from harness.config import Config
from harness.errors import InputError
from harness.runs.opening import open_run

if TYPE_CHECKING:
    from pathlib import Path


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"sessions": [1]}, "a session is 1;"),
        ({"sessions": [{"git": [1]}]}, r"a session's git is \[1\];"),
        ({"sessions": [{"packages": 2}]}, "a session's packages is 2;"),
        ({"shard": "x"}, "shard is 'x';"),
        ({"shard": {"index": 1}}, r"shard is \{'index': 1\};"),
        ({"config": 3}, "no dict 'config';"),
    ],
)
def test_a_hostile_manifest_is_no_runs(
    tmp_path: Path, change: dict[str, Any], complaint: str
) -> None:
    run = open_run(tmp_path / "run", config=Config(), objects=[])
    path = run.folder / "manifest.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | change))
    with pytest.raises(InputError, match=rf"manifest\.json is no run's manifest: {complaint}"):
        run.manifest()


def test_a_run_goes_on_recording_as_it_began(tmp_path: Path) -> None:
    bare = Config.model_validate({"run": {"record": "nothing"}})
    assert bare.short_hash() == Config().short_hash()
    open_run(tmp_path / "run", config=bare, objects=[])
    with pytest.raises(InputError, match=r"begun with run\.record = 'nothing', not 'all'; pass"):
        open_run(tmp_path / "run", config=Config(), objects=[])


def test_a_baseline_says_why_it_has_no_recordings(tmp_path: Path) -> None:
    run = open_run(tmp_path / "run", config=Config(), objects=[])
    assert run.without_recordings() == f"resume it with `harness bench --out {run.folder}`"
    path = run.folder / "manifest.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"baseline": {}}))
    assert run.without_recordings() == (
        "a baseline keeps none; pass a run, such as that of "
        f"`harness bench --config {run.folder / 'config.toml'}`"
    )
