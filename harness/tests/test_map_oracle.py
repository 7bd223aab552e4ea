"""The octree against OctoMap (PyPI's pyoctomap): scans leaf for leaf, files byte for byte."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pyoctomap  # type: ignore[import-untyped]
import pytest
import trimesh
from numpy.testing import assert_array_equal

from harness.native import OccupancyMap, Pipeline
from harness.tests.support import frame

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

    import numpy.typing as npt

    Floats = npt.NDArray[np.float64]
    Scan = tuple[Floats, Floats]
    # Voxel edge in metres, range in metres, scans as sensor (3,) and points (n, 3).
    Case = tuple[float, float | None, list[Scan]]


def spread(seed: int, *, scans: int, points: int, sensor_m: float, points_m: float) -> list[Scan]:
    """Points all around a sensor near the origin, negative coordinates among them."""
    rng = np.random.default_rng(seed)
    return [
        (rng.uniform(-sensor_m, sensor_m, 3), rng.uniform(-points_m, points_m, (points, 3)))
        for _ in range(scans)
    ]


def snapped(scans: list[Scan], edge_m: float) -> list[Scan]:
    """Everything on the corners of voxels."""
    return [
        (np.round(sensor / edge_m) * edge_m, np.round(points / edge_m) * edge_m)
        for sensor, points in scans
    ]


def table(*, views: int) -> list[Scan]:
    """A coarse depth camera that looks down at a table at z = 0 with a step on it."""
    scans = []
    for angle in np.linspace(0.0, 2.0, views):
        sensor = np.array([0.5 * np.cos(angle), 0.5 * np.sin(angle), 0.6])
        u, v = np.meshgrid(np.linspace(-0.4, 0.4, 24), np.linspace(-0.4, 0.4, 18))
        floor = np.stack([u, v, np.zeros_like(u)], axis=-1).reshape(-1, 3)
        floor[np.abs(floor[:, 0]) < 0.1, 2] = 0.08
        scans.append((sensor, floor))
    return scans


def random_scans() -> Case:
    return 0.05, None, spread(1, scans=5, points=400, sensor_m=1.0, points_m=2.0)


def decimal_borders() -> Case:
    return (
        0.05,
        None,
        snapped(spread(2, scans=5, points=300, sensor_m=1.0, points_m=1.0), edge_m=0.05),
    )


def binary_borders() -> Case:
    return (
        0.25,
        None,
        snapped(spread(3, scans=5, points=300, sensor_m=1.0, points_m=5.0), edge_m=0.25),
    )


def along_axes() -> Case:
    ends = np.concatenate([np.eye(3), -np.eye(3), np.zeros((1, 3))])
    return 0.02, None, [(np.array([0.01, 0.01, 0.01]), ends), (np.zeros(3), 0.5 * ends)]


def cut_at_range() -> Case:
    return 0.02, 0.7, spread(4, scans=5, points=200, sensor_m=0.3, points_m=1.5)


def saturated_and_pruned() -> Case:
    scans = spread(5, scans=14, points=1500, sensor_m=0.0, points_m=0.5)
    return 0.05, None, [(np.array([0.0, 0.0, 1.0]), points) for _, points in scans]


def negative_corner() -> Case:
    corner = np.array([-3.0, -2.0, -1.0])
    scans = spread(6, scans=4, points=200, sensor_m=0.2, points_m=0.5)
    return 0.013, None, [(sensor + corner, points + corner - 0.5) for sensor, points in scans]


def hundred_metres() -> Case:
    return 0.01, None, spread(7, scans=2, points=3, sensor_m=0.3, points_m=100.0)


def beyond_the_volume() -> Case:
    points = np.array([[32.767, 0.0001, 0.0002], [40.0, 0.0, 0.0], [1.0, 2.0, -32.7679]])
    return 0.001, None, [(np.zeros(3), points)]


def depth_camera() -> Case:
    return 0.005, None, table(views=2)


CASES = (
    random_scans,
    decimal_borders,
    binary_borders,
    along_axes,
    cut_at_range,
    saturated_and_pruned,
    negative_corner,
    hundred_metres,
    beyond_the_volume,
    depth_camera,
)


def ours(case: Case) -> OccupancyMap:
    resolution_m, max_range_m, scans = case
    tree = OccupancyMap(resolution_m=resolution_m)
    for sensor, points in scans:
        tree.insert_scan(sensor, points, max_range_m=max_range_m)
    return tree


def theirs(case: Case) -> pyoctomap.OcTree:
    resolution_m, max_range_m, scans = case
    tree = pyoctomap.OcTree(resolution_m)
    for sensor, points in scans:
        tree.insertPointCloud(points, sensor, -1.0 if max_range_m is None else max_range_m)
    return tree


def assert_same_leaves(mine: OccupancyMap, other: pyoctomap.OcTree) -> None:
    """Same leaves in the same order, with the same bits; OctoMap's centres are float32."""
    rows = [
        (*leaf.getCoordinate(), leaf.getSize(), leaf.current_node.getLogOdds())
        for leaf in other.begin_leafs()
    ]
    expected = np.array(rows).reshape(-1, 5)
    centres, sizes_m, log_odds = mine.leaves()
    assert len(centres) == len(expected)
    assert_array_equal(centres.astype(np.float32), expected[:, :3].astype(np.float32))
    assert_array_equal(sizes_m, expected[:, 3])
    assert_array_equal(log_odds, expected[:, 4].astype(np.float32))


@pytest.mark.parametrize("case", CASES)
def test_scans_leaf_for_leaf(case: Callable[[], Case]) -> None:
    mine = ours(case())
    assert len(mine.leaves()[0]) > 100
    assert_same_leaves(mine, theirs(case()))


def test_saturation_prunes() -> None:
    sizes_m = ours(saturated_and_pruned()).leaves()[1]
    assert (sizes_m > 0.05).any()


@pytest.mark.parametrize("case", [random_scans, saturated_and_pruned, depth_camera])
def test_files_that_octomap_reads(case: Callable[[], Case], tmp_path: Path) -> None:
    mine = ours(case())
    mine.write_ot(tmp_path / "map.ot")
    assert_same_leaves(mine, pyoctomap.OcTree(1.0).read(str(tmp_path / "map.ot")))
    mine.write_bt(tmp_path / "map.bt")
    read = pyoctomap.OcTree(1.0)
    assert read.readBinary(str(tmp_path / "map.bt"))
    most_likely = theirs(case())
    most_likely.writeBinary(str(tmp_path / "theirs.bt"))
    assert read.getResolution() == mine.resolution_m
    assert read.size() == most_likely.size()
    assert_same_leaves(OccupancyMap.read(tmp_path / "map.bt"), read)
    assert_same_leaves(OccupancyMap.read(tmp_path / "map.bt"), most_likely)


@pytest.mark.parametrize("case", [random_scans, saturated_and_pruned, depth_camera])
def test_files_that_octomap_writes(case: Callable[[], Case], tmp_path: Path) -> None:
    other = theirs(case())
    other.write(str(tmp_path / "theirs.ot"))
    assert_same_leaves(OccupancyMap.read(tmp_path / "theirs.ot"), other)
    # Writing the binary form makes their tree the most likely one.
    other.writeBinary(str(tmp_path / "theirs.bt"))
    assert_same_leaves(OccupancyMap.read(tmp_path / "theirs.bt"), other)


@pytest.mark.parametrize("case", [random_scans, saturated_and_pruned, depth_camera])
def test_files_byte_for_byte(case: Callable[[], Case], tmp_path: Path) -> None:
    mine, other = ours(case()), theirs(case())
    mine.write_ot(tmp_path / "ours.ot")
    mine.write_bt(tmp_path / "ours.bt")
    other.write(str(tmp_path / "theirs.ot"))
    other.writeBinary(str(tmp_path / "theirs.bt"))
    for suffix in ("ot", "bt"):
        written = (tmp_path / f"ours.{suffix}").read_bytes()
        assert written == (tmp_path / f"theirs.{suffix}").read_bytes(), suffix


def test_an_empty_map_is_a_file_too(tmp_path: Path) -> None:
    empty = OccupancyMap(resolution_m=0.1)
    for write, name in [(empty.write_ot, "empty.ot"), (empty.write_bt, "empty.bt")]:
        write(tmp_path / name)
        read = OccupancyMap.read(tmp_path / name)
        assert read.resolution_m == pytest.approx(0.1)
        assert len(read.leaves()[0]) == 0


def test_an_object_is_a_ply_that_trimesh_reads(tmp_path: Path) -> None:
    pipeline = Pipeline('{"segmenter": "oracle"}')
    pipeline.add_frame(**frame())
    mapped = pipeline.objects()[0]
    mapped.write_ply(tmp_path / "mug.ply")
    cloud = trimesh.load(tmp_path / "mug.ply")
    assert isinstance(cloud, trimesh.PointCloud)
    assert len(mapped.points_world) > 0
    assert_array_equal(cloud.vertices, mapped.points_world)
    assert_array_equal(cloud.colors[:, :3], mapped.rgb)
    with pytest.raises(OSError, match="check that the folder exists"):
        mapped.write_ply(tmp_path / "missing" / "mug.ply")
