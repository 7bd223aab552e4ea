"""What several test modules share besides fixtures."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import numpy.typing as npt

    from sim_scenes import Frame

BOX_HALF_M = np.array([0.04, 0.03, 0.05])
# The box's middle in its own frame: far from both its origin and its centre of mass.
BOX_MIDDLE_M = np.array([0.125, -0.0625, 0.25])


def ids(frame: Frame) -> npt.NDArray[np.uint16]:
    """Mask of a frame that has one."""
    assert frame.instance_ids is not None
    return frame.instance_ids
