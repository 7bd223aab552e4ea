"""Configuration files: defaults, ranges, and the help that a misspelt key gets."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from harness.config import Config, Override, check_test_sets, differing_keys, load_config
from harness.errors import InputError

Writer = Callable[[str], Path]


def no_check(text: str) -> str:
    """A pipeline that accepts everything and has no defaults."""
    return text


@pytest.fixture
def write(tmp_path: Path) -> Writer:
    def write(text: str) -> Path:
        path = tmp_path / "my.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def message(path: Path | None, *overrides: Override) -> str:
    with pytest.raises(InputError) as caught:
        load_config(path, overrides=overrides, check_pipeline=no_check)
    text = str(caught.value)
    assert "\n" not in text
    return text


def test_the_defaults_are_the_seeds_protocol() -> None:
    config = load_config(None, check_pipeline=no_check)
    assert config == Config()
    assert config.protocol.test_points == 1000
    assert config.protocol.test_sets == ("box", "completed")
    assert config.protocol.use_spread
    assert config.protocol.tolerances_m == (0.0025, 0.005, 0.01)
    assert (config.run.scenes, config.scenes.views) == (16, 3)
    assert config.run.classes == ("mug", "bowl")


def test_a_file_takes_the_place_of_defaults_and_options_of_the_file(write: Writer) -> None:
    path = write("[run]\nscenes = 4\nseed = 7\n[scenes.depth_noise]\naxial = false\n")
    config = load_config(
        path, overrides=(Override("run.scenes", 2, "--scenes"),), check_pipeline=no_check
    )
    assert (config.run.scenes, config.run.seed) == (2, 7)
    assert not config.scenes.depth_noise.axial
    assert config.scenes.depth_noise.z16


def test_toml_round_trip(write: Writer) -> None:
    path = write(
        '[run]\nclasses = ["bowl"]\nworkers = 3\n[protocol]\ntolerances_m = [0.005, 0.02]\n'
        '[pipeline]\nsegmenter = "oracle"\ngp = {models = ["classic"], fit_points = 90}\n'
    )
    config = load_config(path, check_pipeline=no_check)
    assert load_config(write(config.to_toml()), check_pipeline=no_check) == config


@pytest.mark.parametrize(
    ("text", "key", "place", "nearest"),
    [
        ("[run]\nscens = 4", "scens", "in [run]", "scenes"),
        ("[protocl]\ntest_points = 4", "protocl", "at the top level", "protocol"),
        ("[scenes.depth_noise]\naxail = true", "axail", "in [scenes.depth_noise]", "axial"),
        ("[protocol]\ntolerance_m = [0.005]", "tolerance_m", "in [protocol]", "tolerances_m"),
    ],
)
def test_a_misspelt_key_gets_its_nearest_and_the_file(
    write: Writer, text: str, key: str, place: str, nearest: str
) -> None:
    path = write(text)
    problem = message(path)
    assert problem.startswith(f"{path}: unknown key '{key}' {place}; nearest is '{nearest}'")


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("[scenes]\nviews = 0", "scenes.views = 0: should be greater than or equal to 1"),
        ("[run]\nscenes = 0", "run.scenes = 0: should be greater than or equal to 1"),
        ("[run]\nseed = -1", "run.seed = -1: should be greater than or equal to 0"),
        ('[run]\nscenes = "8"', "run.scenes = '8': should be a valid integer"),
        ("[protocol]\ntolerances_m = [0.0, 0.005]", "protocol.tolerances_m.0 = 0.0: should be gr"),
        ("[protocol]\ntolerances_m = [nan, 0.005]", "protocol.tolerances_m.0 = nan: should be"),
        ("[protocol]\ntest_sets = []", "protocol.test_sets = []"),
        ('[protocol]\ntest_sets = ["box", "box"]', "test_sets ['box', 'box'] names a set twice"),
        ('[protocol]\ntest_sets = ["sphere"]', "test_sets.0 = 'sphere': should be 'box', 'comple"),
        ("[protocol]\ntest_points = 0", "protocol.test_points = 0: should be greater than or"),
        ("[protocol]\nreported_tolerance_m = 0.007", "0.007 is not one of tolerances_m"),
        ("[protocol]\ntolerances_m = [0.005, 0.005]", "names a distance twice"),
        ('[run]\nclasses = ["mug", "mug"]', "names a class twice"),
        ('[run]\nclasses = ["spoon"]', "run.classes.0 = 'spoon': should be 'bottle', 'bowl'"),
        ("[run]\nclasses = []", "run.classes = []"),
        ("[scenes]\nviews = 25", "scenes.views = 25: should be less than or equal to 24"),
        ("[scenes]\nwidth = 63", "scenes.width = 63: should be greater than or equal to 64"),
        ("[scenes]\nheight = 63", "scenes.height = 63: should be greater than or equal to 64"),
        ("scenes = 3", "scenes = 3: should be a table; write [scenes] and its keys below"),
        ("scenes = [1]", "scenes = [1]: should be a table; write [scenes] and its keys below"),
        ("pipeline = 3", "pipeline = 3: should be a table; write [pipeline] and its keys below"),
        ("[scenes]\ndepth_noise = 1", "scenes.depth_noise = 1: should be a table; write [scenes.d"),
        ("[run]\nseed = 2020-01-01", "run.seed = datetime.date(2020, 1, 1): should be a valid int"),
        ("[pipeline.map]\nday = 2020-01-01", "pipeline.map.day = 2020-01-01: is a date or a time"),
        ("[pipeline.map]\nat = 10:00:00", "pipeline.map.at = 10:00:00: is a date or a time, and"),
        ("[pipeline.gp]\nx = [1, nan]", "pipeline.gp.x.1 = nan: should be a finite number"),
        ("[pipeline]\ny = -inf", "pipeline.y = -inf: should be a finite number"),
        ("[run\n", "is not valid TOML"),
    ],
)
def test_values_out_of_range_are_named_with_the_file(
    write: Writer, text: str, expected: str
) -> None:
    path = write(text)
    problem = message(path)
    assert str(path) in problem
    assert expected in problem


def test_a_value_of_the_command_line_is_named_by_its_option() -> None:
    problem = message(None, Override("run.scenes", 0, "--scenes"))
    assert problem == "--scenes 0: should be greater than or equal to 1"


def test_an_option_for_a_section_that_is_none_gets_one_line(write: Writer) -> None:
    path = write("run = 3")
    expected = f"{path}: run = 3: should be a table; write [run] and its keys below"
    assert message(path, Override("run.scenes", 1, "--scenes")) == expected


def test_a_loaded_configuration_holds_the_pipelines_defaults(write: Writer) -> None:
    config = load_config(None)
    assert config.pipeline["segmenter"] == "maskrcnn_rgbd"
    assert config.pipeline["map"]["resolution_m"] == 0.005
    tables = {"segmentation", "completion", "map", "training", "gp", "metric", "recalibration"}
    assert set(config.pipeline) == {"segmenter", "completer", *tables}
    for said in ("segmenter = 'maskrcnn_rgbd'", "map.resolution_m = 0.005", "map.max_range_m = 2"):
        assert load_config(write(f"[pipeline]\n{said}\n")) == config
    # What an earlier version wrote keeps its values, whatever this version's defaults are.
    older = {**config.pipeline, "gp": {**config.pipeline["gp"], "fit_points": 77}}
    text = config.model_copy(update={"pipeline": older}).to_toml()
    assert load_config(write(text)).pipeline == older


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    missing = tmp_path / "none.toml"
    assert message(missing) == f"cannot read the configuration {missing}: No such file or directory"
    assert "Is a directory" in message(tmp_path)
    latin = tmp_path / "latin.toml"
    latin.write_bytes(b"# \xe9")
    assert "is not UTF-8 text" in message(latin)


def test_the_pipeline_table_goes_to_its_own_check(write: Writer) -> None:
    path = write("[pipeline.gp]\nfit_point = 3")
    seen: list[object] = []

    def refuse(text: str) -> str:
        seen.append(json.loads(text))
        raise ValueError("unknown key gp.fit_point; did you mean gp.fit_points?")

    with pytest.raises(InputError) as caught:
        load_config(path, check_pipeline=refuse)
    assert seen == [{"gp": {"fit_point": 3}}]
    assert str(caught.value) == (
        f"{path}: [pipeline] unknown key gp.fit_point; did you mean gp.fit_points?"
    )


def test_completed_points_need_a_completer(write: Writer) -> None:
    def none(text: str) -> str:
        return '{"completer": "none"}'

    with pytest.raises(InputError) as caught:
        check_test_sets(load_config(None, check_pipeline=none))
    assert str(caught.value) == (
        "protocol.test_sets has 'completed' but pipeline.completer is 'none'; name a completer, "
        "or take 'completed' out of the test sets"
    )
    drawn = load_config(write('[protocol]\ntest_sets = ["box"]'), check_pipeline=none)
    assert check_test_sets(drawn) is drawn


def test_an_extension_that_is_not_built_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "harness.native", None)
    with pytest.raises(InputError, match=r"extension does not load .*; build it with `make setup`"):
        load_config(None)


def test_a_relative_objects_folder_counts_from_the_file(write: Writer, tmp_path: Path) -> None:
    config = load_config(write('[scenes]\nobjects = "../meshes"'), check_pipeline=no_check)
    assert config.scenes.objects == tmp_path.parent / "meshes"


def test_workers_do_not_belong_to_a_configurations_identity() -> None:
    config = Config()
    busier = Config.model_validate({"run": {"workers": 7}})
    assert differing_keys(ours=config, theirs=busier) == []
    assert config.short_hash() == busier.short_hash()


def test_differing_keys_are_named_with_both_values() -> None:
    other = Config.model_validate({"run": {"seed": 5}, "pipeline": {"gp": {"fit_points": 9}}})
    assert differing_keys(ours=other, theirs=Config()) == [
        "pipeline.gp.fit_points (unset there, 9 asked)",
        "run.seed (0 there, 5 asked)",
    ]
    assert other.short_hash() != Config().short_hash()
