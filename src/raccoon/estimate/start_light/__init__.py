"""The start light: its calibration, and the detector that fires when the lamp over the sensor goes on."""

from raccoon.estimate.start_light.calibration import StartLightCalibration, calibrate_start_light
from raccoon.estimate.start_light.detector import StartLight, StartLightReading

__all__ = [
    "StartLight",
    "StartLightCalibration",
    "StartLightReading",
    "calibrate_start_light",
]
