"""The simulation behind the gate's promises: what it plants, and that it finds it."""

from __future__ import annotations

import numpy as np
import pytest

from harness.benchmarks.gate_power import draw_objects, make_study, planted_losses, simulate
from harness.runs.job import SceneJob
from harness.runs.records import Record, Variant


def record(index: int, *, shift: float = 0.0) -> Record:
    """A scene with 400 positive predictions, of which 380 are right."""
    return Record(
        scene_id=f"mug-{index:04d}",
        category="mug",
        object_name=f"mug_{index % 8}",
        seed=index,
        model="metric",
        completion="none",
        segmenter="oracle",
        views=3,
        tolerance_m=0.005,
        test_points=1000,
        tp=380,
        tn=580,
        fp=20,
        fn=20,
        precision=0.95 + shift,
        recall=0.95,
        accuracy=0.96,
    )


@pytest.mark.parametrize("counts", [(3800, 5800, 200, 200), (9800, 10, 190, 0)])
def test_what_is_planted_is_two_points_in_the_mean(counts: tuple[int, ...]) -> None:
    random = np.random.default_rng(0)
    many = np.repeat(np.array(counts, dtype=np.float64)[:, np.newaxis], 4000, axis=1)
    precision, recall, accuracy = planted_losses(many, loss=0.02, random=random)
    assert precision.mean() == pytest.approx(0.02, abs=2e-4)
    assert accuracy.mean() > 0
    if counts[1] > 1000:
        # Negatives that are called positive take no true positive away.
        assert np.all(recall == 0)
        extra = 3800 / (0.95 - 0.02) - 4000
        assert accuracy.mean() == pytest.approx(extra / 10_000, rel=0.02)
    else:
        assert accuracy.mean() == pytest.approx(0.02 * 9990 / 10_000, rel=0.02)


def test_scenes_that_are_not_of_the_cell_lose_nothing() -> None:
    found = planted_losses(np.full((4, 3), np.nan), loss=0.02, random=np.random.default_rng(0))
    assert all(np.all(np.nan_to_num(values) == 0) for values in found)


def test_objects_are_drawn_with_all_their_scenes_and_by_class() -> None:
    member = np.array([0, 1, 1, 2, 3, 3])
    classes = np.array(["bowl"] * 3 + ["mug"] * 3)
    random = np.random.default_rng(1)
    for _ in range(50):
        chosen, objects = draw_objects(member, classes=classes, random=random)
        assert classes[chosen].tolist() == classes.tolist()
        for draw in np.unique(objects):
            assert len(set(member[chosen[objects == draw]])) == 1


def test_the_gate_finds_what_was_planted_and_nothing_else() -> None:
    rng = np.random.default_rng(2)
    base = [record(index) for index in range(12)]
    other = [record(index, shift=float(rng.normal(0, 0.003))) for index in range(12)]
    study = make_study(base, other, names="A and B")
    (cell,) = study.counts
    for kind in ("same", "swapped", "centred"):
        assert simulate(study, kind=kind, planted=[], scenes_per_class=16, repeats=20) == 0
        assert simulate(study, kind=kind, planted=[cell], scenes_per_class=16, repeats=20) == 20
    # Four objects are too few to judge.
    assert simulate(study, kind="same", planted=[cell], scenes_per_class=4, repeats=3) == 0


def test_a_lost_scene_is_not_of_the_study() -> None:
    base = [record(index) for index in range(6)]
    job = SceneJob("mug-0005", "mug", "mug_5", 5)
    base[5] = Record.failed(
        job, variant=Variant("metric"), views=3, tolerance_m=0.005, failure="no luck"
    )
    study = make_study(base, base, names="A and B")
    (counts,) = study.counts.values()
    assert np.isnan(counts[:, 5]).all()
    assert counts[:, 0].tolist() == [380, 580, 20, 20]
