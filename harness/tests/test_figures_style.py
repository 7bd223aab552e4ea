from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from PIL import Image

from harness.figures import style
from harness.figures.style import (
    BLUE,
    CONFIDENCE_COLOURS,
    DPI,
    MODELS,
    ONE_COLUMN_IN,
    WEB_DPI,
    class_colour,
    confidence_colours,
    hex_of,
    model_style,
    new_figure,
    publication,
    rgb_of,
    write_figure,
    write_web_figure,
)
from harness.table.summary import MODEL_ORDER

if TYPE_CHECKING:
    from pathlib import Path

    import pytest


def lightness(rgb: np.ndarray) -> np.ndarray:
    """CIE L* of sRGB (n, 3) in [0, 1]."""
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    luminance = linear @ np.array([0.2126, 0.7152, 0.0722])
    bright = luminance > 216 / 24389
    return np.asarray(np.where(bright, 116 * np.cbrt(luminance) - 16, luminance * 24389 / 27))


def test_every_model_has_a_colour_a_marker_and_a_name_of_its_own() -> None:
    assert set(MODELS) == set(MODEL_ORDER)
    for what in ("colour", "marker", "label"):
        assert len({getattr(item, what) for item in MODELS.values()}) == len(MODELS), what


def test_foreign_model_goes_by_its_name() -> None:
    look = model_style("my_own")
    assert look.label == "my own"
    assert look.colour not in {item.colour for item in MODELS.values()}


def test_confidence_gets_lighter_throughout() -> None:
    shades = lightness(CONFIDENCE_COLOURS(np.linspace(0, 1, 101))[:, :3])
    assert np.all(np.diff(shades) > 0)
    assert shades[-1] - shades[0] > 50
    low, high = confidence_colours(np.array([0.0, 1.0]))
    assert low[2] > low[0], "the uncertain end is blue"
    assert high[0] > high[2]


def test_class_colour_is_that_of_the_pictures() -> None:
    assert class_colour("mug") == "#D55E00"


def test_large_figures_for_web_pages_get_256_colours(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with publication():
        figure = new_figure(width_in=ONE_COLUMN_IN, height_in=1.0)
        figure.subplots().plot([0, 1], color=BLUE)
        (whole,) = write_web_figure(figure, tmp_path / "whole")
        monkeypatch.setattr(style, "WEB_BYTES", 1000)
        (reduced,) = write_web_figure(figure, tmp_path / "reduced")
    assert (whole.name, reduced.name) == ("whole.png", "reduced.png")
    for path, mode in ((whole, "RGB"), (reduced, "P")):
        with Image.open(path) as image:
            assert image.mode == mode
            assert image.size == (round(ONE_COLUMN_IN * WEB_DPI), WEB_DPI)
            pixels = np.asarray(image.convert("RGB")).astype(int)
            assert (np.abs(pixels - rgb_of(BLUE)).max(axis=2) < 8).any(), mode
    assert reduced.stat().st_size < whole.stat().st_size
    assert hex_of(rgb_of(BLUE)) == BLUE


def test_same_figure_is_the_same_bytes_of_exact_size(tmp_path: Path) -> None:
    written = []
    for name in ("a", "b"):
        with publication():
            figure = new_figure(width_in=ONE_COLUMN_IN, height_in=1.0)
            figure.subplots().set_title("confidence")
            written.append(write_figure(figure, tmp_path / name))
    (pdf_a, png_a), (pdf_b, png_b) = written
    assert pdf_a.name == "a.pdf"
    assert png_a.name == "a.png"
    assert pdf_a.read_bytes() == pdf_b.read_bytes()
    assert png_a.read_bytes() == png_b.read_bytes()
    with Image.open(png_a) as image:
        assert image.size == (round(ONE_COLUMN_IN * DPI), DPI)
    for stamp in (b"CreationDate", b"/Producer", b"Type3"):
        assert stamp not in pdf_a.read_bytes(), stamp
    assert b"/FontFile2" in pdf_a.read_bytes(), "TrueType fonts are embedded"
