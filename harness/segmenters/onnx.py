"""Mask R-CNN as torchvision exports it to ONNX, run by onnxruntime.

A module of your own says which file, and what its labels mean to the pipeline::

    # my_masks.py
    from harness.segmenters.onnx import OnnxSegmenter

    find = OnnxSegmenter("maskrcnn_resnet50_fpn.onnx")

``segmenter = "python:my_masks.find"`` then works with it. The extra ``onnx`` brings onnxruntime.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from harness.native import CLASS_NAMES

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from harness.native import Floats

COCO_CATEGORIES: Mapping[int, str] = MappingProxyType(
    {44: "bottle", 47: "mug", 51: "bowl", 73: "laptop"}
)
"""Which of COCO's 91 labels, as torchvision numbers them, are categories of ours.

A cup is a mug; cameras and cans have no label.
"""

OUTPUTS = ("boxes", "labels", "scores", "masks")


@dataclass(frozen=True)
class Outputs:
    """What the network found, best first.

    Attributes
    ----------
    labels : (n,) int64
    scores : (n,) float32
    masks : (n, 1, h, w) float32
        Probability that a pixel belongs to the object.
    """

    labels: npt.NDArray[np.int64]
    scores: npt.NDArray[np.float32]
    masks: npt.NDArray[np.float32]


class OnnxSegmenter:
    """An ONNX Mask R-CNN as a segmenter.

    The network takes one image, float32 in [0, 1], (3, h, w) or (1, 3, h, w), and returns ``boxes``
    (n, 4), ``labels`` (n,) int64, ``scores`` (n,) and ``masks`` (n, 1, h, w): found by these names,
    or, where the export numbered them, by type and shape. Resizing and normalisation are part of
    it, as in torchvision's export. Boxes are not used.

    Parameters
    ----------
    path
        The ``.onnx`` file.
    categories
        The category of each label that is one of ours; detections of other labels are left out.
    least_score
        Detections of a lower score are left out.
    mask_threshold
        A pixel belongs to an object if its probability exceeds this.
    providers
        Where onnxruntime computes, in order of preference; None for the CPU.

    Raises
    ------
    ImportError
        onnxruntime is not installed.
    FileNotFoundError
        There is no such file.
    ValueError
        A file that is no ONNX model or takes no image, a category that does not exist, a number out
        of range, a provider that onnxruntime does not have here.
    """

    def __init__(
        self,
        path: str | Path,
        *,
        categories: Mapping[int, str] = COCO_CATEGORIES,
        least_score: float = 0.5,
        mask_threshold: float = 0.5,
        providers: Sequence[str] | None = None,
    ) -> None:
        self._path = Path(path)
        self._categories = _checked(categories)
        self._least_score = _share("least_score", least_score)
        self._mask_threshold = _share("mask_threshold", mask_threshold)
        self._session = _session(self._path, providers)
        self._input, self._rank = self._image_input()
        self._names = [output.name for output in self._session.get_outputs()]

    def __call__(
        self,
        *,
        rgb: npt.NDArray[np.uint8],
        depth_m: npt.NDArray[np.float32],  # noqa: ARG002
        intrinsics: tuple[float, float, float, float],  # noqa: ARG002
        world_from_camera: Floats,  # noqa: ARG002
    ) -> list[dict[str, Any]]:
        """Find the objects in an image: see `harness.native.SegmenterFunction`."""
        image = rgb.transpose(2, 0, 1).astype(np.float32, order="C") / np.float32(255)
        if self._rank == 4:
            image = image[None]
        found = self._outputs(image, (rgb.shape[0], rgb.shape[1]))
        detections: list[dict[str, Any]] = []
        for label, score, soft_mask in zip(found.labels, found.scores, found.masks, strict=True):
            category = self._categories.get(int(label))
            mask = soft_mask[0] > self._mask_threshold
            if category is None or score < self._least_score or not mask.any():
                continue
            detections.append({"mask": mask, "category": category, "score": float(score)})
        return detections

    def _image_input(self) -> tuple[str, int]:
        """Name and rank of the one input."""
        inputs = self._session.get_inputs()
        if len(inputs) != 1:
            names = ", ".join(item.name for item in inputs) or "none"
            raise ValueError(
                f"{self._path} has {len(inputs)} inputs ({names}); export it with one image"
            )
        [item] = inputs
        shape = tuple(item.shape)
        rank = len(shape)
        channels = shape[-3] if rank in {3, 4} else None
        fits = channels == 3 or isinstance(channels, str) or channels is None
        if item.type != "tensor(float)" or rank not in {3, 4} or not fits:
            raise ValueError(
                f"{self._path}: the input {item.name} is {item.type} of shape {_text(shape)}; a "
                "Mask R-CNN takes a float32 image of shape (3, h, w) or (1, 3, h, w)"
            )
        return item.name, rank

    def _outputs(self, image: npt.NDArray[np.float32], size: tuple[int, int]) -> Outputs:
        try:
            values = self._session.run(None, {self._input: image})
        except Exception as error:
            # onnxruntime's exceptions have no class of their own.
            raise ValueError(
                f"{self._path} fails on an image of shape {image.shape}: {_line(error)}; export it "
                "with dynamic axes, or use images of its size"
            ) from error
        arrays = dict(zip(self._names, values, strict=True))
        if not set(OUTPUTS) <= arrays.keys():
            arrays = self._by_shape(arrays)
        boxes, labels, scores, masks = (arrays[name] for name in OUTPUTS)
        count = len(labels)
        shapes = {
            "boxes": (boxes, (count, 4), "f"),
            "labels": (labels, (count,), "i"),
            "scores": (scores, (count,), "f"),
            "masks": (masks, (count, 1, *size), "f"),
        }
        for name, (array, shape, kind) in shapes.items():
            if array.shape != shape or array.dtype.kind != kind:
                wanted = "float" if kind == "f" else "integer"
                raise ValueError(
                    f"{self._path}: its {name} are {array.dtype} of shape {array.shape}; expected "
                    f"{wanted}s of shape {shape}, as torchvision's Mask R-CNN has them"
                )
        if not np.all((scores >= 0) & (scores <= 1)):
            bad = scores[~((scores >= 0) & (scores <= 1))][0]
            raise ValueError(
                f"{self._path}: one of its scores is {bad}; they must lie in [0, 1]: export the "
                "network with its softmax"
            )
        return Outputs(labels, scores, masks)

    def _by_shape(self, arrays: dict[str, npt.NDArray[Any]]) -> dict[str, npt.NDArray[Any]]:
        """Name outputs that an export numbered: the four differ in type and rank."""
        kinds = {"boxes": ("f", 2), "labels": ("i", 1), "scores": ("f", 1), "masks": ("f", 4)}
        named: dict[str, npt.NDArray[Any]] = {}
        for name, kind in kinds.items():
            fitting = [a for a in arrays.values() if (a.dtype.kind, a.ndim) == kind]
            if len(fitting) != 1:
                has = ", ".join(f"{key} {a.dtype} {a.shape}" for key, a in arrays.items())
                raise ValueError(
                    f"{self._path} has the outputs {has}; expected boxes (n, 4), labels (n,) "
                    "int64, scores (n,) and masks (n, 1, h, w), as torchvision's Mask R-CNN has"
                )
            named[name] = fitting[0]
        return named


def _session(path: Path, providers: Sequence[str] | None) -> Any:
    try:
        import onnxruntime
    except ImportError as error:
        raise ImportError(
            "package 'onnxruntime' is not installed; `pip install 'credence[onnx]'` has it"
        ) from error
    if not path.is_file():
        raise FileNotFoundError(f"{path} is no file; name the .onnx file of a Mask R-CNN")
    chosen = ["CPUExecutionProvider"] if providers is None else list(providers)
    available = onnxruntime.get_available_providers()
    for provider in chosen:
        if provider not in available:
            raise ValueError(
                f"provider '{provider}' is not available; choose from {', '.join(available)}, or "
                "install the onnxruntime that has it"
            )
    try:
        return onnxruntime.InferenceSession(str(path), providers=chosen)
    except Exception as error:
        # onnxruntime's exceptions have no class of their own.
        raise ValueError(
            f"{path} cannot be loaded as an ONNX model: {_line(error)}; export it again"
        ) from error


def _checked(categories: Mapping[int, str]) -> dict[int, str]:
    if not categories:
        raise ValueError("categories is empty; name the category of at least one label")
    known = CLASS_NAMES[1:]
    for label, name in categories.items():
        if name not in known:
            raise ValueError(
                f"categories[{label}] is {name!r}; choose one of {', '.join(known)}, and leave out "
                "labels that are none of them"
            )
    return dict(categories)


def _share(name: str, value: float) -> float:
    if not 0 <= value <= 1:
        raise ValueError(f"{name} is {value}; it must lie in [0, 1]")
    return value


def _text(shape: tuple[Any, ...]) -> str:
    """Write a shape in which some sides have names or none."""
    return "(" + ", ".join("?" if side is None else str(side) for side in shape) + ")"


def _line(error: Exception) -> str:
    """Return an error's message on one line."""
    return " ".join(str(error).split())
