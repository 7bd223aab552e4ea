"""The page's markup, around what it shows."""

from __future__ import annotations

import json
from functools import lru_cache
from importlib import resources
from typing import TYPE_CHECKING, Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.colors import to_hex
from plotly.offline import get_plotlyjs

from harness.figures.style import CONFIDENCE_COLOURS

if TYPE_CHECKING:
    from collections.abc import Mapping

    from harness.html_report.content import Page

_FOLDER = "page"
_SCRIPTS = ("parts.js", "tables.js", "charts.js", "scenes.js")
_SCALE_STEPS = 12


def render_page(page: Page, *, curves: Mapping[str, Any] | None, scenes: Mapping[str, Any]) -> str:
    """Write the page as HTML that holds all it needs: style, scripts, data and pictures.

    Whatever comes from the run is escaped: as text of the markup by Jinja, in the data by
    `_embedded`, and the scripts make only text of it.

    Parameters
    ----------
    page
        What the markup shows.
    curves, scenes
        What the scripts read; without curves the charts and their library are left out.
    """
    environment = Environment(
        loader=PackageLoader(__package__, _FOLDER),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
    )
    stops = (CONFIDENCE_COLOURS(step / (_SCALE_STEPS - 1)) for step in range(_SCALE_STEPS))
    parts = {
        "css": _own("page.css"),
        "scripts": Markup("\n").join(_own(name) for name in _SCRIPTS),
        "scale": ", ".join(map(to_hex, stops)),
        "plotly": _plotly() if curves is not None else "",
        "curves": _embedded(curves),
        "scenes": _embedded(scenes),
    }
    return environment.get_template("page.html").render(page=page, parts=parts)


def _own(name: str) -> Markup:
    text = resources.files(__package__).joinpath(_FOLDER, name).read_text(encoding="utf-8")
    return Markup(text)


@lru_cache(maxsize=1)
def _plotly() -> Markup:
    """Read the drawing library; nothing in it ends a script element."""
    return Markup(get_plotlyjs().replace("</script", "<\\/script"))


def _embedded(data: Mapping[str, Any] | None) -> Markup:
    """Write data as JSON that no text in it can leave: without ``<``, ``>`` and ``&``."""
    text = json.dumps(data, ensure_ascii=True, allow_nan=False, separators=(",", ":"))
    for character in "<>&":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return Markup(text)
