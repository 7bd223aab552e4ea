"""`harness tune`: what the models' hyperparameters and recalibrations are by default, and why.

Objects come from the validation split, which neither networks learn from nor the benchmark holds.
Each model's hyperparameters minimise the mean log loss of the test points of all scenes, both test
sets alike: the marginal likelihood of the training points, which are easy, picks badly. Then a line
on the logit recalibrates each model on the same scenes.
"""

from __future__ import annotations

import copy
import json
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import tomli_w

from harness.config import Config, Override, check_test_sets, load_config
from harness.errors import InputError
from harness.native import binary_metrics
from harness.runs.atomic import DiskError, write_text
from harness.runs.manifest import core_count
from harness.scoring import log_loss
from harness.table.summary import MODEL_ORDER
from harness.tuning.platt import fit_platt
from harness.tuning.scenes import TuningScene, tuning_scenes, validation_folder
from harness.tuning.search import Parameter, Search, pattern_search

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping, Sequence
    from pathlib import Path

    import numpy.typing as npt

    Floats = npt.NDArray[np.float64]

DIGITS = 3
"""Significant digits of what is chosen: the loss tells no more."""

SPACES = {
    "classic_tuned": (
        Parameter("gp.classic_tuned.lengthscale_m", 0.002, 1.0),
        Parameter("gp.classic_tuned.outputscale", 0.05, 500.0),
    ),
    "metric_literal": (Parameter("metric.literal_lengthscale_m", 0.001, 1.0),),
    "metric": (
        Parameter("metric.lengthscale_m", 0.001, 0.5),
        Parameter("metric.outputscale", 0.01, 500.0),
        Parameter("metric.temperature", 0.1, 10.0),
    ),
}
"""What is searched for each model; the others have nothing to choose."""

EMBEDDING = Parameter("metric.embedding_lengthscale", 0.02, 20.0)
"""Searched too where the metric kernel compares embeddings."""


@dataclass(frozen=True)
class TuneOptions:
    """What a person chooses; None leaves a choice to the configuration.

    Attributes
    ----------
    work
        Folder of the meshes, and of what is found.
    split
        Split of the objects; the test split is for measuring alone.
    scenes
        Scenes of each class, each of an object of its own.
    seed
        Of the meshes and the scenes; another than the benchmark's, that no scene shares its draws.
    test_points
        Of each test set.
    models
        What to tune and recalibrate; all by default.
    config
        Configuration file: where the searches begin, and all that they leave alone.
    """

    work: Path
    split: str = "validation"
    scenes: int = 12
    seed: int = 1
    test_points: int = 300
    models: Sequence[str] = MODEL_ORDER
    config: Path | None = None


@dataclass(frozen=True)
class Step:
    """How far a stage has come.

    Attributes
    ----------
    done, total
        Scenes, or trials; no total where their number is not known before.
    text
        What the last one gave.
    """

    stage: str
    done: int
    total: int | None
    text: str


@dataclass(frozen=True)
class Calibration:
    """A model's recalibration, with log loss and calibration error before and after it."""

    slope: float
    intercept: float
    log_loss_before: float
    log_loss_after: float
    ece_before: float
    ece_after: float


@dataclass(frozen=True)
class Tuned:
    """What was chosen.

    Attributes
    ----------
    toml
        The chosen keys, as a configuration file takes them.
    searches, calibrations
        By model.
    lost
        Why each scene that could not be had is missing, by id.
    files
        What was written.
    seconds
        Wall time.
    """

    toml: str
    searches: Mapping[str, Search]
    calibrations: Mapping[str, Calibration]
    lost: Mapping[str, str]
    files: Sequence[Path]
    seconds: float


@dataclass
class _Study:
    """Scenes and the settings that they are asked with."""

    scenes: Sequence[TuningScene]
    settings: dict[str, Any]
    notify: Callable[[Step], None]
    chosen: dict[str, Any] = field(default_factory=dict)

    def search(self, model: str, space: Sequence[Parameter]) -> Search:
        """Find a model's hyperparameters and take them over."""
        count = 0

        def loss(values: tuple[float, ...]) -> float:
            nonlocal count
            count += 1
            settings = self._with(space, values)
            answers = self._ask(model, settings)
            losses = [
                _log_loss(probability, scene.truth)
                for probability, scene in zip(answers, self.scenes, strict=True)
            ]
            mean = float(np.mean(losses))
            tried = ", ".join(f"{value:.4g}" for value in values)
            self.notify(Step(f"tune {model}", count, None, f"({tried}): {mean:.4f}"))
            return mean

        found = pattern_search(
            loss, [_get(self.settings, item.key) for item in space], parameters=space
        )
        for item, value in zip(space, found.best.values, strict=True):
            self.choose(item.key, value)
        return found

    def recalibrate(self, model: str) -> Calibration:
        """Fit a model's recalibration to its raw probabilities and take it over."""
        parts = []
        for probability, scene in zip(self._ask(model, self.settings), self.scenes, strict=True):
            parts.append(probability)
            self.notify(Step(f"recalibrate {model}", len(parts), len(self.scenes), scene.scene_id))
        probability = np.concatenate(parts)
        truth = np.concatenate([scene.truth for scene in self.scenes])
        platt = fit_platt(probability, truth)
        for name in ("slope", "intercept"):
            self.choose(f"recalibration.{model}.{name}", getattr(platt, name))
        after = platt.apply(probability)
        return Calibration(
            slope=platt.slope,
            intercept=platt.intercept,
            log_loss_before=_log_loss(probability, truth),
            log_loss_after=_log_loss(after, truth),
            ece_before=_ece(probability, truth),
            ece_after=_ece(after, truth),
        )

    def choose(self, key: str, value: float) -> None:
        """Round a value and set it."""
        rounded = float(f"{value:.{DIGITS}g}")
        for table in (self.settings, self.chosen):
            _set(table, key, rounded)

    def _ask(self, model: str, settings: dict[str, Any]) -> Iterator[Floats]:
        """Answers of each scene, in order; several scenes at a time, for Rust frees the lock."""
        with ThreadPoolExecutor(core_count()) as pool:
            yield from pool.map(
                lambda scene: scene.probability(model=model, settings=settings), self.scenes
            )

    def _with(self, space: Sequence[Parameter], values: Sequence[float]) -> dict[str, Any]:
        settings = copy.deepcopy(self.settings)
        for item, value in zip(space, values, strict=True):
            _set(settings, item.key, value)
        return settings


def tune(options: TuneOptions, *, progress: Callable[[Step], None] | None = None) -> Tuned:
    """Choose hyperparameters and recalibrations, and write them beside the meshes.

    ``tuned.toml`` holds the chosen keys; ``tune.json`` every trial, the curve of each parameter
    through the best setting, and the recalibrations.

    Raises
    ------
    InputError
        Wrong options or configuration; a folder that cannot be written; no scene can be had.
    """
    start = time.monotonic()
    notify = progress or _unheard
    config = _configuration(options)
    try:
        options.work.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DiskError(
            f"cannot write to {options.work}: {error.strerror}; pass another --work"
        ) from None
    folder = validation_folder(
        options.work, config=config, split=options.split, count=options.scenes, seed=options.seed
    )
    lost: dict[str, str] = {}
    scenes: list[TuningScene] = []
    total = options.scenes * len(config.run.classes)
    for scene in tuning_scenes(
        config, folder=folder, test_points=options.test_points, lost=lost.__setitem__
    ):
        scenes.append(scene)
        notify(Step("simulate and map", len(scenes) + len(lost), total, scene.scene_id))
    if not scenes:
        raise InputError(f"no scene can be tuned on ({next(iter(lost.items()))}); change [scenes]")
    study = _Study(scenes, config.pipeline, notify)
    searches = {}
    for model in options.models:
        if space := _space(model, settings=config.pipeline):
            searches[model] = study.search(model, space)
    calibrations = {model: study.recalibrate(model) for model in options.models}
    toml = tomli_w.dumps({"pipeline": study.chosen})
    report = {
        "split": options.split,
        "seed": options.seed,
        "scenes": [scene.scene_id for scene in scenes],
        "lost": lost,
        "test_points": options.test_points,
        "config": config.model_dump(mode="json", exclude={"run": {"workers"}}),
        "searches": {
            model: _search_report(found, _space(model, settings=config.pipeline))
            for model, found in searches.items()
        },
        "recalibration": {model: asdict(item) for model, item in calibrations.items()},
        "chosen": study.chosen,
    }
    files = [options.work / "tuned.toml", options.work / "tune.json"]
    write_text(files[0], toml)
    write_text(files[1], json.dumps(report, indent=1) + "\n")
    return Tuned(
        toml=toml,
        searches=searches,
        calibrations=calibrations,
        lost=lost,
        files=files,
        seconds=time.monotonic() - start,
    )


def _unheard(step: Step) -> None:
    del step


def _configuration(options: TuneOptions) -> Config:
    unknown = [model for model in options.models if model not in MODEL_ORDER]
    if unknown:
        raise InputError(f"no model is named '{unknown[0]}'; use {', '.join(MODEL_ORDER)}")
    if options.split not in ("train", "validation"):
        raise InputError(
            f"--split {options.split}: choose on validation (or train); the test split is what "
            "results are measured on"
        )
    if options.test_points < 1:
        raise InputError(f"--test-points {options.test_points}: ask for 1 or more")
    config = load_config(
        options.config,
        overrides=(
            Override("run.scenes", options.scenes, "--scenes"),
            Override("run.seed", options.seed, "--seed"),
            Override("pipeline.gp.models", list(MODEL_ORDER), "--model"),
        ),
    )
    return check_test_sets(config)


def _space(model: str, *, settings: Mapping[str, Any]) -> tuple[Parameter, ...]:
    space = SPACES.get(model, ())
    if model == "metric" and _get(settings, "metric.kernel_input") == "xyz_embedding":
        return (*space, EMBEDDING)
    return space


def _search_report(found: Search, space: Sequence[Parameter]) -> dict[str, Any]:
    keys = [item.key for item in space]
    return {
        "parameters": keys,
        "best": {"values": found.best.values, "log_loss": found.best.loss},
        "curves": {
            key: [[trial.values[index], trial.loss] for trial in found.curve(index)]
            for index, key in enumerate(keys)
        },
        "trials": [[*trial.values, trial.loss] for trial in found.trials],
    }


def _log_loss(probability: Floats, truth: npt.NDArray[np.bool_]) -> float:
    loss = log_loss(probability, truth)
    if loss is None:
        raise InputError("a scene has no test point; ask for 1 or more with --test-points")
    return loss


def _ece(probability: Floats, truth: npt.NDArray[np.bool_]) -> float:
    found = binary_metrics(predicted=probability > 0.5, truth=truth, probability=probability)
    return float(found["ece"] or 0.0)


def _get(settings: Mapping[str, Any], key: str) -> Any:
    value: Any = settings
    for name in key.split("."):
        value = value[name]
    return value


def _set(settings: dict[str, Any], key: str, value: float) -> None:
    *tables, name = key.split(".")
    for table in tables:
        settings = settings.setdefault(table, {})
    settings[name] = value
