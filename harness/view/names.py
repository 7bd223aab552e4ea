"""What the viewer calls things: entities, their timeline, and the sets of test points.

::

    world                     z up, the Panda's base at the origin, metres
      camera                  pose and pinhole of each view
        rgb, depth            images
        found, found/boxes    the segmenter's masks, and boxes that name them
        true                  true masks
      arm/LINK                the Panda at the recorded joint angles
      map/by_class/view_N     voxels that view N was the first to occupy, in their class's colour
      map/by_colour/view_N    the same in the colour that was seen
      map/by_confidence       voxels of objects by their confidence
      tracker, tracker/names  tracked objects after each view as spheres, and their names above
      observed/ID             points of a tracked object's cloud
      completed/ID            points of its completed shape
      confidence/SET          test points by the model's confidence
      judged/SET              test points by whether the model is right
      training/object, free   what the models learned from
      true/N_NAME             true meshes
    legend, about             colours and numbers
"""

from __future__ import annotations

from harness.protocol import test_set_of

TIMELINE = "view"
"""Step n shows what was known after view n; the step after the last view shows the result."""

WORLD = "/world"
CAMERA = f"{WORLD}/camera"
RGB = f"{CAMERA}/rgb"
DEPTH = f"{CAMERA}/depth"
FOUND = f"{CAMERA}/found"
FOUND_BOXES = f"{FOUND}/boxes"
TRUE_MASKS = f"{CAMERA}/true"
ARM = f"{WORLD}/arm"
MAP = f"{WORLD}/map"
BY_CLASS = f"{MAP}/by_class"
BY_COLOUR = f"{MAP}/by_colour"
BY_CONFIDENCE = f"{MAP}/by_confidence"
TRACKER = f"{WORLD}/tracker"
TRACKER_NAMES = f"{TRACKER}/names"
OBSERVED = f"{WORLD}/observed"
COMPLETED = f"{WORLD}/completed"
CONFIDENCE = f"{WORLD}/confidence"
JUDGED = f"{WORLD}/judged"
TRAINING = f"{WORLD}/training"
TRUE = f"{WORLD}/true"
LEGEND = "/legend"
ABOUT = "/about"


def set_name(completion: str) -> str:
    """Name of a test set's entity by the completion that records state: ``box``, ``completed``."""
    return test_set_of(completion)
