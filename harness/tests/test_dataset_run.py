"""Datasets written, read back and run: the same records, and what foreign data gets instead."""

from __future__ import annotations

import json
import shutil
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import polars as pl
import pytest

from harness import cli
from harness.bench import BenchOptions, run_bench
from harness.config import Config, load_config
from harness.dataset_export import ExportOptions, run_export
from harness.dataset_plan import Plan, plan_dataset
from harness.dataset_run import DatasetOptions, DatasetResult, run_dataset, run_job
from harness.errors import InputError
from harness.native import OccupancyMap
from harness.results import show_run
from harness.runs.job import SceneJob, plan_jobs
from harness.runs.records import Record, read_records, read_timings
from harness.scene_run import evaluate_scene, simulate_job
from harness.stages.clock import StageClock
from sim_scenes import SceneError, load_object_set, open_bop, write_bop

if TYPE_CHECKING:
    from collections.abc import Callable

    from sim_scenes import Scene

SETTINGS = """
[run]
scenes = 1
seed = 3
workers = 1
[scenes]
views = 2
width = 160
height = 120
[protocol]
test_points = 60
test_sets = ["box", "perturbed"]
[pipeline]
segmenter = "oracle"
completer = "none"
[pipeline.training]
points = 80
[pipeline.gp]
fit_points = 30
fit_iterations = 3
models = ["classic"]
"""


@pytest.fixture(scope="module")
def settings(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("settings") / "small.toml"
    path.write_text(SETTINGS, encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def config(settings: Path) -> Config:
    return load_config(settings)


@pytest.fixture(scope="module")
def simulated(
    config: Config, tmp_path_factory: pytest.TempPathFactory
) -> tuple[Path, list[Record]]:
    """A dataset of a mug alone and a bowl among others, and the records of its scenes."""
    mug, bowl = plan_jobs(config, load_object_set(None).models)
    jobs = [mug, replace(bowl, cluttered=True)]
    scenes: list[Scene] = []
    records: list[Record] = []
    for job in jobs:
        scene = simulate_job(job, config)
        clock = StageClock(job.scene_id)
        records += evaluate_scene(scene, job=job, config=config, clock=clock).records
        scenes.append(replace(scene, name=job.scene_id))
    root = tmp_path_factory.mktemp("simulated") / "set"
    assert write_bop(scenes, root) == []
    return root, sorted(records, key=Record.key)


@pytest.fixture
def dataset(simulated: tuple[Path, list[Record]], tmp_path: Path) -> Path:
    return Path(shutil.copytree(simulated[0], tmp_path / "set"))


@pytest.fixture
def run(dataset: Path, settings: Path, tmp_path: Path) -> Callable[..., DatasetResult]:
    def run(**options: Any) -> DatasetResult:
        return run_dataset(
            DatasetOptions(dataset, **{"out": tmp_path / "run", "config": settings, **options})
        )

    return run


def planned(root: Path, config: Config, *, category: str | None = None) -> Plan:
    dataset = open_bop(root, category=category)
    return plan_dataset(dataset, config=config, category=category, maps=root / "maps")


def of_classes(config: Config, *classes: str) -> Config:
    return config.model_copy(update={"run": config.run.model_copy(update={"classes": classes})})


def edit(path: Path, change: Callable[[Any], object]) -> None:
    table = json.loads(path.read_text(encoding="utf-8"))
    change(table)
    path.write_text(json.dumps(table), encoding="utf-8")


def make_foreign(root: Path) -> None:
    """Strip what other writers do not write."""

    def strip(table: dict[str, Any]) -> None:
        for entry in table.values():
            for item in entry:
                del item["world_from_object"], item["instance_id"]

    for scene in (root / "test").iterdir():
        (scene / "scene_source.json").unlink()
        edit(scene / "scene_gt.json", strip)
        edit(
            scene / "scene_camera.json",
            lambda table: [entry.pop("world_from_camera") for entry in table.values()],
        )


def scene_folder(root: Path, number: int) -> Path:
    return root / "test" / f"{number:06d}"


# --- our own data ---


def test_a_dataset_gives_the_records_of_its_scenes(
    run: Callable[..., DatasetResult], simulated: tuple[Path, list[Record]]
) -> None:
    result = run()
    assert read_records(result.folder / "records.parquet") == simulated[1]
    assert len(simulated[1]) == 2 * 2 * 3
    assert (result.scored, result.failures, result.unscored) == (2, {}, [])
    assert show_run(result.folder) == result.table
    stages = [row.stage for row in read_timings(result.folder / "timings.parquet")]
    assert stages[: len(stages) // 2] == [
        *("read", "segment", "map", "truth", "training points", "fit", "posterior", "score"),
        *("record", "scene"),
    ]
    # Nothing is computed again: the scenes that the folder holds are taken from there.
    shutil.rmtree(result.folder / "logs")
    (result.folder / "records.parquet").unlink()
    assert run().table == result.table
    with pytest.raises(InputError, match=r"begun with other objects .*: category of what has none"):
        run(category="mug")


def test_what_export_writes_gives_the_bytes_of_the_benchmark(
    settings: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bowls = tmp_path / "bowls.toml"
    text = SETTINGS.replace("[run]", '[run]\nclasses = ["bowl"]')
    bowls.write_text(text.replace("[scenes]", "[scenes]\ncluttered = true"), encoding="utf-8")
    bench = run_bench(BenchOptions(config=bowls, out=tmp_path / "bench"))
    root = tmp_path / "set"
    arguments = ["export", "--config", str(settings), "--seed", "3", "--cluttered"]
    # The same bowl, for scenes do not depend on the classes beside their own.
    assert cli.main([*arguments, "--scenes", "1", "--out", str(root)]) == 0
    out, err = capsys.readouterr()
    assert out.startswith("2 scenes in ")
    assert out.endswith(f" s; written to {root}\n")
    assert err.startswith(f"dataset: {root}\n1/2 mug-0000 in ")
    assert load_config(root / "harness_config.toml").scenes.cluttered

    assert cli.main(["run", str(root), "--out", str(tmp_path / "run")]) == 0
    out, _ = capsys.readouterr()
    assert "Bowl SC (perturbed): 1 scene, 1 object" in out
    assert "2 targets scored, 0 failed; without scores: 0 scenes mapped, 0 skipped; in " in out
    again = read_records(tmp_path / "run" / "records.parquet")
    wanted = read_records(bench.folder / "records.parquet")
    assert [row for row in again if row.category == "bowl"] == wanted
    with pytest.raises(InputError, match="exists and is not an empty folder; name a new one"):
        run_export(ExportOptions(root, config=settings))


def test_scenes_that_cannot_be_simulated_are_named(
    settings: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(job: SceneJob, config: Config) -> Scene:
        if job.category in refused:
            raise SceneError("out of reach")
        return simulate_job(job, config)

    refused = ["bowl"]
    monkeypatch.setattr("harness.dataset_export.simulate_job", refuse)
    result = run_export(ExportOptions(tmp_path / "set", config=settings))
    assert (result.failures, result.all_failed) == ({"bowl-0000": "out of reach"}, False)
    text = (tmp_path / "set" / "harness_config.toml").read_text(encoding="utf-8")
    assert "# Not here, for it could not be simulated: bowl-0000: out of reach" in text
    refused.append("mug")
    assert run_export(ExportOptions(tmp_path / "none", config=settings)).all_failed
    assert [path.name for path in tmp_path.iterdir()] == ["set"]


@pytest.mark.parametrize(
    ("source", "scene_ids"),
    [
        ({"name": "../../evil"}, ["000000", "bowl-0000"]),
        ({"name": "bowl-0000"}, ["bowl-0000", "000001"]),
        ({"seed": -1}, ["mug-0000-01", "bowl-0000"]),
        ({"seed": 2**63}, ["mug-0000-01", "bowl-0000"]),
    ],
)
def test_names_and_seeds_of_a_file_are_not_trusted(
    dataset: Path, config: Config, source: dict[str, Any], scene_ids: list[str]
) -> None:
    edit(scene_folder(dataset, 0) / "scene_source.json", lambda table: table.update(source))
    jobs = planned(dataset, config).jobs
    assert [job.scene_id for job in jobs] == scene_ids
    assert all(0 <= job.seed < 2**63 for job in jobs)


# --- foreign data ---


def test_every_wanted_object_of_a_foreign_scene_is_a_target(
    dataset: Path, config: Config, run: Callable[..., DatasetResult]
) -> None:
    truth = list(open_bop(dataset).read_scene(1)[0].objects)
    make_foreign(dataset)
    every = planned(dataset, of_classes(config, *sorted({item.category for item in truth}))).jobs
    crowd = [job for job in every if job.number == 1]
    assert [(job.scene_id, job.category, job.object_name) for job in crowd] == [
        (f"000001-{item.instance_id:02d}", item.category, item.name) for item in truth
    ]
    assert len(truth) >= 2
    assert len({job.seed for job in every}) == len(every)

    chosen = [item for item in truth if item.category in ("mug", "bowl")]
    result = run()
    rows = read_records(result.folder / "records.parquet")
    assert {row.scene_id for row in rows} == {
        "000000-01",
        *(f"000001-{item.instance_id:02d}" for item in chosen),
    }
    assert {row.status for row in rows} == {"ok"}
    assert planned(dataset, of_classes(config, "camera")).reasons == {
        "000000": "no target of run.classes camera, no scores: the scene has mug",
        "000001": "no target of run.classes camera, no scores: the scene has "
        + ", ".join(sorted({item.category for item in truth})),
    }


def test_a_scene_without_truth_is_mapped_without_scores(
    dataset: Path, run: Callable[..., DatasetResult], simulated: tuple[Path, list[Record]]
) -> None:
    (scene_folder(dataset, 0) / "scene_gt.json").unlink()
    result = run(category="mug")
    assert read_records(result.folder / "records.parquet") == [
        row for row in simulated[1] if row.scene_id == "bowl-0000"
    ]
    (unscored,) = json.loads((result.folder / "unscored.json").read_text(encoding="utf-8"))
    assert unscored == {
        "scene_id": "mug-0000",
        "outcome": "mapped",
        "reason": "no truth, no scores: there is no scene_gt.json: nothing to score against",
    }
    assert (result.scored, result.count("mapped"), result.nothing_ran) == (1, 1, False)
    folder = result.folder / "maps" / "mug-0000"
    assert OccupancyMap.read(folder / "occupancy.ot").resolution_m == 0.005
    (item,) = json.loads((folder / "map.json").read_text(encoding="utf-8"))["objects"]
    assert (item["category"], item["predictions"]) == ("mug", "object_000001.parquet")
    table = pl.read_parquet(folder / item["predictions"])
    assert table.schema == {
        "model": pl.String,
        **dict.fromkeys("xyz", pl.Float64),
        "class": pl.String,
        **dict.fromkeys(("confidence", "score", "variance"), pl.Float64),
    }
    assert table.height == 60
    assert set(table["class"]) <= {"free", "mug"}
    assert table["confidence"].is_between(0, 1).all()
    centre = table.select(pl.col("x", "y", "z").mean()).row(0)
    assert centre == pytest.approx(item["centroid_world"], abs=0.05)


def test_bad_scenes_are_skipped_and_the_others_run(
    dataset: Path,
    run: Callable[..., DatasetResult],
    simulated: tuple[Path, list[Record]],
    settings: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    image = scene_folder(dataset, 1) / "rgb" / "000001.png"
    image.write_bytes(image.read_bytes()[:999])
    result = run()
    assert [row for row in simulated[1] if row.scene_id == "mug-0000"] == read_records(
        result.folder / "records.parquet"
    )
    (unscored,) = result.unscored
    assert (unscored.scene_id, unscored.outcome) == ("000001", "skipped")
    assert unscored.reason.startswith(f"{image}: is not a readable image (")

    shutil.rmtree(scene_folder(dataset, 0) / "mask_visib")
    out = settings.parent / "skipped"
    code = cli.main(["run", str(dataset), "--config", str(settings), "--out", str(out)])
    assert code == 1
    printed, err = capsys.readouterr()
    assert printed.startswith(
        "0 targets scored, 0 failed; without scores: 0 scenes mapped, 2 skipped; in "
    )
    assert (
        'mug-0000 skipped: segmenter = "oracle" needs masks of known category: '
        "there is no folder mask_visib: which pixels are an object's is not known\n"
    ) in err
    assert f"000001 skipped: {image}: is not a readable image" in err


def test_what_is_missing_is_said(dataset: Path, config: Config) -> None:
    folder = scene_folder(dataset, 1)
    cameras = folder / "scene_camera.json"
    cameras.rename(folder / "elsewhere")
    plan = planned(dataset, config)
    assert plan.reasons == {"000001": f"{cameras}: cannot be read (No such file or directory)"}
    assert [job.scene_id for job in plan.jobs] == ["mug-0000"]
    (folder / "elsewhere").rename(cameras)

    (folder / "scene_gt.json").rename(folder / "elsewhere")
    plan = planned(dataset, config)
    assert plan.reasons == {
        "bowl-0000": 'segmenter = "oracle" needs masks of known category: '
        "there are masks, but nothing says of which category their objects are; "
        "there is no scene_gt.json: nothing to score against"
        "; say what its masks show with --category, to map it"
    }
    assert [job.scene_id for job in plan.jobs] == ["mug-0000"]
    (folder / "elsewhere").rename(folder / "scene_gt.json")

    for path in (dataset / "models").glob("*.ply"):
        path.unlink()
    plan = planned(dataset, config)
    assert plan.reasons["mug-0000"] == (
        "no truth, no scores: object 1 is not scored: obj_000001.ply is missing"
    )
    assert [(job.scene_id, job.instance_id) for job in plan.jobs] == [
        ("mug-0000", None),
        ("bowl-0000", None),
    ]
    shutil.rmtree(dataset / "models")
    plan = planned(dataset, config)
    assert plan.jobs == []
    assert plan.reasons["mug-0000"] == (
        'segmenter = "oracle" needs masks of known category: '
        "object 1 is left out: the dataset has no models"
        "; say what its masks show with --category, to map it"
    )
    assert len(planned(dataset, config, category="mug").jobs) == 2


def test_folders_and_options_that_are_refused(
    dataset: Path, run: Callable[..., DatasetResult], tmp_path: Path
) -> None:
    with pytest.raises(InputError, match="category is 'cup'; choose one of bottle, bowl"):
        run(category="cup")
    with pytest.raises(InputError, match="--workers 0: should be greater than or equal to 1"):
        run(workers=0)
    assert not (tmp_path / "run").exists()
    shutil.rmtree(dataset / "test")
    with pytest.raises(InputError, match="holds no scene, that is no SPLIT/000000/scene_camera"):
        run()


def test_an_object_without_free_space_is_mapped_without_predictions(
    dataset: Path, config: Config
) -> None:
    (scene_folder(dataset, 0) / "scene_gt.json").unlink()
    changed = {"segmenter": "oracle", "training": {"free_margin_m": 0.5}}
    wide = config.model_copy(update={"pipeline": changed})
    job = planned(dataset, wide, category="mug").jobs[0]
    assert run_job(job, wide).records == []
    folder = dataset / "maps" / "mug-0000"
    assert {path.name for path in folder.iterdir()} == {
        "occupancy.ot",
        "map.json",
        "completed_000001.ply",
    }
    (item,) = json.loads((folder / "map.json").read_text(encoding="utf-8"))["objects"]
    assert "free" in item["without_predictions"]


def test_a_map_that_cannot_be_written_fails_its_scene_alone(
    dataset: Path, run: Callable[..., DatasetResult], tmp_path: Path
) -> None:
    (scene_folder(dataset, 0) / "scene_gt.json").unlink()
    run(category="mug")
    (tmp_path / "run" / "scenes" / "mug-0000.json").unlink()
    shutil.rmtree(tmp_path / "run" / "maps")
    (tmp_path / "run" / "maps").write_text("mine", encoding="utf-8")
    result = run(category="mug")
    assert (result.scored, result.count("failed"), result.failures) == (1, 1, {})
    assert result.unscored[0].reason.startswith("NotADirectoryError: ")
