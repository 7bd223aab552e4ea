"""One look for every figure: a colour, marker and line per model, sizes, and files.

Colours are Okabe and Ito's, which colour-blind readers can tell apart; a marker and a line say the
same again, for print without colour.
"""

from __future__ import annotations

import io
from dataclasses import dataclass
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt
from matplotlib import style
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LinearSegmentedColormap
from matplotlib.figure import Figure
from PIL import Image

from harness.pictures import CLASS_COLOURS
from harness.runs.atomic import write_atomically

if TYPE_CHECKING:
    from contextlib import AbstractContextManager
    from pathlib import Path

BLACK = "#000000"
ORANGE = "#E69F00"
SKY = "#56B4E9"
GREEN = "#009E73"
YELLOW = "#F0E442"
BLUE = "#0072B2"
VERMILLION = "#D55E00"
PURPLE = "#CC79A7"
GREY = "#7F7F7F"


@dataclass(frozen=True)
class SeriesStyle:
    """How a series looks everywhere.

    Attributes
    ----------
    label
        Its name in print.
    colour
        ``#rrggbb``.
    marker
        A matplotlib marker.
    line
        A matplotlib line style: solid, dashed, dotted or dashdot.
    """

    label: str
    colour: str
    marker: str
    line: Literal["solid", "dashed", "dotted", "dashdot"] = "solid"


MODELS = MappingProxyType(
    {
        "classic": SeriesStyle("classic", VERMILLION, "s", "dashed"),
        "classic_tuned": SeriesStyle("classic, tuned", ORANGE, "D", "dashdot"),
        "metric_literal": SeriesStyle("metric, literal", SKY, "v", "dashed"),
        "metric": SeriesStyle("metric", BLUE, "o", "solid"),
        "network": SeriesStyle("network alone", GREEN, "^", "dashdot"),
        "nearest": SeriesStyle("nearest observation", PURPLE, "P", "dotted"),
    }
)
"""By a record's model: what rests on coordinates is warm, what rests on the embedding cool."""

RANDOM = SeriesStyle("random order", GREY, "_", "dotted")
SEED = SeriesStyle("seed", BLACK, "x", "solid")

UNCERTAIN = BLUE
"""Points below a threshold of confidence."""
CERTAIN = ORANGE
TRUE_MESH = "#D9D9D9"

CONFIDENCE_COLOURS = LinearSegmentedColormap.from_list(
    "confidence", [(0.0, "#00366B"), (0.45, BLUE), (1.0, "#F0B030")]
)
"""Confidence from 0, blue, to 1, orange: lighter throughout, so that it survives grey print."""

ONE_COLUMN_IN = 3.5
TWO_COLUMNS_IN = 7.16
DPI = 300
WEB_DPI = 150
WEB_BYTES = 350_000
TEXT_PT = 7.5
SMALL_PT = 7.0
"""The smallest text."""

_RC = {
    "font.family": "sans-serif",
    "font.sans-serif": ["DejaVu Sans"],
    "font.size": TEXT_PT,
    "axes.titlesize": TEXT_PT,
    "axes.labelsize": TEXT_PT,
    "xtick.labelsize": SMALL_PT,
    "ytick.labelsize": SMALL_PT,
    "legend.fontsize": SMALL_PT,
    "figure.titlesize": TEXT_PT,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "#E6E6E6",
    "grid.linewidth": 0.5,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "lines.linewidth": 1.2,
    "lines.markersize": 3.5,
    "legend.frameon": False,
    "legend.handlelength": 2.4,
    "savefig.dpi": DPI,
    "figure.dpi": DPI,
    # TrueType in place of Type 3, which publishers refuse.
    "pdf.fonttype": 42,
    "pdf.compression": 9,
}
_METADATA: dict[str, dict[str, Any]] = {
    # No clock and no version: the same numbers are the same bytes.
    "pdf": {"CreationDate": None, "ModDate": None, "Creator": None, "Producer": None},
    "png": {"Software": None},
}


def model_style(model: str) -> SeriesStyle:
    """Style of a record's model; one that is not ours is grey and goes by its name."""
    return MODELS.get(model) or SeriesStyle(plain(model.replace("_", " ")), GREY, "h", "dotted")


def plain(text: str) -> str:
    """Escape what would begin a formula: names come from configurations and folders."""
    return text.replace("$", r"\$")


def class_colour(category: str) -> str:
    """Colour of a category, ``#rrggbb``."""
    return hex_of(np.array(CLASS_COLOURS[category], dtype=np.uint8))


def rgb_of(colour: str) -> npt.NDArray[np.uint8]:
    """Red, green and blue (3,) of ``#rrggbb``."""
    return np.frombuffer(bytes.fromhex(colour[1:]), dtype=np.uint8)


def hex_of(rgb: npt.NDArray[np.uint8]) -> str:
    """Write a colour (3,) as ``#rrggbb``."""
    return "#" + bytes(rgb.tolist()).hex().upper()


def confidence_colours(confidence: npt.NDArray[np.floating]) -> npt.NDArray[np.uint8]:
    """Colours (n, 3) of confidences (n,) in [0, 1]."""
    return np.asarray(CONFIDENCE_COLOURS(confidence)[:, :3] * 255).round().astype(np.uint8)


def publication() -> AbstractContextManager[None]:
    """Set what figures are drawn and written under, whatever the user's own settings."""
    return style.context(["default", _RC])


def new_figure(*, width_in: float, height_in: float) -> Figure:
    """Begin a figure of an exact size, under `publication`."""
    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    FigureCanvasAgg(figure)
    return figure


def write_figure(figure: Figure, stem: Path) -> tuple[Path, ...]:
    """Write ``STEM.pdf`` and ``STEM.png``, under `publication`; the same figure, the same bytes."""
    pdf, png = stem.with_name(stem.name + ".pdf"), stem.with_name(stem.name + ".png")
    write_atomically(pdf, partial(figure.savefig, format="pdf", metadata=_METADATA["pdf"]))
    write_atomically(png, partial(figure.savefig, format="png", metadata=_METADATA["png"]))
    return pdf, png


def write_web_figure(figure: Figure, stem: Path) -> tuple[Path, ...]:
    """Write ``STEM.png`` for a web page, of `WEB_DPI`, in 256 colours if it is large else."""
    png = stem.with_name(stem.name + ".png")
    drawn, small = io.BytesIO(), io.BytesIO()
    figure.savefig(drawn, format="png", dpi=WEB_DPI)
    with Image.open(drawn) as image:
        whole = image.convert("RGB")
    whole.save(small, format="PNG", optimize=True)
    if small.tell() > WEB_BYTES:
        small = io.BytesIO()
        # Of Pillow's methods the one that keeps a few pixels' colours: those of a scale.
        reduced = whole.quantize(
            256, method=Image.Quantize.MAXCOVERAGE, kmeans=4, dither=Image.Dither.NONE
        )
        reduced.save(small, format="PNG", optimize=True)
    write_atomically(png, lambda file: file.write(small.getvalue()))
    return (png,)
