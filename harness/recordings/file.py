"""Recordings as files: NumPy's ``.npz``, images in it as PNG, what is no array as JSON.

The same recording gives the same bytes. Nothing is unpickled.
"""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import asdict, fields
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import numpy.typing as npt
from PIL import Image
from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    FiniteFloat,
    NonNegativeInt,
    ValidationError,
)

from harness.config import Category  # noqa: TC001 - pydantic reads annotations at run time
from harness.errors import InputError
from harness.native import CLASS_NAMES
from harness.recordings.recording import (
    MappedCloud,
    ModelAnswers,
    RecordedDetection,
    RecordedView,
    RecordedVoxels,
    Recording,
    TestSetPart,
    TrackedState,
    TrueObject,
)

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence
    from pathlib import Path

FORMAT = 1
"""Counts up with every change of what a file holds."""

DEPTH_UNIT_M = 1e-4
MOST_PIXELS = 4096 * 4096
MOST_ENTRY_BYTES = 1 << 28
PNG_COMPRESSION = 3
"""Of 9: half as large again as the smallest, four times as fast."""

Array = npt.NDArray[Any]


class _DamageError(ValueError):
    """What is wrong with a file."""


def encode(recording: Recording) -> bytes:
    """Write a recording as the bytes of a file."""
    arrays: dict[str, Array] = {}
    for index, view in enumerate(recording.views):
        at = f"views.{index}."
        depth = np.nan_to_num(view.depth_m / DEPTH_UNIT_M)
        depth = np.where(depth > np.iinfo(np.uint16).max, 0, np.round(depth))
        arrays[at + "rgb"] = _to_png(view.rgb)
        arrays[at + "depth"] = _to_png(depth.astype(np.uint16))
        arrays[at + "true_ids"] = _to_png(view.true_ids)
        arrays[at + "found"] = _to_png(view.found)
        arrays[at + "intrinsics"] = view.intrinsics
        arrays[at + "world_from_camera"] = view.world_from_camera
        if view.joint_positions_rad is not None:
            arrays[at + "joints"] = view.joint_positions_rad
    for index, item in enumerate(recording.objects):
        arrays[f"objects.{index}.vertices"] = item.vertices_world
        arrays[f"objects.{index}.faces"] = item.faces
    for index, cloud in enumerate(recording.tracked):
        at = f"tracked.{index}."
        arrays[at + "observed"] = cloud.observed_world
        arrays[at + "completed"] = cloud.completed_world
        arrays[at + "spread"] = cloud.spread_m
    voxels = recording.voxels
    # Whole multiples of the voxel's edge take a fifth of the room.
    keys = np.round(voxels.centres_world.astype(np.float64) / voxels.size_m - 0.5)
    arrays["voxels.keys"] = keys.astype(np.int32)
    for name in ("rgb", "classes", "object_ids", "confidence", "first_view"):
        arrays["voxels." + name] = getattr(voxels, name)
    for name in _POINTS:
        arrays[name] = getattr(recording, name)
    for model, answers in recording.answers.items():
        for column in fields(ModelAnswers):
            arrays[f"answers.{model}.{column.name}"] = getattr(answers, column.name)
    meta = json.dumps(_describe(recording), allow_nan=False)
    arrays["meta"] = np.frombuffer(meta.encode(), dtype=np.uint8)
    file = io.BytesIO()
    np.savez_compressed(file, **{name: np.ascontiguousarray(a) for name, a in arrays.items()})  # type: ignore[arg-type]
    return file.getvalue()


def decode(data: bytes) -> Recording:
    """Read what `encode` wrote.

    Raises
    ------
    ValueError
        Bytes that are no whole recording of this format.
    """
    try:
        return _decode(data)
    except _DamageError:
        raise
    # What a damaged archive, image or text raises is not documented and varies.
    except Exception as error:
        raise _DamageError(f"{type(error).__name__}: {error}") from None


def read_recording(path: Path) -> Recording:
    """Read the recording of a scene.

    Raises
    ------
    InputError
        The file is missing or damaged.
    """
    try:
        return decode(path.read_bytes())
    except FileNotFoundError:
        raise InputError(
            f"{path} is missing: the run recorded no scenes; run it again with "
            '`[run] record = "all"`'
        ) from None
    except (OSError, ValueError) as error:
        raise InputError(
            f"{path} is damaged ({error}); delete it and resume the run with `harness bench --out`"
        ) from None


_POINTS = (
    "training_world",
    "training_classes",
    "test_world",
    "distances_m",
    "data_distance_m",
    "completer_confidence",
)


def _describe(recording: Recording) -> dict[str, Any]:
    """All that is no array."""
    return {
        "format": FORMAT,
        "scene_id": recording.scene_id,
        "category": recording.category,
        "seed": recording.seed,
        "segmenter": recording.segmenter,
        "completer": recording.completer,
        "views": [
            {
                "detections": [asdict(item) for item in view.detections],
                "tracked": [
                    asdict(item) | {"centroid_world": item.centroid_world.tolist()}
                    for item in view.tracked
                ],
            }
            for view in recording.views
        ],
        "objects": [
            {"instance_id": item.instance_id, "name": item.name, "category": item.category}
            for item in recording.objects
        ],
        "tracked": [
            {
                "id": item.id,
                "category": item.category,
                "score": item.score,
                "centroid_world": item.centroid_world.tolist(),
            }
            for item in recording.tracked
        ],
        "target_id": recording.target_id,
        "voxel_size_m": recording.voxels.size_m,
        "test_sets": [
            [item.completion, item.part.start, item.part.stop] for item in recording.test_sets
        ],
        "models": list(recording.answers),
    }


class _Part(BaseModel):
    """A part of the JSON; strict, for whoever reads it trusts its types."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)


Name = Annotated[str, Field(max_length=200)]
Centroid = Annotated[list[FiniteFloat], Field(min_length=3, max_length=3)]


class _Detection(_Part):
    category: Category
    score: FiniteFloat
    object_id: int | None


class _Tracked(_Part):
    id: int
    category: Category
    score: FiniteFloat
    centroid_world: Centroid


class _View(_Part):
    detections: list[_Detection]
    tracked: list[_Tracked]


class _Object(_Part):
    instance_id: int
    name: Name
    category: Category


class _Meta(_Part):
    """All that is no array, as `_describe` writes it."""

    format: int
    scene_id: Name
    category: Category
    seed: int
    segmenter: Name
    completer: Name
    views: list[_View]
    objects: Annotated[list[_Object], Field(min_length=1)]
    tracked: list[_Tracked]
    target_id: int | None
    voxel_size_m: Annotated[FiniteFloat, Field(gt=0)]
    test_sets: list[tuple[Name, NonNegativeInt, NonNegativeInt]]
    models: list[Name]


class _Arrays:
    """The arrays of a file; each is checked as it is taken."""

    def __init__(self, data: bytes) -> None:
        archive = zipfile.ZipFile(io.BytesIO(data))
        for entry in archive.infolist():
            if entry.file_size > MOST_ENTRY_BYTES:
                raise _DamageError(f"{entry.filename} claims {entry.file_size} bytes")
        self._file = np.load(io.BytesIO(data), allow_pickle=False)

    def __contains__(self, name: str) -> bool:
        return name in self._file

    def take(self, name: str, dtype: type[Any], shape: Sequence[int | None]) -> Array:
        """Take an array of a type and shape; None fits any length."""
        if name not in self._file:
            raise _DamageError(f"'{name}' is missing")
        array: Array = self._file[name]
        fits = len(array.shape) == len(shape) and all(
            wanted in (None, found) for wanted, found in zip(shape, array.shape, strict=True)
        )
        if array.dtype != np.dtype(dtype) or not fits:
            raise _DamageError(f"'{name}' is {array.dtype}{array.shape}")
        return array

    def classes(self, name: str, count: int) -> npt.NDArray[np.uint8]:
        """Take an index into `harness.native.CLASS_NAMES` for each of so many points."""
        array = self.take(name, np.uint8, (count,))
        if array.size and array.max() >= len(CLASS_NAMES):
            raise _DamageError(f"'{name}' holds class {array.max()}")
        return array

    def image(self, name: str, dtype: type[Any], size: tuple[int, int] | None = None) -> Array:
        """Take an image, of a given height and width unless they are None."""
        with Image.open(io.BytesIO(self.take(name, np.uint8, (None,)).tobytes())) as image:
            if image.width * image.height > MOST_PIXELS:
                raise _DamageError(f"'{name}' claims {image.width}x{image.height} pixels")
            array = np.asarray(image).astype(dtype)
        if size is not None and array.shape[:2] != size:
            raise _DamageError(f"'{name}' is {array.shape}, beside a view of {size}")
        return array


def _decode(data: bytes) -> Recording:
    arrays = _Arrays(data)
    meta = _meta(arrays)
    objects = tuple(_objects(arrays, meta.objects))
    test_world = arrays.take("test_world", np.float32, (None, 3))
    count = len(test_world)
    training_world = arrays.take("training_world", np.float32, (None, 3))
    return Recording(
        scene_id=meta.scene_id,
        category=meta.category,
        seed=meta.seed,
        segmenter=meta.segmenter,
        completer=meta.completer,
        views=tuple(_views(arrays, meta.views)),
        objects=objects,
        tracked=tuple(_tracked(arrays, meta.tracked)),
        target_id=meta.target_id,
        voxels=_voxels(arrays, size_m=meta.voxel_size_m),
        training_world=training_world,
        training_classes=arrays.classes("training_classes", len(training_world)),
        test_world=test_world,
        test_sets=tuple(
            TestSetPart(completion=name, part=slice(start, stop))
            for name, start, stop in meta.test_sets
        ),
        distances_m=arrays.take("distances_m", np.float64, (len(objects), count)),
        data_distance_m=arrays.take("data_distance_m", np.float64, (count,)),
        completer_confidence=arrays.take("completer_confidence", np.float64, (count,)),
        answers={model: _answers(arrays, model, count=count) for model in meta.models},
    )


def _meta(arrays: _Arrays) -> _Meta:
    """Read the JSON; another format is named before what is odd in it."""
    found: object = json.loads(arrays.take("meta", np.uint8, (None,)).tobytes())
    written = found.get("format") if isinstance(found, dict) else None
    if written != FORMAT:
        raise _DamageError(f"format {written}, this version reads {FORMAT}")
    try:
        # From text, where JSON's arrays are tuples too.
        meta = _Meta.model_validate_json(json.dumps(found))
    except ValidationError as error:
        problem = error.errors(include_url=False)[0]
        key = ".".join(str(part) for part in problem["loc"])
        raise _DamageError(f"'meta' has {key} = {problem['input']!r:.80}") from None
    upto = 0
    for name, start, stop in meta.test_sets:
        if start != upto or stop < start:
            raise _DamageError(f"'meta' has test points {start} to {stop} of set '{name}'")
        upto = stop
    return meta


def _views(arrays: _Arrays, described: Sequence[_View]) -> Iterator[RecordedView]:
    for index, about in enumerate(described):
        at = f"views.{index}."
        rgb = arrays.image(at + "rgb", np.uint8)
        size = (rgb.shape[0], rgb.shape[1])
        depth = arrays.image(at + "depth", np.uint16, size)
        measured = depth.astype(np.float32) * np.float32(DEPTH_UNIT_M)
        joints = at + "joints"
        yield RecordedView(
            rgb=rgb,
            depth_m=np.where(depth > 0, measured, np.float32(np.nan)),
            true_ids=arrays.image(at + "true_ids", np.uint16, size),
            found=arrays.image(at + "found", np.uint8, size),
            detections=tuple(RecordedDetection(**item.model_dump()) for item in about.detections),
            intrinsics=arrays.take(at + "intrinsics", np.float64, (4,)),
            world_from_camera=arrays.take(at + "world_from_camera", np.float64, (4, 4)),
            joint_positions_rad=(
                arrays.take(joints, np.float64, (None,)) if joints in arrays else None
            ),
            tracked=tuple(
                TrackedState(
                    **item.model_dump() | {"centroid_world": np.array(item.centroid_world)}
                )
                for item in about.tracked
            ),
        )


def _objects(arrays: _Arrays, described: Sequence[_Object]) -> Iterator[TrueObject]:
    for index, about in enumerate(described):
        at = f"objects.{index}."
        vertices = arrays.take(at + "vertices", np.float32, (None, 3))
        faces = arrays.take(at + "faces", np.int32, (None, 3))
        if faces.size and not 0 <= faces.min() <= faces.max() < len(vertices):
            raise _DamageError(f"'{at}faces' names a vertex that is not there")
        yield TrueObject(**about.model_dump(), vertices_world=vertices, faces=faces)


def _tracked(arrays: _Arrays, described: Sequence[_Tracked]) -> Iterator[MappedCloud]:
    for index, about in enumerate(described):
        at = f"tracked.{index}."
        completed = arrays.take(at + "completed", np.float32, (None, 3))
        yield MappedCloud(
            id=about.id,
            category=about.category,
            score=about.score,
            centroid_world=np.array(about.centroid_world),
            observed_world=arrays.take(at + "observed", np.float32, (None, 3)),
            completed_world=completed,
            spread_m=arrays.take(at + "spread", np.float32, (len(completed),)),
        )


def _voxels(arrays: _Arrays, *, size_m: float) -> RecordedVoxels:
    keys = arrays.take("voxels.keys", np.int32, (None, 3))
    count = len(keys)
    return RecordedVoxels(
        size_m=size_m,
        centres_world=((keys + 0.5) * size_m).astype(np.float32),
        rgb=arrays.take("voxels.rgb", np.uint8, (count, 3)),
        classes=arrays.classes("voxels.classes", count),
        object_ids=arrays.take("voxels.object_ids", np.uint32, (count,)),
        confidence=arrays.take("voxels.confidence", np.float32, (count,)),
        first_view=arrays.take("voxels.first_view", np.uint8, (count,)),
    )


def _answers(arrays: _Arrays, model: str, *, count: int) -> ModelAnswers:
    def column(name: str) -> Array:
        return arrays.take(f"answers.{model}.{name}", np.float64, (count,))

    return ModelAnswers(
        classes=arrays.classes(f"answers.{model}.classes", count),
        probability=column("probability"),
        recalibrated=column("recalibrated"),
        confidence=column("confidence"),
        score=column("score"),
        variance=column("variance"),
    )


def _to_png(image: Array) -> Array:
    file = io.BytesIO()
    Image.fromarray(image).save(file, format="PNG", compress_level=PNG_COMPRESSION)
    return np.frombuffer(file.getvalue(), dtype=np.uint8)
