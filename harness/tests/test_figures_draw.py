from __future__ import annotations

import json
from typing import TYPE_CHECKING

import pytest
import typer
from PIL import Image
from typer.testing import CliRunner

from harness.cli_figures import commands
from harness.errors import InputError
from harness.figures import panels
from harness.figures.draw import NAMES, FigureOptions, draw_figures
from harness.figures.style import ONE_COLUMN_IN, TWO_COLUMNS_IN, WEB_DPI
from harness.runs.directory import RunDirectory
from harness.tests.fake_html_report import write_run
from harness.tests.test_figures_charts import ablation, over_views

if TYPE_CHECKING:
    from pathlib import Path

app = typer.Typer()
app.registered_commands += commands.registered_commands

OF_RECORDS = {"table3"}
"""What needs no recordings; the fake run was scored at one tolerance."""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(tmp_path_factory.mktemp("figures") / "run").folder


@pytest.fixture(autouse=True)
def coarse_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Draw what is no line or letter with fewer pixels, in less time."""
    monkeypatch.setattr(panels, "DPI", 60)


def test_every_figure_is_written_and_what_lacks_data_is_named(run: Path, tmp_path: Path) -> None:
    seen: list[str] = []
    out = tmp_path / "new" / "out"
    result = draw_figures(FigureOptions(run=run, out=out, web=True), progress=seen.append)
    drawn = [figure.name for figure in result.drawn]
    assert drawn == [name for name in NAMES if name not in ("tolerance", "ablation")]
    assert [(item.name, item.why) for item in result.skipped] == [
        ("tolerance", "the run was scored at one tolerance alone")
    ]
    assert seen == [*drawn, "tolerance"]
    assert {path.name for path in result.out.iterdir()} == {f"{name}.png" for name in drawn}
    for figure in result.drawn:
        (path,) = figure.files
        with Image.open(path) as image:
            assert image.width / WEB_DPI in (TWO_COLUMNS_IN, ONE_COLUMN_IN)
    fig1 = result.drawn[0]
    assert fig1.caption.startswith("mug-0002 and bowl-0001, each the median scene of its class")


@pytest.mark.parametrize(("only", "web"), [(("fig3",), False), (("fig6", "risk-coverage"), True)])
def test_the_same_run_gives_the_same_bytes(
    run: Path, tmp_path: Path, *, only: tuple[str, ...], web: bool
) -> None:
    first, second = (
        draw_figures(FigureOptions(run=run, out=tmp_path / name, only=only, web=web))
        for name in "ab"
    )
    for ours, theirs in zip(first.drawn, second.drawn, strict=True):
        kinds = [path.suffix for path in ours.files]
        assert kinds == ([".png"] if web else [".pdf", ".png"])
        for one, other in zip(ours.files, theirs.files, strict=True):
            assert one.read_bytes() == other.read_bytes()


def test_a_run_without_recordings_says_what_to_do(tmp_path: Path) -> None:
    bare = write_run(tmp_path / "run", record_scenes=False).folder
    result = draw_figures(FigureOptions(run=bare, web=True))
    assert {figure.name for figure in result.drawn} == OF_RECORDS
    reasons = {item.name: item.why for item in result.skipped}
    assert set(reasons) == {*NAMES} - OF_RECORDS - {"ablation"}
    why = f"no recordings: {RunDirectory(bare).without_recordings()}"
    assert all(reason == why for name, reason in reasons.items() if name != "tolerance")
    assert result.out == bare / "figures"


def test_ablations_need_no_run(tmp_path: Path) -> None:
    views = ablation(tmp_path / "views", over_views())
    still = ablation(tmp_path / "still", [{"grid.scenes.views": 1}])
    result = draw_figures(
        FigureOptions(out=tmp_path / "out", only=("ablation",), ablations=(views, still))
    )
    assert result.run is None
    assert [figure.name for figure in result.drawn] == ["ablation-views"]
    (skipped,) = result.skipped
    assert skipped.name == "ablation-still"
    assert skipped.why.endswith("varies nothing: no axis has two steps")


def test_what_cannot_be_drawn_is_refused(run: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"--only fig2: there is no such figure; pass fig1, fig3,"):
        draw_figures(FigureOptions(run=run, only=("fig2",)))
    with pytest.raises(InputError, match="pass its folder as --ablation DIR"):
        draw_figures(FigureOptions(only=("ablation",)))
    with pytest.raises(InputError, match="holds no run; pass the folder"):
        draw_figures(FigureOptions(run=tmp_path))
    twins = tuple(ablation(tmp_path / part / "views", over_views()) for part in "ab")
    with pytest.raises(InputError, match="two ablations are named views"):
        draw_figures(
            FigureOptions(out=tmp_path / "out", only=("ablation",), ablations=twins, web=True)
        )
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"cannot write to .*file/out: .*; pass a writable --out"):
        draw_figures(FigureOptions(run=run, out=tmp_path / "file" / "out", only=("table3",)))


def test_a_damaged_recording_is_named(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "run").folder
    chosen = folder / "recordings" / "mug-0002.npz"
    chosen.write_bytes(chosen.read_bytes()[:100])
    with pytest.raises(InputError, match=r"mug-0002\.npz is damaged .*; delete it and resume"):
        draw_figures(FigureOptions(run=folder, only=("fig5",)))


def test_command_says_what_it_drew(run: Path, tmp_path: Path) -> None:
    arguments = [str(run), "--out", str(tmp_path), "--web"]
    arguments += ["--only", "table3", "--only", "tolerance"]
    said = CliRunner().invoke(app, arguments)
    assert said.exit_code == 0
    lines = said.stdout.splitlines()
    assert lines[0].startswith("table3: means over 11 scenes")
    assert lines[1:] == [
        "tolerance is left out: the run was scored at one tolerance alone",
        f"1 figure as PNG in {tmp_path}",
    ]
    machine = CliRunner().invoke(app, [*arguments, "--json"])
    found = json.loads(machine.stdout)
    assert [item["name"] for item in found["drawn"]] == ["table3"]
    assert found["drawn"][0]["files"] == [str(tmp_path / "table3.png")]
    assert found["skipped"][0]["name"] == "tolerance"
