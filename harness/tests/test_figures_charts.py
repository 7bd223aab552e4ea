"""Charts: numbers worked out by hand, and what is drawn of them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
import polars as pl
import pytest
from numpy.testing import assert_allclose

from harness.calibration import mean_risk, scene_risks
from harness.calibration.series import scene_points
from harness.errors import InputError
from harness.figures.charts import panel_blocks
from harness.figures.reliability import draw_reliability, pooled
from harness.figures.risk import draw_risk_coverage
from harness.figures.seed_table import COLUMN_ORDER, draw_seed_table
from harness.figures.source import BOX, NothingToDrawError, RunSource
from harness.figures.style import SEED, model_style, publication, write_web_figure
from harness.figures.sweep import (
    Sweep,
    draw_sweep,
    is_crowded,
    is_logarithmic,
    read_sweeps,
    step_means,
    sweep_panels,
    tolerance_sweep,
)
from harness.figures.thresholds import keep_above
from harness.tests.fake_html_report import job, recording, write_run

if TYPE_CHECKING:
    from pathlib import Path

BLOCK = recording(job("mug", 0))


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> RunSource:
    return RunSource.open(write_run(tmp_path_factory.mktemp("charts") / "run").folder)


def test_thresholds_keep_what_reaches_a_percentile() -> None:
    confidence = np.array([0.1, 0.2, 0.2, 0.9])
    true = np.array([False, True, False, True])
    everything = keep_above(confidence, true, percentile=0)
    assert everything.kept.all()
    assert everything.on_mesh == 0.5
    # Half of the points have at most 0.2; both that have it are kept.
    half = keep_above(confidence, true, percentile=50)
    assert half.threshold == 0.2
    assert half.kept.tolist() == [False, True, True, True]
    assert half.on_mesh == pytest.approx(2 / 3)
    last = keep_above(confidence, true, percentile=76)
    assert last.kept.tolist() == [False, False, False, True]
    assert keep_above(np.zeros(4), true, percentile=75).kept.all(), "ties stay together"


def test_panels_wrap_into_rows_of_like_length() -> None:
    assert panel_blocks(4) == [range(4)]
    assert panel_blocks(6) == [range(3), range(3, 6)]
    assert panel_blocks(9) == [range(3), range(3, 6), range(6, 9)]
    assert panel_blocks(5) == [range(3), range(3, 5)]


def test_risks_of_a_scene_by_hand() -> None:
    # The nearest model puts all eight points on the object with one confidence; half are wrong.
    points = scene_points(BLOCK, completion=BOX, model="nearest", tolerance_m=0.005)
    assert_allclose(scene_risks([points], "confidence"), 0.5)
    right = scene_points(BLOCK, completion=BOX, model="metric", tolerance_m=0.005)
    assert_allclose(scene_risks([right, right], "confidence"), np.zeros((2, 100)))
    # Without a variance there is no score of the seed's.
    steady = replace(BLOCK.answers["metric"], variance=np.zeros(16))
    without = replace(BLOCK, answers={"metric": steady})
    none = scene_points(without, completion=BOX, model="metric", tolerance_m=0.005)
    undefined = scene_risks([none], "normalised_score")
    assert np.isnan(undefined).all()
    assert np.isnan(mean_risk(undefined)).all()
    rows = np.array([[0.0, 0.2], [np.nan, np.nan], [0.2, 0.4]])
    assert_allclose(mean_risk(rows), [0.1, 0.3])


def test_reliability_is_of_all_scenes_points() -> None:
    points = scene_points(BLOCK, completion=BOX, model="metric", tolerance_m=0.005)
    found = pooled([points, points])
    assert found.counts.sum() == 16
    assert (found.counts[0], found.counts[-1]) == (8, 8)
    assert_allclose([found.mean_predicted[0], found.observed[0]], [0.05, 0.0])
    assert_allclose([found.mean_predicted[-1], found.observed[-1]], [0.95, 1.0])
    assert pooled([]).counts.sum() == 0


def xs(line: Any) -> npt.NDArray[np.float64]:
    return np.asarray(line.get_xdata(), dtype=np.float64)


def lines_of(axes: Any, colour: str) -> list[Any]:
    return [line for line in axes.lines if line.get_color() == colour]


def test_reliability_draws_the_bins_that_say_something(source: RunSource) -> None:
    with publication():
        figure, caption = draw_reliability(source)
    assert "bins of equal width" in caption
    diagram = figure.axes[0]
    assert diagram.get_title() == "mug, completed (cloud)"
    (line,) = lines_of(diagram, model_style("metric").colour)
    # Of six mugs' eight points half are near 5 %, half near 95 %: 24 each.
    assert_allclose(line.get_xydata(), [[5, 0], [95, 100]])
    bowls = next(axes for axes in figure.axes if axes.get_title() == "bowl, completed (cloud)")
    assert not lines_of(bowls, model_style("metric").colour), "bins of 16 points are not drawn"


def test_risk_draws_every_model_and_the_baselines(source: RunSource) -> None:
    with publication():
        figure, caption = draw_risk_coverage(source)
    assert caption.startswith("mean over 11 scenes")
    axes = figure.axes[1]
    assert axes.get_title() == "mug, points in the box"
    (line,) = lines_of(axes, model_style("nearest").colour)
    assert_allclose(line.get_ydata(), 50.0)
    assert len(axes.lines) == 3 + 2
    assert len(axes.collections) == 2, "two models have bands"


def test_seed_table_has_ours_and_the_seeds(source: RunSource) -> None:
    with publication():
        figure, _ = draw_seed_table(source)
    assert [axes.get_title() for axes in figure.axes] == [
        "precision",
        "accuracy",
        "TP",
        "TN",
        "FP",
        "FN",
    ]
    labels = [text.get_text() for text in figure.axes[0].get_yticklabels()]
    assert labels[:4] == [
        "mug, completed (cloud)",
        "classic, tuned",
        "metric",
        "nearest observation",
    ]
    precision = figure.axes[COLUMN_ORDER.index("precision")]
    seeds = [line for line in precision.lines if line.get_marker() == SEED.marker]
    # The seed's metric model in each of the four cells; it has no other that the run has.
    assert_allclose([xs(line)[0] for line in seeds], [0.659, 0.539, 0.447, 0.358])
    (interval, dot) = [
        line
        for line in lines_of(precision, model_style("metric").colour)
        if labels[int(line.get_ydata()[0])] == "metric" and line.get_ydata()[0] < 4
    ]
    # 0.90, 0.89 ... 0.85.
    assert_allclose(dot.get_xdata(), [0.875])
    low, high = interval.get_xdata()
    assert low < 0.875 < high
    shares = figure.axes[COLUMN_ORDER.index("tp")]
    ours = lines_of(shares, model_style("metric").colour)
    assert all(share == 3 / 8 for line in ours for share in line.get_xdata())


ROW = {
    "category": "mug",
    "completion": BOX,
    "model": "metric",
    "status": "ok",
    "cell": 0,
    "precision": 0.5,
    "accuracy": 0.5,
    "aurc": 0.1,
}


def ablation(folder: Path, rows: list[dict[str, Any]]) -> Path:
    """Write an ablation whose rows differ from `ROW` as told; each is of an object of its own."""
    folder.mkdir(parents=True)
    whole = [ROW | {"object_name": f"mug_{place}"} | row for place, row in enumerate(rows)]
    pl.DataFrame(whole, infer_schema_length=None).write_parquet(folder / "ablation.parquet")
    return folder


def over_views(views: tuple[int, ...] = (3, 1), objects: int = 6) -> list[dict[str, Any]]:
    return [
        {"cell": cell, "grid.scenes.views": count, "object_name": f"m{item}", "model": model}
        | {"precision": count / 4 + item / 100}
        for cell, count in enumerate(views)
        for item in range(objects)
        for model in ("metric", "classic")
    ]


def test_an_axis_of_numbers_is_in_order(tmp_path: Path) -> None:
    rows = over_views()
    rows.append(rows[0] | {"status": "failed", "precision": None})
    sweeps = read_sweeps(ablation(tmp_path / "a", rows))
    assert list(sweeps) == ["views"]
    sweep = sweeps["views"]
    assert (sweep.steps, sweep.label, sweep.held) == ([1, 3], "views", "")
    own = sweep.frame.filter(pl.col("model") == "metric")
    low, high = step_means(own, metric="precision", steps=sweep.steps, seed=0)
    assert low.count == 6
    assert low.mean == pytest.approx(0.275)
    assert high.mean == pytest.approx(0.775)
    assert high.low is not None
    assert high.low < 0.775


def test_the_other_axes_are_held_at_the_first_cells_step(tmp_path: Path) -> None:
    rows = [
        {"cell": 2 * a + b, "grid.pipeline.training.points": points, "grid.completion": name}
        | {"precision": points / 10_000 + b / 10}
        for a, points in enumerate((400, 7200))
        for b, name in enumerate(("off", "cloud"))
    ]
    sweeps = read_sweeps(ablation(tmp_path / "a", rows[::-1]))
    assert set(sweeps) == {"points", "completion"}
    points, names = sweeps["points"], sweeps["completion"]
    assert points.held == "completion off"
    assert points.label == "training points"
    assert points.frame["precision"].to_list() == [0.04, 0.72]
    assert (names.steps, names.held) == (["off", "cloud"], "points 400")
    assert_allclose(names.positions(), [0, 1])


def test_axes_of_one_last_name_go_by_their_whole_ones(tmp_path: Path) -> None:
    rows = [
        {"cell": cell, "grid.a.points": a, "grid.b.points": b}
        for cell, (a, b) in enumerate(((1, "y"), (2, "y"), (1, "x")))
    ]
    sweeps = read_sweeps(ablation(tmp_path / "a", rows))
    assert set(sweeps) == {"a.points", "b.points"}
    assert sweeps["b.points"].steps == ["y", "x"]


def test_units_are_those_of_print() -> None:
    frame = pl.DataFrame({"step": [0.005, 0.0025]})
    sweep = Sweep(key="pipeline.map.resolution_m", frame=frame)
    assert sweep.label == "resolution (mm)"
    assert_allclose(sweep.positions(), [2.5, 5.0])
    assert Sweep(key="protocol.reported_tolerance_m", frame=frame).label == "tolerance (mm)"
    assert Sweep(key="pipeline.map.association", frame=frame).label == "association"
    switch = Sweep(key="pipeline.completion.refine", frame=pl.DataFrame({"step": ["on", "off"]}))
    assert (switch.label, switch.steps) == ("refine", ["on", "off"])


def test_wide_axes_are_logarithmic() -> None:
    assert is_logarithmic(np.array([200.0, 7200.0]))
    assert not is_logarithmic(np.array([1.0, 5.0]))
    assert not is_logarithmic(np.array([0.0, 100.0])), "zero has no logarithm"


def test_crowded_names_are_told_from_those_that_fit() -> None:
    assert not is_crowded(np.array([0.0, 1.0, 2.0]), ["0", "1", "2"])
    assert is_crowded(np.array([1.0, 7.5, 10.0, 100.0]), ["1", "7.5", "10", "100"])
    assert is_crowded(np.arange(6.0), ["association"] * 6)


def test_panels_are_classes_and_test_sets_unless_the_axis_chooses_these(tmp_path: Path) -> None:
    both = [
        {"grid.scenes.views": views, "cell": views, "completion": completion, "category": category}
        for views in (1, 2)
        for completion in (BOX, "cloud")
        for category in ("mug", "bowl")
    ]
    sweep = read_sweeps(ablation(tmp_path / "a", both))["views"]
    titles = [title for title, _ in sweep_panels(sweep, classes=("mug", "bowl"))]
    assert titles == [
        "mug, completed (cloud)",
        "mug, points in the box",
        "bowl, completed (cloud)",
        "bowl, points in the box",
    ]
    chosen = [
        {"grid.completion": step, "cell": cell, "completion": completion}
        for cell, (step, completion) in enumerate((("off", BOX), ("on", "cloud")))
    ]
    sweep = read_sweeps(ablation(tmp_path / "b", chosen))["completion"]
    ((title, frame),) = sweep_panels(sweep, classes=())
    assert (title, len(frame)) == ("mug", 2)


def test_a_sweep_is_drawn_with_its_intervals(tmp_path: Path) -> None:
    sweep = read_sweeps(ablation(tmp_path / "a", over_views((1, 2, 3))))["views"]
    with publication():
        figure, caption = draw_sweep(sweep)
    precision = figure.axes[0]
    lines = lines_of(precision, model_style("metric").colour)
    assert_allclose(lines[0].get_ydata(), [0.275, 0.525, 0.775])
    assert len(lines) == 1 + 3, "a curve, and an interval at each step"
    assert caption.endswith("intervals over 6 objects; AURC: less is better")
    assert len(figure.axes) == 3
    bottom = figure.axes[2]
    assert [text.get_text() for text in bottom.get_xticklabels()] == ["1", "2", "3"]
    assert bottom.get_xlabel() == "views"


def test_names_are_no_formulas(tmp_path: Path) -> None:
    rows = [
        {"cell": cell, "grid.my_$x": name, "model": "my_$model", "completion": "a$b"}
        for cell, name in enumerate(("$\\frac", "b$"))
    ]
    (sweep,) = read_sweeps(ablation(tmp_path / "a", rows)).values()
    with publication():
        figure, _ = draw_sweep(sweep)
        write_web_figure(figure, tmp_path / "formulas")
    assert sweep.label == r"my \$x"


def test_a_runs_tolerances_are_a_sweep(source: RunSource) -> None:
    with pytest.raises(NothingToDrawError, match="scored at one tolerance alone"):
        tolerance_sweep(source)
    wide = [replace(record, tolerance_m=0.01) for record in source.records]
    both = RunSource(run=source.run, config=source.config, records=[*source.records, *wide])
    sweep = tolerance_sweep(both)
    assert (sweep.steps, sweep.label) == ([0.005, 0.01], "tolerance (mm)")
    assert_allclose(sweep.positions(), [5.0, 10.0])


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (None, r"a holds no ablation\.parquet; pass a folder that `harness ablate` wrote"),
        ([{"grid.scenes.views": 1, "accuracy": None}], None),
        (
            [{"grid.scenes.views": 1}, {"grid.scenes.views": None}],
            r"ablation\.parquet leaves 'grid\.scenes\.views' empty in a cell",
        ),
        ([{}], r"ablation\.parquet has no column 'grid\.KEY' for what was varied"),
    ],
)
def test_bad_ablations_are_refused(
    tmp_path: Path, rows: list[dict[str, Any]] | None, message: str | None
) -> None:
    folder = tmp_path / "a"
    if rows is None:
        folder.mkdir()
    else:
        ablation(folder, rows)
    if message is None:
        assert read_sweeps(folder) == {}, "an axis of one step is none"
    else:
        with pytest.raises(InputError, match=message):
            read_sweeps(folder)


def test_damaged_ablations_are_refused(tmp_path: Path) -> None:
    folder = ablation(tmp_path / "a", over_views())
    path = folder / "ablation.parquet"
    pl.read_parquet(path).drop("aurc").write_parquet(path)
    with pytest.raises(InputError, match=r"ablation\.parquet has no column 'aurc'"):
        read_sweeps(folder)
    path.write_bytes(path.read_bytes()[:-9])
    with pytest.raises(InputError, match=r"ablation\.parquet cannot be read .*`harness ablate`"):
        read_sweeps(folder)
