"""Tophats (reflectance sensors): white or black, in any light. See docs/tophats.md.

`calibrate` finds both surfaces in the readings of a drive; `Tophat` says at every tick what a sensor sees.
"""

from raccoon.estimate.tophat.calibration import TophatCalibration, Verdict
from raccoon.estimate.tophat.classifier import Edge, Tophat, TophatReading
from raccoon.estimate.tophat.cluster import calibrate, calibrate_two_phase
from raccoon.estimate.tophat.group import TophatGroup

__all__ = [
    "Edge",
    "Tophat",
    "TophatCalibration",
    "TophatGroup",
    "TophatReading",
    "Verdict",
    "calibrate",
    "calibrate_two_phase",
]
