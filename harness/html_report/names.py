"""What the page calls models, test sets and cells, and their order."""

from __future__ import annotations

from typing import TYPE_CHECKING

from harness.table.summary import MODEL_ORDER, completion_label, model_label

if TYPE_CHECKING:
    from collections.abc import Iterable

    from harness.runs.records import Variant
    from harness.table.summary import Table

MOST_CHARACTERS = 500
"""Of a failure's reason."""

REFERENCE = "metric"
"""The model that is judged, and that scenes are ranked by, where a run has it."""


def reference_model(models: Iterable[str]) -> str:
    """Choose the model that a run's scenes are ranked by: ours, or else its first.

    Parameters
    ----------
    models
        Of the run, at least one.
    """
    present = set(models)
    return REFERENCE if REFERENCE in present else min(present, key=model_order)


def model_order(model: str) -> tuple[int, str]:
    """Sort models as the tables do, those from outside last."""
    return (MODEL_ORDER.index(model) if model in MODEL_ORDER else len(MODEL_ORDER), model)


def set_label(completion: str) -> str:
    """Name a test set: ``box``, or ``SC`` with the completion that made its points."""
    return completion_label(completion) or "box"


def cell_name(category: str, completion: str) -> str:
    """Name a class and test set, such as ``Mug, box`` and ``Mug, SC (cloud)``."""
    return f"{category.capitalize()}, {set_label(completion)}"


def variant_name(variant: Variant, table: Table) -> str:
    """Name a row's model, with its segmenter where the table has several."""
    segmenters = {row.variant.segmenter for row in table.rows}
    return model_label(variant) if len(segmenters) > 1 else plain(variant.model)


def clipped(text: str) -> str:
    """Cut a text that is too long for a page."""
    return text if len(text) <= MOST_CHARACTERS else f"{text[:MOST_CHARACTERS]} ..."


def plain(name: str) -> str:
    """Write a model's name for people."""
    return name.replace("_", " ")
