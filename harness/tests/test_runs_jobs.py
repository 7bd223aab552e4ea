"""The list of scenes that a seed determines."""

from __future__ import annotations

import pytest

from harness.config import Config
from harness.errors import InputError
from harness.runs.job import SceneJob, plan_jobs, scene_seed
from harness.tests.fake_scenes import MODELS, FakeModel


def config(**run: object) -> Config:
    return Config.model_validate({"run": run})


def test_objects_take_turns_by_name() -> None:
    jobs = plan_jobs(config(scenes=4), list(reversed(MODELS)))
    assert [(job.scene_id, job.object_name) for job in jobs] == [
        ("mug-0000", "mug_0"),
        ("mug-0001", "mug_1"),
        ("mug-0002", "mug_2"),
        ("mug-0003", "mug_0"),
        ("bowl-0000", "bowl_0"),
        ("bowl-0001", "bowl_1"),
        ("bowl-0002", "bowl_2"),
        ("bowl-0003", "bowl_0"),
    ]


def test_a_longer_run_starts_with_the_shorter_ones_scenes() -> None:
    short = plan_jobs(config(scenes=4), MODELS)
    long = plan_jobs(config(scenes=8), MODELS)
    assert short == [job for job in long if int(job.scene_id[-4:]) < 4]


def test_a_class_keeps_its_scenes_whatever_the_other_classes() -> None:
    both = plan_jobs(config(scenes=3), MODELS)
    bowls = plan_jobs(config(scenes=3, classes=["bowl"]), MODELS)
    assert bowls == both[3:]


def test_seeds_differ_by_run_class_and_index() -> None:
    seeds = {
        scene_seed(run_seed=run_seed, category=category, index=index)
        for run_seed in (0, 1, 10)
        for category in ("mug", "bowl")
        for index in range(50)
    }
    assert len(seeds) == 300
    assert all(0 <= seed < 2**63 for seed in seeds)


def test_seeds_never_change() -> None:
    # Of blake2b("0/mug/0", digest_size=8, person="credence scene"), little endian, halved.
    assert scene_seed(run_seed=0, category="mug", index=0) == 3717801986405736027


def test_clutter_reaches_the_jobs() -> None:
    cluttered = Config.model_validate({"scenes": {"cluttered": True}})
    assert all(job.cluttered for job in plan_jobs(cluttered, MODELS))
    assert not SceneJob("mug-0000", "mug", "mug_0", 1).cluttered


def test_a_class_without_objects_is_named_with_what_there_is() -> None:
    with pytest.raises(InputError) as caught:
        plan_jobs(config(classes=["mug", "can"]), [FakeModel("a", "mug"), FakeModel("b", "bowl")])
    assert str(caught.value) == (
        "the object set has no object of class 'can' (it holds: bowl, mug); "
        "add one to its manifest or change run.classes"
    )
    with pytest.raises(InputError, match="it holds: nothing"):
        plan_jobs(Config(), [])
