"""A robot that somebody turns while it stands knows its heading all the same: its gyro tells it."""

import math

import pytest

from raccoon import Robot, RobotConfig
from raccoon.core.clock import SteppedClock
from raccoon.core.readings import Status
from raccoon.hal.wombat.emulator import Drive, Emulator, Firmware, PlantState
from raccoon.hal.wombat.port import WombatPort
from raccoon.robot.emulated import SimulatedPlant
from raccoon.sim.effects.parameters import Parameters

BEGIN, SECONDS, FASTEST = 0.5, 0.6, 3.0
"""s, s and rad/s at its middle."""


class Turned(SimulatedPlant):
    """A robot whose tyres slide over the table while a hand turns it."""

    def __init__(self, config: RobotConfig) -> None:
        super().__init__(Parameters.from_robot(config))
        self._time = 0.0

    def advance(self, seconds: float, drives: tuple[Drive, ...]) -> PlantState:
        state, since = super().advance(seconds, drives), self._time - BEGIN
        self._time += seconds
        rate = FASTEST * math.sin(math.pi * since / SECONDS) if 0.0 < since < SECONDS else 0.0
        return state._replace(gyro=(0.0, 0.0, state.gyro[2] + rate))


@pytest.mark.parametrize("firmware", ["stock", 21])
def test_a_robot_that_is_turned_by_hand_before_it_drives_keeps_its_heading(firmware: Firmware) -> None:
    config, clock = RobotConfig(), SteppedClock()
    emulator = Emulator(Turned(config), firmware, clock=clock, seed=2)
    with Robot(WombatPort(emulator, clock=clock), config) as robot:
        for _ in range(350):
            robot.tick()
        turned = 2.0 * FASTEST * SECONDS / math.pi
        assert robot.pose.heading == pytest.approx(turned, abs=math.radians(0.5))
        assert robot.estimate.status is Status.OK
        assert not robot.drive.remarks  # no IMU that says what cannot be
