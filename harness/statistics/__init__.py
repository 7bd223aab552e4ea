"""What differs and how surely: intervals, paired tests, and tests in families.

Scenes of one object are alike, so that everywhere objects are the units: they are resampled, and
change sign, with all their scenes.
"""

from harness.statistics.discovery import benjamini_hochberg
from harness.statistics.intervals import (
    LEAST_OBJECTS,
    MeanEstimate,
    bootstrap_interval,
    mean_estimate,
)
from harness.statistics.paired import ALPHA, LEAST_TESTED, POWER, PairedTest, paired_test

__all__ = [
    "ALPHA",
    "LEAST_OBJECTS",
    "LEAST_TESTED",
    "POWER",
    "MeanEstimate",
    "PairedTest",
    "benjamini_hochberg",
    "bootstrap_interval",
    "mean_estimate",
    "paired_test",
]
