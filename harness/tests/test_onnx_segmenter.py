"""A Mask R-CNN in ONNX as the pipeline's segmenter; the networks here are made by hand."""

from __future__ import annotations

import builtins
import json
import sys
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from harness.native import CLASS_NAMES, Pipeline, Segmenter
from harness.segmenters.onnx import COCO_CATEGORIES, OnnxSegmenter
from harness.tests.support import HEIGHT, WIDTH, frame

onnx = pytest.importorskip("onnx")
pytest.importorskip("onnxruntime")

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    from harness.native import SegmenterFunction

CUP, BOWL, DOG = 47, 51, 18


def network(
    path: Path,
    *,
    labels: tuple[int, ...] = (CUP, BOWL),
    scores: tuple[float, ...] = (0.9, 0.75),
    names: tuple[str, ...] = ("boxes", "labels", "scores", "masks"),
    image: tuple[int | str, ...] = (3, "h", "w"),
    output: Callable[[list[Any]], list[Any]] = lambda outputs: outputs,
) -> Path:
    """Write a network that takes each colour channel for the soft mask of one object.

    As torchvision's export, it takes one image and has four outputs; labels and scores are as
    given, channel by channel.
    """
    helper, tensor = onnx.helper, onnx.TensorProto
    count = len(labels)
    batched = [helper.make_node("Squeeze", ["images", "zero"], ["image"])]
    plain = [helper.make_node("Identity", ["images"], ["image"])]
    nodes = [
        *(batched if len(image) == 4 else plain),
        helper.make_node("Gather", ["image", "channels"], ["chosen"], axis=0),
        helper.make_node("Unsqueeze", ["chosen", "one"], [names[3]]),
        helper.make_node("Identity", ["all boxes"], [names[0]]),
        helper.make_node("Identity", ["all labels"], [names[1]]),
        helper.make_node("Identity", ["all scores"], [names[2]]),
    ]
    constants = {
        "zero": np.array([0]),
        "one": np.array([1]),
        "channels": np.arange(count),
        "all boxes": np.tile(np.array([0, 0, 1, 1], dtype=np.float32), (count, 1)),
        "all labels": np.array(labels, dtype=np.int64),
        "all scores": np.array(scores, dtype=np.float32),
    }
    outputs = [
        helper.make_tensor_value_info(names[0], tensor.FLOAT, (count, 4)),
        helper.make_tensor_value_info(names[1], tensor.INT64, (count,)),
        helper.make_tensor_value_info(names[2], tensor.FLOAT, (count,)),
        helper.make_tensor_value_info(names[3], tensor.FLOAT, (count, 1, "h", "w")),
    ]
    graph = helper.make_graph(
        nodes,
        "channels",
        [helper.make_tensor_value_info("images", tensor.FLOAT, image)],
        output(outputs),
        [onnx.numpy_helper.from_array(value, name) for name, value in constants.items()],
    )
    opset = helper.make_opsetid("", 17)
    onnx.save(helper.make_model(graph, opset_imports=[opset], ir_version=8), path)
    return path


def picture() -> np.ndarray:
    """A red lid on a black table, and a green patch at the border; faint blue everywhere."""
    rgb = np.zeros((HEIGHT, WIDTH, 3), dtype=np.uint8)
    rgb[16:32, 20:44, 0] = 255
    rgb[:6, :8, 1] = 200
    rgb[:, :, 2] = 100
    return rgb


def found(segmenter: SegmenterFunction, **change: Any) -> list[dict[str, Any]]:
    arguments = frame(rgb=picture()) | change
    del arguments["instance_ids"], arguments["categories"]
    return segmenter(**arguments)  # type: ignore[return-value]


@pytest.mark.parametrize("image", [(3, "h", "w"), (1, 3, "h", "w"), (3, HEIGHT, WIDTH)])
@pytest.mark.parametrize(
    "names",
    [
        ("boxes", "labels", "scores", "masks"),
        # As torch numbers what nobody named.
        ("2774", "2776", "2775", "2887"),
    ],
)
def test_channels_come_back_as_detections(
    tmp_path: Path, image: tuple[int | str, ...], names: tuple[str, ...]
) -> None:
    segmenter = OnnxSegmenter(network(tmp_path / "rg.onnx", image=image, names=names))
    mug, bowl = found(segmenter)
    assert (mug["category"], bowl["category"]) == ("mug", "bowl")
    assert [mug["score"], bowl["score"]] == pytest.approx([0.9, 0.75])
    assert mug["mask"].dtype == np.bool_
    assert np.array_equal(mug["mask"], picture()[:, :, 0] == 255)
    assert np.array_equal(bowl["mask"], picture()[:, :, 1] == 200)


def test_outputs_are_found_by_name_in_any_order(tmp_path: Path) -> None:
    path = network(tmp_path / "turned.onnx", output=lambda outputs: outputs[::-1])
    assert [item["category"] for item in found(OnnxSegmenter(path))] == ["mug", "bowl"]
    path = network(
        tmp_path / "numbered.onnx",
        names=("4", "3", "2", "1"),
        output=lambda outputs: outputs[::-1],
    )
    assert [item["category"] for item in found(OnnxSegmenter(path))] == ["mug", "bowl"]


def test_what_is_no_category_improbable_or_empty_is_left_out(tmp_path: Path) -> None:
    path = network(tmp_path / "m.onnx", labels=(CUP, DOG, BOWL), scores=(0.25, 0.9, 0.9))
    assert found(OnnxSegmenter(path)) == []
    [mug] = found(OnnxSegmenter(path, least_score=0.25))
    assert mug["category"] == "mug"
    [dog] = found(OnnxSegmenter(path, categories={DOG: "can"}))
    assert dog["category"] == "can"
    # The blue channel is at 100 / 255 everywhere.
    [bowl] = found(OnnxSegmenter(path, mask_threshold=0.39))
    assert bowl["mask"].all()
    black = np.zeros((HEIGHT, WIDTH, 3), dtype=np.uint8)
    assert found(OnnxSegmenter(path, least_score=0), rgb=black) == []


def test_a_network_that_finds_nothing(tmp_path: Path) -> None:
    assert found(OnnxSegmenter(network(tmp_path / "none.onnx", labels=(), scores=()))) == []


def test_cocos_labels_are_categories_of_ours() -> None:
    assert set(COCO_CATEGORIES.values()) == {"bottle", "mug", "bowl", "laptop"} < set(CLASS_NAMES)


def test_the_pipeline_works_with_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = network(tmp_path / "rg.onnx")
    module = tmp_path / "masks_of_this_test.py"
    module.write_text(
        "from harness.segmenters.onnx import OnnxSegmenter\n"
        f"find = OnnxSegmenter({str(path)!r}, least_score=0.8)\n",
        encoding="utf-8",
    )
    monkeypatch.syspath_prepend(str(tmp_path))
    config = json.dumps({"segmenter": "python:masks_of_this_test.find", "completer": "none"})
    arguments = frame(rgb=picture(), instance_ids=None, categories=None)
    [detection] = Segmenter(config).segment(**arguments)
    assert detection.category == "mug"
    assert detection.box.tolist() == [19.5, 15.5, 43.5, 31.5]
    pipeline = Pipeline(config)
    assert pipeline.add_frame(**arguments) == [1]
    [item] = pipeline.objects()
    assert item.category == "mug"
    assert item.score == pytest.approx(0.9)
    path.unlink()
    del sys.modules["masks_of_this_test"]
    with pytest.raises(ValueError, match=rf"cannot import masks_of_this_test: .*{path} is no file"):
        Segmenter(config)


def test_without_onnxruntime_it_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = network(tmp_path / "rg.onnx")
    actual = builtins.__import__

    def missing(name: str, *args: Any, **more: Any) -> Any:
        if name == "onnxruntime":
            raise ModuleNotFoundError(f"No module named {name!r}")
        return actual(name, *args, **more)

    monkeypatch.setattr(builtins, "__import__", missing)
    with pytest.raises(ImportError, match=r"`pip install 'credence\[onnx\]'` has it"):
        OnnxSegmenter(path)


def test_files_that_are_no_model(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"none\.onnx is no file; name the \.onnx file"):
        OnnxSegmenter(tmp_path / "none.onnx")
    corrupt = tmp_path / "corrupt.onnx"
    corrupt.write_bytes(network(tmp_path / "rg.onnx").read_bytes()[:100])
    empty = tmp_path / "empty.onnx"
    empty.touch()
    for path in (corrupt, empty):
        with pytest.raises(ValueError, match=rf"{path} cannot be loaded as an ONNX model: .*again"):
            OnnxSegmenter(path)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (
            {"categories": {CUP: "cup"}},
            r"categories\[47\] is 'cup'; choose one of bottle, bowl, ca",
        ),
        ({"categories": {0: "free"}}, r"categories\[0\] is 'free'; choose one of bottle"),
        ({"categories": {}}, "categories is empty; name the category of at least one label"),
        ({"least_score": 1.5}, r"least_score is 1\.5; it must lie in \[0, 1\]"),
        ({"mask_threshold": np.nan}, r"mask_threshold is nan; it must lie in \[0, 1\]"),
        ({"providers": ["Abacus"]}, "provider 'Abacus' is not available; choose from .*CPUExec"),
    ],
)
def test_settings_out_of_range_are_refused(
    tmp_path: Path, settings: dict[str, Any], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        OnnxSegmenter(network(tmp_path / "rg.onnx"), **settings)


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (("h", "w"), r"the input images is tensor\(float\) of shape \(h, w\); a Mask R-CNN takes"),
        (
            (4, "h", "w"),
            r"of shape \(4, h, w\); a Mask R-CNN takes a float32 image of shape \(3, h",
        ),
    ],
)
def test_networks_that_take_no_image_are_refused(
    tmp_path: Path, image: tuple[int | str, ...], message: str
) -> None:
    with pytest.raises(ValueError, match=message):
        OnnxSegmenter(network(tmp_path / "other.onnx", image=image))


def test_a_network_of_several_images_is_refused(tmp_path: Path) -> None:
    model = onnx.load(network(tmp_path / "rg.onnx"))
    second = onnx.helper.make_tensor_value_info("second", onnx.TensorProto.FLOAT, (3, "h", "w"))
    model.graph.input.append(second)
    path = tmp_path / "two.onnx"
    onnx.save(model, path)
    with pytest.raises(ValueError, match=r"has 2 inputs \(images, second\); export it with one im"):
        OnnxSegmenter(path)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"output": lambda outputs: outputs[:3]},
            r"has the outputs boxes float32 \(2, 4\), .*; expected boxes \(n, 4\), labels",
        ),
        ({"image": (3, 8, 8)}, r"fails on an image of shape \(3, 48, 64\): .*dynamic axes"),
        ({"scores": (0.9, 7.5)}, r"one of its scores is 7\.5; they must lie in \[0, 1\]: export"),
        (
            {"names": ("labels", "boxes", "scores", "masks")},
            r"its boxes are int64 of shape \(2,\); expected floats of shape \(2, 4\)",
        ),
        (
            {"scores": (0.9,)},
            r"its scores are float32 of shape \(1,\); expected floats of shape \(2,\)",
        ),
    ],
)
def test_outputs_that_are_no_detections_are_named(
    tmp_path: Path, change: dict[str, Any], message: str
) -> None:
    segmenter = OnnxSegmenter(network(tmp_path / "other.onnx", **change))
    with pytest.raises(ValueError, match=message):
        found(segmenter)
