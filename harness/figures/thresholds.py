"""The seed's Fig. 6: completed points over percentile thresholds of their confidence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from harness.figures.panels import (
    Layout,
    dot_legend,
    picture_grid,
    row_label,
    scale_bar,
    show_picture,
    under_panel,
)
from harness.figures.solid import (
    completed_points,
    draw_mesh,
    draw_spheres,
    shown_points,
    sphere_radius,
    view_from_behind,
)
from harness.figures.source import NothingToDrawError
from harness.figures.style import (
    BLACK,
    CERTAIN,
    TWO_COLUMNS_IN,
    UNCERTAIN,
    model_style,
    rgb_of,
)

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from harness.cubes import Picture, View
    from harness.figures.source import RunSource
    from harness.recordings.recording import Recording

PERCENTILES = (0, 25, 50, 75)
MODEL_PAIRS = (("metric",), ("classic", "classic_tuned"))
"""A row of each: the first of them that a recording has."""
ASPECT = 1.25


@dataclass(frozen=True, eq=False)
class Kept:
    """What a threshold leaves of a scene's completed points.

    Attributes
    ----------
    threshold
        The percentile of the points' confidence.
    kept : (n,) bool
        Whether each point's confidence reaches it.
    on_mesh
        Share of the kept points that lie on the mesh.
    """

    threshold: float
    kept: npt.NDArray[np.bool_]
    on_mesh: float


def keep_above(
    confidence: npt.NDArray[np.float64], on_mesh: npt.NDArray[np.bool_], *, percentile: float
) -> Kept:
    """Keep the points whose confidence is no less than its percentile.

    Parameters
    ----------
    confidence : (n,) float64
        At least one.
    on_mesh : (n,) bool
        The truth.
    percentile
        From 0 to 100; it is the confidence of a point, so that at least one is kept.
    """
    threshold = float(np.percentile(confidence, percentile, method="inverted_cdf"))
    kept = confidence >= threshold if percentile else np.ones(len(confidence), dtype=bool)
    return Kept(threshold=threshold, kept=kept, on_mesh=float(on_mesh[kept].mean()))


def draw_thresholds(source: RunSource) -> tuple[Figure, str]:
    """Draw Fig. 6 of each class's median scene; returns the figure and its caption.

    Raises
    ------
    NothingToDrawError
        No recording has a completed target with answers of a metric or classic model.
    """
    scenes = {
        item.scene_id: item
        for item in source.chosen
        if completed_points(item) is not None and _models(item)
    }
    rows = [(item, model) for item in scenes.values() for model in _models(item)]
    if not rows:
        raise NothingToDrawError(
            "no chosen scene has completed points with answers of a metric or classic model"
        )
    layout = Layout(width=TWO_COLUMNS_IN, aspect=ASPECT, left=0.36, top=0.2, under=0.2, bottom=0.24)
    grid = picture_grid(len(rows), len(PERCENTILES), layout=layout)
    stages = {name: _stage(item, size=grid.panel_px) for name, item in scenes.items()}
    for (recording, model), axes in zip(rows, grid.axes, strict=True):
        row_label(axes[0], f"{recording.category}\n{model_style(model).label}")
        stage = stages[recording.scene_id]
        _draw_row(recording, model, axes, stage=stage, tolerance_m=source.tolerance_m)
    for panel, percentile in zip(grid.axes[0], PERCENTILES, strict=True):
        title = "all points" if percentile == 0 else f"above percentile {percentile}"
        panel.set_title(title, pad=3)
    named = {"kept": CERTAIN, "kept, off the mesh": BLACK, "uncertain": UNCERTAIN}
    dot_legend(grid.figure, named)
    names = " and ".join(scenes)
    return grid.figure, (
        f"{names}, each the median scene of its class, from the side that no camera saw; "
        f"c: confidence; on the mesh: within {1000 * source.tolerance_m:g} mm of it"
    )


@dataclass(frozen=True, eq=False)
class Stage:
    """Where a scene is seen from, and the picture of its true mesh that points are drawn over."""

    view: View
    mesh: Picture


def _stage(recording: Recording, *, size: tuple[int, int]) -> Stage:
    view = view_from_behind(recording, size=size)
    return Stage(view, draw_mesh((recording.target,), view=view))


def _draw_row(
    recording: Recording,
    model: str,
    axes: Sequence[Axes],
    *,
    stage: Stage,
    tolerance_m: float,
) -> None:
    part = completed_points(recording)
    points = recording.test_world[part].astype(np.float64)
    confidence = recording.answers[model].confidence[part]
    true = recording.on_target(tolerance_m)[part]
    middle = shown_points(recording).mean(axis=0)
    radius_m = sphere_radius(recording)
    for panel, percentile in zip(axes, PERCENTILES, strict=True):
        found = keep_above(confidence, true, percentile=percentile)
        colours = _colours(found.kept, true)
        show_picture(
            panel,
            draw_spheres(points, colours, radius_m=radius_m, view=stage.view, over=stage.mesh),
        )
        scale_bar(panel, view=stage.view, at_world=middle)
        under_panel(panel, f"c ≥ {found.threshold:.3f}: {100 * found.on_mesh:.1f} % on mesh")


def _models(recording: Recording) -> Sequence[str]:
    firsts = ([name for name in names if name in recording.answers] for names in MODEL_PAIRS)
    return [names[0] for names in firsts if names]


def _colours(kept: npt.NDArray[np.bool_], on_mesh: npt.NDArray[np.bool_]) -> npt.NDArray[np.uint8]:
    """Colours (n, 3) of points by whether they are kept and true."""
    colours = np.where(kept[:, None], rgb_of(CERTAIN), rgb_of(UNCERTAIN))
    colours[kept & ~on_mesh] = rgb_of(BLACK)
    return colours.astype(np.uint8)
