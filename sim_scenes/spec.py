"""A family of scenes: everything about a scene but its seed."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field, fields, is_dataclass
from typing import Any, TypeVar

from sim_scenes.errors import SpecError
from sim_scenes.sensor import DepthNoise

Record = TypeVar("Record")


@dataclass(frozen=True)
class Arc:
    """Where the camera may stand: a limited arc beside the target.

    Attributes
    ----------
    azimuth_span_deg
        Width of the arc; the views share it evenly.
    azimuth_centre_deg
        Its middle, drawn from this range to either side: the angle at the target between the
        direction away from the robot's base and the direction to the camera. The Panda holds an
        upright image beside and before the target; behind it, its wrist cannot turn far enough.
    elevation_deg
        Range above the horizon.
    distance_m
        Range of the distance to the target's centre; grown where an object fills the image.
    """

    azimuth_span_deg: float = 90.0
    azimuth_centre_deg: tuple[float, float] = (95.0, 120.0)
    elevation_deg: tuple[float, float] = (33.0, 60.0)
    distance_m: tuple[float, float] = (0.34, 0.48)

    def __post_init__(self) -> None:
        if not 0 <= self.azimuth_span_deg <= 360:
            raise SpecError(f"azimuth_span_deg is {self.azimuth_span_deg}; it must lie in [0, 360]")
        _check_range("azimuth_centre_deg", self.azimuth_centre_deg, low=0, high=180)
        _check_range("elevation_deg", self.elevation_deg, low=5, high=85)
        _check_range("distance_m", self.distance_m, low=0.2, high=1.0)


@dataclass(frozen=True)
class Appearance:
    """What varies from seed to seed besides the geometry; off gives one fixed look."""

    textures: bool = True
    light: bool = True


@dataclass(frozen=True)
class SceneSpec:
    """A family of scenes.

    Attributes
    ----------
    category
        Category that the target is drawn from.
    models
        Names of the models to place, the target first; `category` is then left empty.
    objects
        Number of objects, drawn from this range, ends included; those not named are of any
        category.
    views
        Number of frames.
    image_size
        Width and height, pixels.
    arc, depth_noise, appearance
        See their own documentation.
    max_redraws
        Draws that may be rejected before the scene is given up with an error.
    """

    category: str = ""
    models: tuple[str, ...] = ()
    objects: tuple[int, int] = (1, 1)
    views: int = 3
    image_size: tuple[int, int] = (640, 480)
    arc: Arc = field(default_factory=Arc)
    depth_noise: DepthNoise = field(default_factory=DepthNoise)
    appearance: Appearance = field(default_factory=Appearance)
    max_redraws: int = 20

    def __post_init__(self) -> None:
        if bool(self.category) == bool(self.models):
            raise SpecError(
                f"category is '{self.category}' and models is {self.models}; give one of the two"
            )
        if len(set(self.models)) < len(self.models):
            raise SpecError(f"models is {self.models}; a scene holds each model once")
        low, high = self.objects
        if not 1 <= low <= high <= 8 or len(self.models) > 8:
            raise SpecError(
                f"a scene of {max(high, len(self.models))} objects (range {self.objects}); "
                "give 1 to 8 objects, the range as (least, most)"
            )
        if self.views < 1:
            raise SpecError(f"views is {self.views}; a scene needs at least 1")
        if not all(16 <= side <= 4096 for side in self.image_size):
            raise SpecError(
                f"image_size is {self.image_size}; both sides must lie in [16, 4096] pixels"
            )
        if self.max_redraws < 0:
            raise SpecError(f"max_redraws is {self.max_redraws}; it must be at least 0")

    @classmethod
    def single(cls, category: str, **settings: Any) -> SceneSpec:
        """Describe one object of a category, as in the seed."""
        return cls(category=category, **settings)

    @classmethod
    def clutter(cls, category: str = "", **settings: Any) -> SceneSpec:
        """Describe 2 to 5 objects of mixed categories, seen from further away."""
        arc = Arc(distance_m=(0.42, 0.55), elevation_deg=(40.0, 62.0), azimuth_span_deg=70.0)
        return cls(category=category, **{"objects": (2, 5), "arc": arc, **settings})

    @property
    def title(self) -> str:
        """A few words that name the family in messages."""
        what = "+".join(self.models) or self.category
        low, high = self.objects
        crowd = "" if high == 1 else f" among {low} to {high} objects"
        return f"{what}{crowd}, {self.views} views"

    def to_dict(self) -> dict[str, Any]:
        """Plain values, for JSON."""
        return asdict(self)

    @classmethod
    def from_dict(cls, values: dict[str, Any]) -> SceneSpec:
        """Rebuild a spec from `to_dict`, also after JSON has made lists of its tuples."""
        return _record_from(cls, values)


def _record_from(record: type[Record], values: object) -> Record:
    defaults = {"arc": Arc, "depth_noise": DepthNoise, "appearance": Appearance}
    if not isinstance(values, dict) or not is_dataclass(record):
        raise SpecError(f"{record.__name__} is {values!r}; it must be a table of its settings")
    known = {item.name for item in fields(record)}
    unknown = sorted(set(values) - known)
    if unknown:
        raise SpecError(f"{record.__name__} has no setting '{unknown[0]}'; known: {sorted(known)}")
    given = {
        name: _record_from(defaults[name], value)
        if name in defaults
        else tuple(value)
        if isinstance(value, list)
        else value
        for name, value in values.items()
    }
    try:
        return record(**given)
    except (TypeError, ValueError) as error:
        raise SpecError(f"{record.__name__}: {error}") from error


def _check_range(name: str, limits: tuple[float, float], *, low: float, high: float) -> None:
    if not (low <= limits[0] <= limits[1] <= high and all(map(math.isfinite, limits))):
        raise SpecError(f"{name} is {limits}; give (least, most) within [{low}, {high}]")
