from __future__ import annotations

import json
from typing import Any

import pytest

from sim_scenes import Appearance, Arc, DepthNoise, SceneSpec, SpecError


def test_a_spec_survives_json() -> None:
    spec = SceneSpec.clutter(
        "bowl",
        views=5,
        appearance=Appearance(textures=False),
        depth_noise=DepthNoise(axial=False, grazing_deg=(60.0, 80.0)),
    )
    assert SceneSpec.from_dict(json.loads(json.dumps(spec.to_dict()))) == spec


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({}, "give one of the two"),
        ({"category": "mug", "models": ("a",)}, "give one of the two"),
        ({"models": ("a", "a")}, "a scene holds each model once"),
        ({"category": "mug", "objects": (3, 2)}, "1 to 8 objects"),
        ({"category": "mug", "objects": (0, 2)}, "1 to 8 objects"),
        ({"category": "mug", "views": 0}, "views is 0"),
        ({"category": "mug", "image_size": (640, 0)}, "image_size is"),
        ({"category": "mug", "max_redraws": -1}, "max_redraws is -1"),
    ],
)
def test_specs_that_describe_no_scene(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(SpecError, match=message):
        SceneSpec(**settings)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"azimuth_span_deg": -1}, "azimuth_span_deg is -1"),
        ({"elevation_deg": (60, 30)}, "elevation_deg is"),
        ({"distance_m": (0.1, 0.4)}, "distance_m is"),
        ({"azimuth_centre_deg": (0, float("nan"))}, "azimuth_centre_deg is"),
    ],
)
def test_arcs_that_hold_no_camera(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(SpecError, match=message):
        Arc(**settings)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"category": "mug", "arc": {"azimut": 3}}, "Arc has no setting 'azimut'"),
        ({"category": "mug", "wievs": 3}, "SceneSpec has no setting 'wievs'"),
        ({"category": "mug", "depth_noise": 3}, "DepthNoise is 3"),
        ({"category": "mug", "views": "three"}, "SceneSpec: "),
    ],
)
def test_tables_that_are_no_spec(values: dict[str, Any], message: str) -> None:
    with pytest.raises(SpecError, match=message):
        SceneSpec.from_dict(values)
