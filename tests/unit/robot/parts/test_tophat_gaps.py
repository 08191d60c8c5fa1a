"""A tophat that is not read for some cycles while the robot drives on."""

import numpy as np

from raccoon.core.config import TophatConfig
from raccoon.core.readings import SIMULATOR, Inputs, Status
from raccoon.estimate.tophat.calibration import Surface, TophatCalibration, Verdict
from raccoon.estimate.tophat.calibration_watch import Fit
from raccoon.model import reflectance
from raccoon.robot.parts.tophats import TophatSensor

WAY, HEIGHT = 0.0012, 0.007


def read(sensor: TophatSensor, inputs: Inputs) -> None:
    """A cycle of a robot with this tophat alone."""
    doubtful = sensor.take(inputs, WAY)
    if doubtful is not None:
        doubtful.run_banks((doubtful,))
    sensor.classify(inputs, WAY)


def test_the_way_of_cycles_without_a_reading_is_driven_all_the_same() -> None:
    optics = reflectance.fit("new").at(HEIGHT, 1.0)
    radius = reflectance.spot_radius(HEIGHT)
    dark = reflectance.line_coverage(np.arange(0.0, 0.15, WAY), 0.09, 0.03, radius)
    counts = reflectance.read(np.random.default_rng(4), dark, optics)
    surfaces = Surface(1270.0, 5.0, 400), Surface(3800.0, 8.0, 60)
    calibration = TophatCalibration.of_surfaces(Verdict.OK, "", *surfaces, share_black=0.1)
    for start in range(50, 64):
        sensor = TophatSensor("front", TophatConfig(analog=0))
        sensor.calibrate(calibration)
        for index, each in enumerate(counts):
            word = None if start <= index < start + 9 else int(each)
            inputs = Inputs(0.005 * index, SIMULATOR, analog=(word, *[None] * 5))
            read(sensor, inputs)
            if index > start + 9:
                assert sensor.status is Status.OK


def test_only_driving_while_it_is_read_proves_a_calibration() -> None:
    """After 5 s of that, readings of neither surface are another light, which is followed."""
    surfaces = Surface(1270.0, 5.0, 400), Surface(3800.0, 8.0, 60)
    for silent, fit in ((range(20, 280), Fit.CHANGED), (range(0), Fit.FITS)):
        sensor = TophatSensor("front", TophatConfig(analog=0))
        sensor.calibrate(TophatCalibration.of_surfaces(Verdict.OK, "", *surfaces, share_black=0.1))
        for index in range(460):
            word = None if index in silent else 1270.0 if index < 300 else 2300.0
            read(sensor, Inputs(0.02 * index, SIMULATOR, analog=(word, *[None] * 5)))
        assert sensor.check(9.2) is fit
