"""Our kernels timed beside their peers, in one run on one machine."""

from __future__ import annotations
