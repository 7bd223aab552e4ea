"""What an ablation varies: a TOML file that spans a grid of configurations.

::

    about = "What a second and a third view are worth."

    [base.run]  # any of a configuration's tables, below [base]
    scenes = 16

    [grid]  # an axis each: a key of the configuration, and its values
    scenes.views = [1, 2, 3, 4, 5]

    [choices.completion.none]  # an axis whose named steps change several keys
    protocol.test_sets = ["box"]
    [choices.completion.cloud]
    protocol.test_sets = ["completed"]
    pipeline.completer = "cloud"

The cells are all combinations, the first axis changing slowest. The first cell is what the others
are compared with.
"""

from __future__ import annotations

import copy
import itertools
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from harness.config import (
    Config,
    Override,
    PipelineCheck,
    check_test_sets,
    config_of,
    read_toml,
)
from harness.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping, Sequence

MOST_CELLS = 2000
"""A grid of more is a slip of the pen."""

_TABLES = ("base", "grid", "choices")
_RECORD = Override("run.record", "nothing", "run.record")

Label = str | int | float | bool


@dataclass(frozen=True)
class Step:
    """A place on an axis: how it reads, and the keys that it sets."""

    label: Label
    settings: Mapping[str, Any]


@dataclass(frozen=True)
class Axis:
    """What is varied: a dotted key of the configuration, or the name of a choice."""

    name: str
    steps: tuple[Step, ...]


@dataclass(frozen=True)
class Cell:
    """A configuration of the grid.

    Attributes
    ----------
    index
        Its place among the cells.
    labels
        Its step on each axis, by the axis' name.
    """

    index: int
    labels: Mapping[str, Label]
    config: Config

    def __str__(self) -> str:
        return ", ".join(f"{short_name(axis)} {label}" for axis, label in self.labels.items())


@dataclass(frozen=True)
class AblationSpec:
    """A grid of configurations.

    Attributes
    ----------
    source
        The file.
    about
        What the ablation asks.
    base
        Tables of the configuration that all cells share.
    axes
        What is varied.
    """

    source: Path
    about: str
    base: Mapping[str, Any]
    axes: tuple[Axis, ...]

    def cells(
        self,
        *,
        overrides: tuple[Override, ...] = (),
        check_pipeline: PipelineCheck | None = None,
    ) -> list[Cell]:
        """Make every cell's configuration.

        Parameters
        ----------
        overrides
            Values of the command line, which take the place of the base's.
        check_pipeline
            As for `harness.config.load_config`.

        Raises
        ------
        InputError
            A key that no configuration has, or a value that it refuses; the cell is named.
        """
        _check_apart(self.axes, overrides, source=str(self.source))
        cells = []
        for index, steps in enumerate(itertools.product(*(axis.steps for axis in self.axes))):
            labels = {axis.name: step.label for axis, step in zip(self.axes, steps, strict=True)}
            table = copy.deepcopy(dict(self.base))
            if "record" not in table.setdefault("run", {}):
                set_key(table, _RECORD.key, _RECORD.value, source=str(self.source))
            for step in steps:
                for key, value in step.settings.items():
                    set_key(table, key, value, source=str(self.source))
            named = ", ".join(f"{axis} = {label!r}" for axis, label in labels.items())
            source = f"{self.source} ({named})" if named else str(self.source)
            config = config_of(
                table,
                source=source,
                folder=self.source.resolve().parent,
                overrides=overrides,
                check_pipeline=check_pipeline,
            )
            try:
                cells.append(Cell(index, labels, check_test_sets(config)))
            except InputError as error:
                raise InputError(f"{source}: {error}") from None
        return cells


def ready_grids() -> dict[str, str]:
    """List the grids that come with the project: what each asks, by its name."""
    folder = resources.files("harness.ablation") / "grids"
    paths = sorted((Path(str(path)) for path in folder.iterdir()), key=lambda path: path.stem)
    return {path.stem: str(read_toml(path).get("about", "")) for path in paths}


def find_spec(asked: str) -> Path:
    """Find a grid's file: a path, or the name of one that comes with the project.

    Raises
    ------
    InputError
        There is no such file or name.
    """
    path = Path(asked)
    if path.is_file():
        return path
    ready = Path(str(resources.files("harness.ablation") / "grids" / f"{asked}.toml"))
    if ready.is_file() and ready.stem == asked:
        return ready
    raise InputError(
        f"{asked}: no such file, and no ready grid of that name "
        f"(there are: {', '.join(ready_grids())})"
    )


def read_spec(path: Path) -> AblationSpec:
    """Read an ablation's file.

    Raises
    ------
    InputError
        It cannot be read, or spans no grid.
    """
    table = read_toml(path)
    about = table.pop("about", "")
    if odd := sorted(table.keys() - set(_TABLES)):
        raise InputError(
            f"{path}: unknown table '{odd[0]}'; an ablation has [base], [grid] and [choices]"
        )
    for name in _TABLES:
        if not isinstance(table.get(name, {}), dict):
            raise InputError(f"{path}: {name} should be a table; write [{name}] and its keys below")
    for section, value in table.get("base", {}).items():
        if not isinstance(value, dict):
            raise InputError(
                f"{path}: base.{section} = {value!r}: should be a table; write [base.{section}]"
            )
    axes = (
        *(_grid_axis(key, values, path) for key, values in _flatten(table.get("grid", {}))),
        *(_choice_axis(name, steps, path) for name, steps in table.get("choices", {}).items()),
    )
    count = 1
    for axis in axes:
        count *= len(axis.steps)
    if count > MOST_CELLS:
        raise InputError(f"{path} spans {count} cells; {MOST_CELLS} at most: split it")
    return AblationSpec(source=path, about=str(about), base=table.get("base", {}), axes=axes)


def set_key(table: dict[str, Any], key: str, value: Any, *, source: str) -> None:
    """Set a dotted key of nested tables.

    Raises
    ------
    InputError
        A part of the key that leads on is no table.
    """
    *sections, name = key.split(".")
    for section in sections:
        table = table.setdefault(section, {})
        if not isinstance(table, dict):
            raise InputError(f"{source}: key '{key}' leads through '{section}', which is no table")
    table[name] = copy.deepcopy(value)


def short_name(axis: str) -> str:
    """Shorten a dotted key to its last part, for people."""
    return axis.rpartition(".")[2].replace("_", " ")


def _grid_axis(key: str, values: Any, path: Path) -> Axis:
    if not isinstance(values, list) or not values:
        raise InputError(f"{path}: [grid] {key} = {values!r}: give a list of at least one value")
    steps = tuple(Step(_label(value), {key: value}) for value in values)
    return _checked(Axis(key, steps), path)


def _choice_axis(name: str, steps: Any, path: Path) -> Axis:
    if not isinstance(steps, dict) or not steps or not all(map(_is_table, steps.values())):
        raise InputError(
            f"{path}: [choices.{name}] should hold a table for each step, such as "
            f"[choices.{name}.off]"
        )
    made = (Step(label, dict(_flatten(step))) for label, step in steps.items())
    return _checked(Axis(name, tuple(made)), path)


def _is_table(value: object) -> bool:
    return isinstance(value, dict)


def _check_apart(axes: Sequence[Axis], overrides: Sequence[Override], *, source: str) -> None:
    """Refuse two that set one key, or a key within another's: one would lie about its cells."""
    setters = [(axis.name, {key for step in axis.steps for key in step.settings}) for axis in axes]
    setters += [(override.option, {override.key}) for override in overrides]
    for (first, ours), (second, theirs) in itertools.combinations(setters, 2):
        for key, other in itertools.product(sorted(ours), sorted(theirs)):
            if f"{key}.".startswith(f"{other}.") or f"{other}.".startswith(f"{key}."):
                raise InputError(
                    f"{source}: {first} and {second} both set {min(key, other, key=len)}; "
                    "leave it to one of them"
                )


def _checked(axis: Axis, path: Path) -> Axis:
    labels = [step.label for step in axis.steps]
    if twice := next((label for label in labels if labels.count(label) > 1), None):
        raise InputError(f"{path}: {axis.name} has {twice!r} twice; list each value once")
    return axis


def _label(value: Any) -> Label:
    if isinstance(value, str | int | float):
        return value
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)


def _flatten(table: Mapping[str, Any], *, prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in table.items():
        if isinstance(value, dict):
            yield from _flatten(value, prefix=f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value


def axis_values(cells: Sequence[Cell], axis: str) -> list[Label]:
    """List an axis' labels, one per cell: all text unless all are numbers."""
    labels = [cell.labels[axis] for cell in cells]
    numbers = all(
        isinstance(label, int | float) and not isinstance(label, bool) for label in labels
    )
    return labels if numbers else [str(label) for label in labels]
