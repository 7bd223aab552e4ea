"""`harness tune` on scenes whose best settings are known, and on small real ones."""

from __future__ import annotations

import json
import math
import tomllib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from harness.config import load_config
from harness.errors import InputError
from harness.scoring import log_loss
from harness.tuning import run as tuning
from harness.tuning.platt import Platt
from harness.tuning.run import Step, TuneOptions, tune
from harness.tuning.scenes import tuning_scenes, validation_folder

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator
    from pathlib import Path

    from harness.config import Config

POINTS = 4000
BEST = {
    "gp.classic_tuned.lengthscale_m": 0.03,
    "gp.classic_tuned.outputscale": 9.0,
    "metric.temperature": 2.0,
    "metric.lengthscale_m": 0.02,
    "metric.outputscale": 3.0,
    "metric.literal_lengthscale_m": 0.05,
    "metric.embedding_lengthscale": 0.7,
}


@dataclass(frozen=True)
class FakeScene:
    """Probabilities that are the better the closer a model's settings are to `BEST`."""

    scene_id: str
    seed: int
    keys: dict[str, list[str]]

    @property
    def truth(self) -> np.ndarray:
        return np.random.default_rng(self.seed).random(POINTS) < 0.4

    def probability(self, *, model: str, settings: dict[str, Any]) -> np.ndarray:
        off = sum(math.log(tuning._get(settings, key) / BEST[key]) ** 2 for key in self.keys[model])
        sure = 3.0 / (1.0 + off)
        noise = np.random.default_rng(self.seed + 1).normal(size=POINTS)
        return np.asarray(1 / (1 + np.exp(-(sure * (2.0 * self.truth - 1.0) + noise))))


def fake_scenes(monkeypatch: pytest.MonkeyPatch, *, lost: int = 0) -> None:
    def scenes(
        config: Config, *, folder: Path, test_points: int, lost: Callable[[str, str], None]
    ) -> Iterator[FakeScene]:
        assert folder.is_dir()
        assert test_points == 300
        keys = {
            model: [item.key for item in tuning._space(model, settings=config.pipeline)]
            for model in config.pipeline["gp"]["models"]
        }
        for number in range(config.run.scenes):
            if number < count:
                lost(f"mug-{number:04d}", "out of reach")
            else:
                yield FakeScene(f"mug-{number:04d}", number, keys)

    def folder(work: Path, **_: object) -> Path:
        return work

    count = lost
    monkeypatch.setattr(tuning, "tuning_scenes", scenes)
    monkeypatch.setattr(tuning, "validation_folder", folder)


def test_known_hyperparameters_are_found_and_written(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    fake_scenes(monkeypatch, lost=1)
    steps: list[Step] = []
    found = tune(TuneOptions(work=tmp_path / "work", scenes=3), progress=steps.append)
    table = tomllib.loads((tmp_path / "work" / "tuned.toml").read_text(encoding="utf-8"))
    assert found.toml == (tmp_path / "work" / "tuned.toml").read_text(encoding="utf-8")
    for key, best in BEST.items():
        if key != "metric.embedding_lengthscale":
            chosen = tuning._get(table["pipeline"], key)
            assert chosen == pytest.approx(best, rel=0.05)
            assert chosen == float(f"{chosen:.3g}")
    assert list(found.calibrations) == list(table["pipeline"]["recalibration"])
    assert found.lost == {"mug-0000": "out of reach"}
    # What was chosen is what a configuration takes.
    assert (
        load_config(tmp_path / "work" / "tuned.toml").pipeline["metric"]["temperature"]
        == (table["pipeline"]["metric"]["temperature"])
    )
    report = json.loads((tmp_path / "work" / "tune.json").read_text(encoding="utf-8"))
    assert report["scenes"] == ["mug-0001", "mug-0002"]
    search = report["searches"]["metric"]
    assert search["best"]["log_loss"] == min(trial[-1] for trial in search["trials"])
    for curve in search["curves"].values():
        assert len(curve) >= 3
    stages = list(dict.fromkeys(step.stage for step in steps))
    assert stages[:3] == ["simulate and map", "tune classic_tuned", "tune metric_literal"]
    assert stages[-1] == "recalibrate nearest"


def test_recalibration_sees_the_chosen_settings(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    fake_scenes(monkeypatch)
    found = tune(TuneOptions(work=tmp_path, scenes=2, models=("metric",)))
    item = found.calibrations["metric"]
    assert item.log_loss_after < item.log_loss_before
    assert item.ece_after < item.ece_before
    # sure = 3 at the best: logits +-3 with unit noise, whose likeliest line has slope 2 x 3 / 1.
    assert item.slope == pytest.approx(6.0, rel=0.1)
    assert set(tomllib.loads(found.toml)["pipeline"]) == {"metric", "recalibration"}


def test_the_same_arguments_give_the_same_files(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    fake_scenes(monkeypatch)
    files = [
        tune(TuneOptions(work=tmp_path / name, scenes=2, models=("classic_tuned",))).files
        for name in "ab"
    ]
    for first, second in zip(*files, strict=True):
        assert first.read_bytes() == second.read_bytes()


def test_an_embedding_kernel_has_a_lengthscale_of_its_own(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    fake_scenes(monkeypatch)
    config = tmp_path / "embedding.toml"
    config.write_text('[pipeline.metric]\nkernel_input = "xyz_embedding"\n', encoding="utf-8")
    found = tune(TuneOptions(work=tmp_path, scenes=1, models=("metric",), config=config))
    metric = tomllib.loads(found.toml)["pipeline"]["metric"]
    assert metric["embedding_lengthscale"] == pytest.approx(0.7, rel=0.05)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"split": "test"}, "--split test: choose on validation (or train); the test split is wha"),
        ({"models": ("metal",)}, "no model is named 'metal'; use classic, classic_tuned, metric_l"),
        ({"scenes": 0}, "--scenes 0: should be greater than or equal to 1"),
        ({"seed": -1}, "--seed -1: should be greater than or equal to 0"),
        ({"test_points": 0}, "--test-points 0: ask for 1 or more"),
    ],
)
def test_options_that_are_refused(tmp_path: Path, change: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError) as caught:
        tune(TuneOptions(**{"work": tmp_path / "work", **change}))
    assert message in str(caught.value)
    assert not (tmp_path / "work").exists()


def test_a_folder_that_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("mine", encoding="utf-8")
    with pytest.raises(InputError, match=r"cannot write to .*: Not a directory; pass another --w"):
        tune(TuneOptions(work=tmp_path / "file" / "work"))


def test_no_scene_at_all(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    fake_scenes(monkeypatch, lost=2)
    with pytest.raises(InputError, match=r"no scene can be tuned on .*out of reach"):
        tune(TuneOptions(work=tmp_path, scenes=2))


def test_a_real_scene_answers_to_its_settings(tmp_path: Path) -> None:
    text = (
        '[run]\nclasses = ["mug"]\nscenes = 1\n[scenes]\nviews = 1\nwidth = 160\nheight = 120\n'
        '[protocol]\ntest_sets = ["box", "perturbed"]\n'
        '[pipeline]\ncompleter = "none"\nsegmenter = "oracle"\n'
        "[pipeline.training]\npoints = 200\n"
    )
    (tmp_path / "small.toml").write_text(text, encoding="utf-8")
    config = load_config(tmp_path / "small.toml")
    folder = validation_folder(tmp_path, config=config, split="validation", count=1, seed=1)
    assert [path.name for path in (folder / "objects").iterdir()] == ["mug"]
    lost: dict[str, str] = {}
    (scene,) = tuning_scenes(config, folder=folder, test_points=50, lost=lost.__setitem__)
    assert (scene.category, len(scene.points), len(scene.truth)) == ("mug", 100, 100)
    losses = []
    for lengthscale_m in (0.02, 1e-4, 0.02):
        settings = json.loads(json.dumps(config.pipeline))
        settings["gp"]["classic_tuned"]["lengthscale_m"] = lengthscale_m
        probability = scene.probability(model="classic_tuned", settings=settings)
        losses.append(log_loss(probability, scene.truth))
    assert losses[0] == losses[2] != losses[1]
    assert lost == {}


def test_platt_of_the_identity_changes_nothing() -> None:
    p = np.linspace(0.01, 0.99, 9)
    assert Platt(1.0, 0.0).apply(p) == pytest.approx(p)
