"""Images of a dataset."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt
from PIL import Image

from sim_scenes.errors import BopError

if TYPE_CHECKING:
    from pathlib import Path

COLOUR_FOLDERS = ("rgb", "gray")
COLOUR_SUFFIXES = (".png", ".jpg", ".jpeg", ".tif", ".tiff", ".bmp")


def write_image(path: Path, image: npt.NDArray[np.uint8] | npt.NDArray[np.uint16]) -> None:
    """Write a PNG: (h, w, 3) uint8, (h, w) uint8 or (h, w) uint16."""
    Image.fromarray(image).save(path, compress_level=3)


def find_colour(scene: Path, image_id: int) -> Path:
    """Path of a colour (or else grey) image."""
    for folder in COLOUR_FOLDERS:
        for suffix in COLOUR_SUFFIXES:
            path = scene / folder / f"{image_id:06d}{suffix}"
            if path.is_file():
                return path
    raise BopError(
        f"{scene / 'rgb' / f'{image_id:06d}.png'}: is missing; "
        "every image of scene_camera.json needs colour and depth"
    )


def read_colour(path: Path) -> npt.NDArray[np.uint8]:
    """Colour (h, w, 3); grey is repeated."""
    return np.asarray(_open(path).convert("RGB"), dtype=np.uint8)


def read_depth(path: Path) -> npt.NDArray[np.uint16]:
    """Raw depth (h, w) of a 16-bit PNG."""
    image = _open(path)
    if not image.mode.startswith("I"):
        raise BopError(f"{path}: has mode {image.mode}; depth images hold 16 bits a pixel")
    raw = np.asarray(image)
    if raw.min() < 0 or raw.max() > 65535:
        raise BopError(f"{path}: holds values outside 0 to 65535; depth images hold 16 bits")
    return raw.astype(np.uint16)


def read_mask(path: Path, *, shape: tuple[int, int]) -> npt.NDArray[np.bool_]:
    """Mask (h, w)."""
    mask = np.asarray(_open(path).convert("L"))
    check_size(path, mask.shape, shape)
    return mask > 0


def check_size(path: Path, found: tuple[int, ...], expected: tuple[int, int]) -> None:
    """Compare the first two axes of an image with the colour image's."""
    if tuple(found[:2]) != expected:
        raise BopError(
            f"{path}: is {found[1]} x {found[0]} pixels; "
            f"its colour image is {expected[1]} x {expected[0]}"
        )


def _open(path: Path) -> Image.Image:
    try:
        with Image.open(path) as image:
            image.load()
            return image.copy()
    except FileNotFoundError as error:
        raise BopError(f"{path}: is missing; restore it or remove its entry") from error
    except (OSError, SyntaxError, ValueError, Image.DecompressionBombError) as error:
        raise BopError(f"{path}: is not a readable image ({error})") from error
