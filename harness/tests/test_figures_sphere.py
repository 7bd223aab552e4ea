from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest
from PIL import Image

from harness.errors import InputError
from harness.figures.sphere import VIEW, draw_sphere, main, measure_angles, read_table
from harness.pictures import CLASS_COLOURS

if TYPE_CHECKING:
    from pathlib import Path

HEADER = "kind,category,e1,e2,e3"


def write(folder: Path, *rows: str) -> Path:
    table = folder / "sphere.csv"
    table.write_text("\n".join([HEADER, *rows]) + "\n", encoding="utf-8")
    return table


def on_equator(kind: str, category: str, degrees: float) -> str:
    angle = np.radians(degrees)
    return f"{kind},{category},{np.cos(angle):.9f},{np.sin(angle):.9f},0"


def two_classes(folder: Path) -> Path:
    return write(
        folder,
        on_equator("direction", "mug", 0),
        on_equator("direction", "bowl", 90),
        on_equator("direction", "can", 180),
        on_equator("point", "mug", 0),
        on_equator("point", "mug", 20),
        on_equator("point", "bowl", 80),
    )


def test_angles_of_two_classes_by_hand(tmp_path: Path) -> None:
    categories = read_table(table=two_classes(tmp_path))
    assert [category.name for category in categories] == ["mug", "bowl"]
    angles = measure_angles(categories=categories)
    assert angles.within_mean == pytest.approx(20 / 3, abs=1e-5)
    assert angles.within_p95 == pytest.approx(10, abs=1e-5)
    assert angles.between_mean == pytest.approx(70, abs=1e-5)
    assert angles.between_min == pytest.approx(70, abs=1e-5)


def test_points_are_drawn_in_their_colours(tmp_path: Path) -> None:
    picture = tmp_path / "sphere.png"
    draw_sphere(table=two_classes(tmp_path), out=picture)
    pixels = np.asarray(Image.open(picture).convert("RGB")).reshape(-1, 3)
    for name in ("mug", "bowl"):
        colour = np.array(CLASS_COLOURS[name])
        assert np.all(pixels == colour, axis=1).any(), name


def test_halves_are_seen_from_outside() -> None:
    right, up, towards = VIEW
    np.testing.assert_allclose(np.cross(right, up), towards, atol=1e-12)
    # From behind, right and the direction of view turn round together: no mirror image.
    np.testing.assert_allclose(np.cross(-right, up), -towards, atol=1e-12)


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (["point,mug,1,0,0"], "0 directions for 'mug'"),
        (["direction,mug,1,0,0"], "no points"),
        (["direction,spoon,1,0,0", "point,spoon,1,0,0"], "unknown category 'spoon'"),
        (["direction,mug,1,0,0", "point,mug,1,1,0"], "row 2 of .* has length 1.41"),
        (["direction,mug,1,0,0", "point,mug,nan,1,0"], "row 2 of .* has length nan"),
        (["direction,mug,1,0,zero"], "cannot read"),
    ],
)
def test_bad_tables_are_refused(tmp_path: Path, rows: list[str], message: str) -> None:
    with pytest.raises(InputError, match=message):
        read_table(table=write(tmp_path, *rows))


def test_missing_table_is_one_line(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    arguments = ["sphere", str(tmp_path / "none.csv"), str(tmp_path / "sphere.png")]
    monkeypatch.setattr("sys.argv", arguments)
    assert main() == 2
    error = capsys.readouterr().err
    assert "none.csv" in error
    assert error.count("\n") == 1
