"""A run's configuration: one TOML file, every key documented with its default.

A misspelt key is refused with its nearest valid name, because a key that is silently ignored
makes a benchmark measure something else than its author believes. The ``[pipeline]`` table
belongs to the Rust pipeline, which checks it by the same rule.
"""

from __future__ import annotations

import difflib
import hashlib
import itertools
import json
import math
import os
import tomllib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from datetime import date, time
from pathlib import Path  # noqa: TC003 - pydantic reads annotations at run time
from typing import Annotated, Any, Literal, cast

import tomli_w
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from harness.errors import InputError

Category = Literal["bottle", "bowl", "camera", "can", "laptop", "mug"]
TestSet = Literal["box", "completed", "perturbed"]
PositiveFloat = Annotated[float, Field(gt=0, allow_inf_nan=False)]
PipelineCheck = Callable[[str], str]


UNREGARDED = {"workers", "record"}
"""Keys of ``[run]`` on which no record depends."""


class Section(BaseModel):
    """A table of the file: immutable, strictly typed, closed to unknown keys."""

    model_config = ConfigDict(frozen=True, strict=True, extra="forbid")


class RunSection(Section):
    """``[run]``: how many scenes, from which seed, on how many processes."""

    scenes: int = Field(default=16, ge=1, le=100_000, description="Scenes of each class.")
    seed: int = Field(
        default=0, ge=0, lt=2**63, description="Seed that every scene's seed derives from."
    )
    workers: int | None = Field(
        default=None,
        ge=1,
        description="Worker processes; by default one per core. No result depends on it.",
    )
    record: Literal["all", "nothing"] = Field(
        default="all",
        description=(
            "What is kept of each scene beside its scores, for figures, calibration, report and "
            "view: about 1.5 MB, or nothing. No result depends on it."
        ),
    )
    classes: tuple[Category, ...] = Field(
        default=("mug", "bowl"),
        min_length=1,
        strict=False,
        description="Classes of the target object.",
    )

    @model_validator(mode="after")
    def _classes_once(self) -> RunSection:
        if len(set(self.classes)) < len(self.classes):
            raise ValueError(f"classes {list(self.classes)} names a class twice; list each once")
        return self


class DepthNoiseSection(Section):
    """``[scenes.depth_noise]``: the parts of the D435's depth error, each with its switch."""

    axial: bool = Field(
        default=True, description="Gaussian error along the axis, growing with z squared."
    )
    quantisation: bool = Field(
        default=True, description="Disparity in steps of the sensor's sub-pixel."
    )
    edge_dropout: bool = Field(default=True, description="Pixels lost at depth edges.")
    grazing_dropout: bool = Field(default=True, description="Pixels lost at grazing angles.")
    min_range: bool = Field(default=True, description="Nothing nearer than the minimum range.")
    z16: bool = Field(default=True, description="Depth in steps of the 16-bit output's unit.")
    subpixel_px: float = Field(
        default=0.1,
        ge=0,
        allow_inf_nan=False,
        description="Standard deviation of the disparity, pixels: the scale of the axial error.",
    )


class ScenesSection(Section):
    """``[scenes]``: what is rendered."""

    objects: Path | None = Field(
        default=None,
        strict=False,
        description="Folder of meshes with a manifest.json; by default the set in assets/.",
    )
    views: int = Field(default=3, ge=1, le=24, description="Camera poses of a scene.")
    cluttered: bool = Field(
        default=False, description="2 to 5 objects of mixed categories in a scene."
    )
    width: int = Field(default=640, ge=64, le=4096, description="Image width, pixels.")
    height: int = Field(default=480, ge=64, le=4096, description="Image height, pixels.")
    depth_noise: DepthNoiseSection = DepthNoiseSection()


class ProtocolSection(Section):
    """``[protocol]``: test points, and what counts as on the mesh.

    Training points belong to the pipeline: ``[pipeline.training]``.
    """

    test_sets: tuple[TestSet, ...] = Field(
        default=("box", "completed"),
        min_length=1,
        strict=False,
        description=(
            "How test points come about: 'box', evenly in the target's true box; 'completed', on "
            "the shape that the pipeline's completer makes of it; 'perturbed', on a wrong instance "
            "of it, in place of a completion."
        ),
    )
    test_points: int = Field(
        default=1000,
        ge=1,
        description="Test points of each test set; a completion of fewer points gives all it has.",
    )
    use_spread: bool = Field(
        default=True,
        description=(
            "Whether the confidence in a completed point holds the completer's own, P(within 5 mm "
            "of the surface), which follows from the point's spread."
        ),
    )
    tolerances_m: tuple[PositiveFloat, ...] = Field(
        default=(0.0025, 0.005, 0.01),
        min_length=1,
        strict=False,
        description="Distances within which a point lies on the mesh, metres.",
    )
    reported_tolerance_m: PositiveFloat = Field(
        default=0.005, description="The one of tolerances_m that the main table reports, metres."
    )

    @model_validator(mode="after")
    def _test_sets_once(self) -> ProtocolSection:
        if len(set(self.test_sets)) < len(self.test_sets):
            raise ValueError(f"test_sets {list(self.test_sets)} names a set twice; list each once")
        return self

    @model_validator(mode="after")
    def _reported_is_swept(self) -> ProtocolSection:
        if len(set(self.tolerances_m)) < len(self.tolerances_m):
            raise ValueError(f"tolerances_m {list(self.tolerances_m)} names a distance twice")
        if self.reported_tolerance_m not in self.tolerances_m:
            raise ValueError(
                f"reported_tolerance_m {self.reported_tolerance_m} is not one of "
                f"tolerances_m {list(self.tolerances_m)}; add it there"
            )
        return self


class Config(Section):
    """A run's whole configuration."""

    run: RunSection = RunSection()
    scenes: ScenesSection = ScenesSection()
    protocol: ProtocolSection = ProtocolSection()
    pipeline: dict[str, Any] = Field(
        default_factory=dict,
        description="Passed to the Rust pipeline, which checks it; holds its defaults once loaded.",
    )

    def identity(self) -> dict[str, Any]:
        """All that the records depend on, by dotted key: all but `UNREGARDED` of ``[run]``."""
        flat = dict(_flatten(self.model_dump(mode="json", exclude={"run": UNREGARDED})))
        return {key: flat[key] for key in sorted(flat)}

    def short_hash(self) -> str:
        """Eight hexadecimal digits that name the configuration."""
        text = json.dumps(self.identity(), sort_keys=True)
        return hashlib.blake2b(text.encode(), digest_size=4).hexdigest()

    def to_toml(self) -> str:
        """Write the configuration as a file that `load_config` reads back, defaults written out."""
        return tomli_w.dumps(self.model_dump(mode="json", exclude_none=True))

    def pipeline_json(self) -> str:
        """Write the ``[pipeline]`` table as JSON, as the Rust pipeline reads it."""
        return json.dumps(self.pipeline, sort_keys=True)


@dataclass(frozen=True)
class Override:
    """A value from the command line that takes the place of a key of the file."""

    key: str
    value: Any
    option: str


def load_config(
    path: Path | None,
    *,
    overrides: tuple[Override, ...] = (),
    check_pipeline: PipelineCheck | None = None,
) -> Config:
    """Read a configuration file and lay the command line's values over it.

    Parameters
    ----------
    path
        TOML file; None takes every default. A relative ``scenes.objects`` in it counts from the
        file's own folder.
    overrides
        Values of the command line.
    check_pipeline
        Called with the ``[pipeline]`` table as JSON; returns it with every default written out,
        so that the configuration says what ran whatever later defaults are, and raises ValueError
        where it is wrong. By default the Rust pipeline's own check.

    Raises
    ------
    InputError
        The file cannot be read or parsed, a key is unknown, a value is out of range.
    """
    source = "the built-in defaults" if path is None else str(path)
    table = {} if path is None else read_toml(path)
    folder = None if path is None else path.resolve().parent
    return config_of(
        table, source=source, folder=folder, overrides=overrides, check_pipeline=check_pipeline
    )


def config_of(
    table: dict[str, Any],
    *,
    source: str,
    folder: Path | None,
    overrides: tuple[Override, ...] = (),
    check_pipeline: PipelineCheck | None = None,
) -> Config:
    """Make a configuration of a table; raises like `load_config`.

    Parameters
    ----------
    table
        The configuration's tables; the overrides are written into it.
    source
        Where it comes from, for messages.
    folder
        What a relative ``scenes.objects`` counts from.
    overrides, check_pipeline
        As for `load_config`.
    """
    misfits = itertools.chain(
        _misfits(table, model=Config, prefix=""),
        _beyond_json(table.get("pipeline", {}), key="pipeline"),
    )
    if misfit := next(misfits, None):
        raise InputError(f"{source}: {misfit}")
    objects = table.get("scenes", {}).get("objects")
    if folder is not None and isinstance(objects, str):
        table["scenes"]["objects"] = os.path.normpath(folder / objects)
    for override in overrides:
        _set(table, key=override.key, value=override.value)
    try:
        config = Config.model_validate(table)
    except ValidationError as error:
        options = {override.key: override.option for override in overrides}
        raise InputError(_first_problem(error, source=source, options=options)) from None
    try:
        whole = (check_pipeline or _rust_pipeline_check)(config.pipeline_json())
    except (ValueError, OSError) as error:
        raise InputError(f"{source}: [pipeline] {error}") from None
    return config.model_copy(update={"pipeline": json.loads(whole)})


def check_test_sets(config: Config) -> Config:
    """Return a configuration whose test sets its pipeline can make.

    Raises
    ------
    InputError
        The completed set is asked for, and nothing completes.
    """
    if "completed" in config.protocol.test_sets and config.pipeline.get("completer") == "none":
        raise InputError(
            "protocol.test_sets has 'completed' but pipeline.completer is 'none'; name a "
            "completer, or take 'completed' out of the test sets"
        )
    return config


def differing_values(*, ours: Config, theirs: Config) -> list[tuple[str, Any, Any]]:
    """Keys whose values differ and change the records, with our value and theirs."""
    mine, other = ours.identity(), theirs.identity()
    return [
        (key, mine.get(key, "unset"), other.get(key, "unset"))
        for key in sorted(mine.keys() | other.keys())
        if mine.get(key) != other.get(key)
    ]


def differing_keys(*, ours: Config, theirs: Config) -> list[str]:
    """Keys whose values differ and change the records, in words for one who asks with ours."""
    return [
        f"{key} ({there} there, {asked} asked)"
        for key, asked, there in differing_values(ours=ours, theirs=theirs)
    ]


def _rust_pipeline_check(table_json: str) -> str:
    try:
        from harness.native import check_pipeline_config
    except ImportError as error:
        raise InputError(
            f"the compiled extension does not load ({error}); build it with `make setup`"
        ) from error
    return check_pipeline_config(table_json)


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file.

    Raises
    ------
    InputError
        It cannot be read or parsed.
    """
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"cannot read the configuration {path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise InputError(f"{path} is not UTF-8 text; save it as UTF-8") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path} is not valid TOML: {error}") from None


def _misfits(table: Mapping[str, Any], *, model: type[BaseModel], prefix: str) -> Iterator[str]:
    """Complaints about keys that no section has and sections that are none, in the file's order."""
    for key, value in table.items():
        inner = f"{prefix}.{key}" if prefix else key
        if key not in model.model_fields:
            valid = list(model.model_fields)
            place = f"in [{prefix}]" if prefix else "at the top level"
            near = difflib.get_close_matches(key, valid, n=1, cutoff=0.0)[0]
            yield f"unknown key '{key}' {place}; nearest is '{near}' (valid: {', '.join(valid)})"
            continue
        section = model.model_fields[key].annotation
        is_section = isinstance(section, type) and issubclass(section, BaseModel)
        if (is_section or key == "pipeline") and not isinstance(value, dict):
            yield f"{inner} = {value!r}: should be a table; write [{inner}] and its keys below"
        elif is_section:
            yield from _misfits(value, model=cast("type[BaseModel]", section), prefix=inner)


def _beyond_json(value: object, *, key: str) -> Iterator[str]:
    """Complaints about values that TOML has and JSON, which the pipeline reads, has not."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from _beyond_json(inner, key=f"{key}.{name}")
    elif isinstance(value, list):
        for index, inner in enumerate(value):
            yield from _beyond_json(inner, key=f"{key}.{index}")
    elif isinstance(value, float) and not math.isfinite(value):
        yield f"{key} = {value}: should be a finite number"
    elif isinstance(value, date | time):
        yield f"{key} = {value}: is a date or a time, and no setting is one"


def _first_problem(error: ValidationError, *, source: str, options: Mapping[str, str]) -> str:
    """One line on the first value that does not validate."""
    problem = error.errors(include_url=False)[0]
    key = ".".join(str(part) for part in problem["loc"])
    message = problem["msg"].removeprefix("Value error, ").removeprefix("Input ")
    if problem["type"] == "value_error":
        return f"{source}: [{key}] {message}"
    given = problem["input"]
    if key in options:
        return f"{options[key]} {given}: {message}"
    return f"{source}: {key} = {given!r}: {message}"


def _set(table: dict[str, Any], *, key: str, value: Any) -> None:
    *sections, name = key.split(".")
    for section in sections:
        table = table.setdefault(section, {})
    table[name] = value


def _flatten(table: Mapping[str, Any], *, prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in table.items():
        if isinstance(value, dict):
            yield from _flatten(value, prefix=f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value
