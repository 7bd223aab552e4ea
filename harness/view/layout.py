"""How the viewer shows a scene before anyone has moved a panel."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import rerun.blueprint as rrb

from harness.view.names import (
    ABOUT,
    BY_COLOUR,
    BY_CONFIDENCE,
    CAMERA,
    COMPLETED,
    CONFIDENCE,
    DEPTH,
    FOUND,
    JUDGED,
    LEGEND,
    OBSERVED,
    RGB,
    TIMELINE,
    TRAINING,
    TRUE,
    TRUE_MASKS,
    WORLD,
    set_name,
)

if TYPE_CHECKING:
    from collections.abc import Iterable

    from harness.recordings.recording import Recording

BACKGROUND = (245, 245, 245)
STEPS_PER_S = 1.0

UP = (0.0, 0.0, 1.0)
MAP_EYE = (0.5, -0.95, 0.6)
"""From what the eye looks at, metres: arm and target are in view, from the arm's right."""
TOWARDS_TARGET = 0.7
"""Where it looks, from the arm's base at 0 to the target at 1."""
LOOK_UP_M = 0.12
POINTS_EYE = 1.4
"""From the target towards where the last view was taken, in diagonals of its box."""


def lay_out(recording: Recording) -> rrb.Blueprint:
    """Lay out a scene: map and points in 3-D at the left, images and numbers at the right."""
    return rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(_map(recording), _points(recording), row_shares=[5, 5]),
            rrb.Vertical(
                rrb.Grid(
                    _image("Detections", RGB, f"{FOUND}/**"),
                    _image("Depth", DEPTH),
                    _image("True masks", RGB, TRUE_MASKS),
                    rrb.Spatial2DView(origin=LEGEND, name="Colours", background=BACKGROUND),
                    grid_columns=2,
                ),
                rrb.TextDocumentView(origin=ABOUT, name="Scene"),
                row_shares=[11, 9],
            ),
            column_shares=[5, 5],
        ),
        rrb.TimePanel(
            state=rrb.components.PanelState.Collapsed,
            timeline=TIMELINE,
            fps=STEPS_PER_S,
            play_state=rrb.components.PlayState.Following,
        ),
        rrb.BlueprintPanel(state=rrb.components.PanelState.Collapsed),
        rrb.SelectionPanel(state=rrb.components.PanelState.Collapsed),
        auto_views=False,
    )


def _map(recording: Recording) -> rrb.Spatial3DView:
    """Show the map in its classes' colours, with arm, camera, tracker and shapes."""
    low, high = _target_box(recording)
    middle = TOWARDS_TARGET * (low + high) / 2 + np.array((0.0, 0.0, LOOK_UP_M))
    return rrb.Spatial3DView(
        origin=WORLD,
        name="Map",
        contents=[
            "+ $origin/**",
            *_without(f"{FOUND}/**", TRUE_MASKS, f"{CONFIDENCE}/**", f"{JUDGED}/**"),
            *_without(f"{TRAINING}/**"),
        ],
        overrides=_hidden(DEPTH, BY_COLOUR, BY_CONFIDENCE),
        background=BACKGROUND,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            position=middle + np.array(MAP_EYE), look_target=middle, eye_up=UP
        ),
    )


def _points(recording: Recording) -> rrb.Spatial3DView:
    """Show the test points by confidence on the true mesh; the completed ones where there are."""
    low, high = _target_box(recording)
    middle = (low + high) / 2
    towards = recording.views[-1].world_from_camera[:3, 3] - middle
    distance_m = POINTS_EYE * np.linalg.norm(high - low)
    sets = [item.completion for item in recording.test_sets if item.part.stop > item.part.start]
    return rrb.Spatial3DView(
        origin=WORLD,
        name="Points by confidence",
        contents=[
            *(f"+ {path}/**" for path in (TRUE, CONFIDENCE, JUDGED, TRAINING)),
            *(f"+ {path}/**" for path in (OBSERVED, COMPLETED)),
        ],
        overrides=_hidden(
            *(f"{CONFIDENCE}/{set_name(name)}" for name in sets[:-1]),
            *(JUDGED, TRAINING, COMPLETED, OBSERVED),
        ),
        background=BACKGROUND,
        line_grid=False,
        eye_controls=rrb.EyeControls3D(
            position=middle + distance_m * towards / np.linalg.norm(towards),
            look_target=middle,
            eye_up=UP,
        ),
    )


def _image(name: str, *contents: str) -> rrb.Spatial2DView:
    return rrb.Spatial2DView(
        origin=CAMERA,
        name=name,
        contents=[f"+ {path}" for path in contents],
        background=BACKGROUND,
    )


def _target_box(recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    vertices = recording.target.vertices_world.astype(np.float64)
    return vertices.min(axis=0), vertices.max(axis=0)


def _without(*paths: str) -> Iterable[str]:
    return (f"- {path}" for path in paths)


def _hidden(*paths: str) -> dict[Any, Any]:
    """Hide what one click of the eye beside its name shows."""
    return {path: rrb.EntityBehavior(visible=False) for path in paths}
