"""What is true, as the simulated controller says it."""

import math
from statistics import mean, stdev
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from raccoon.core.config import RobotConfig
from raccoon.sim.bystander import SimulatedBystander
from raccoon.sim.effects.chain import Noise
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.effects.physical import plant_numbers, state_at_rest
from raccoon.sim.port import SimPort
from raccoon.sim.words import AnalogConverter, Imu, NormalNumbers
from raccoon.sim.world.table import World


def test_a_gyro_that_drifts_has_drifted_by_its_age() -> None:
    """A robot at rest, 2 s after the start."""
    drifting = Parameters.from_robot(RobotConfig()).with_effect("imu.gyro_drift", rate_per_second=0.01)
    port = SimPort(drifting, World.empty(), noise=False)
    inputs = [port.read() for _ in range(401)]
    assert inputs[0].turn_rate == pytest.approx(0.0, abs=inputs[0].device.gyro_rad_s)
    assert inputs[-1].time == pytest.approx(2.0)
    assert inputs[-1].turn_rate == pytest.approx(0.02, abs=inputs[-1].device.gyro_rad_s)


def test_no_reading_of_the_imu_comes_late_as_the_steps_of_a_long_run_add_up() -> None:
    """Those of 1 ms are 36 ns short after half an hour, and after 335 s a reading was a cycle late."""
    imu = Imu(Parameters(), Noise.none(), NormalNumbers(np.random.default_rng(1)), 50.0, 0.0)
    state = state_at_rest(plant_numbers(Parameters()))
    for number in range(500):
        time = number * 0.02 - 36e-9
        assert imu.read(state._replace(time=time), (0.0, 0.0)) is not None


def test_the_noise_of_a_tophat_is_beside_the_converter_s() -> None:
    tophat: Any = SimpleNamespace(port=2, noise_sd=8.0, read=lambda *_: (1000.0, False))
    converter = AnalogConverter(
        [tophat], Noise(analog=6.0), NormalNumbers(np.random.default_rng(1)), SimulatedBystander()
    )
    read = []
    for _ in range(4000):
        words, surface = converter.analog(World.empty(), (0.0, 0.0, 0.0), (1.0, 0.0), 0.0)
        assert surface[2] is False
        read.append(float(words[2] or 0.0))
    assert mean(read) == pytest.approx(1000.0, abs=4.0 * 10.0 / math.sqrt(4000))
    assert stdev(read) == pytest.approx(math.hypot(6.0, 8.0), rel=0.05)


def test_a_sensor_that_scatters_by_nothing_leaves_the_others_their_noise() -> None:
    usual, still = (
        SimPort(Parameters(), World.empty(), noise=each, seed=3)
        for each in (Noise(), Noise(battery=0.0, analog=0.0))
    )
    for _ in range(5):
        one, other = usual.read(), still.read()
        assert (one.bemf, one.gyro, one.accel) == (other.bemf, other.gyro, other.accel)
    assert one.analog != other.analog
