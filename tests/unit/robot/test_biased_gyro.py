"""A gyro may read up to 5 degrees a second at rest: that is learnt as a bias, and a hand is not."""

import math
from collections.abc import Callable

import pytest

from raccoon import Robot, RobotConfig
from raccoon.core.clock import SteppedClock
from raccoon.hal.wombat.emulator import Drive, Emulator, Firmware, PlantState
from raccoon.hal.wombat.port import WombatPort
from raccoon.robot.emulated import SimulatedPlant
from raccoon.sim.effects.parameters import Parameters

REST = 400


class Reading(SimulatedPlant):
    """A robot that stands, and whose gyro reads something."""

    def __init__(self, config: RobotConfig, rate: Callable[[float], float]) -> None:
        super().__init__(Parameters.from_robot(config))
        self._rate, self._time = rate, 0.0

    def advance(self, seconds: float, drives: tuple[Drive, ...]) -> PlantState:
        state = super().advance(seconds, drives)
        self._time += seconds
        return state._replace(gyro=(0.0, 0.0, state.gyro[2] + self._rate(self._time)))


def standing(firmware: Firmware, rate: Callable[[float], float]) -> Robot:
    config, clock = RobotConfig(), SteppedClock()
    emulator = Emulator(Reading(config, rate), firmware, clock=clock, seed=2)
    robot = Robot(WombatPort(emulator, clock=clock), config)
    for _ in range(REST):
        robot.tick()
    return robot


@pytest.mark.parametrize(("firmware", "bias"), [("stock", -0.087), (21, 0.05)])
def test_a_large_bias_is_learnt_while_the_robot_stands(firmware: Firmware, bias: float) -> None:
    with standing(firmware, lambda _time: bias) as robot:
        here = robot.estimate
        assert here.gyro_bias == pytest.approx(bias, abs=4e-4)
        assert abs(here.heading) < 4.0 * here.heading_std
        assert here.heading_std < math.radians(0.6)


def test_a_hand_that_turns_a_robot_slowly_is_no_bias() -> None:
    with standing(21, lambda time: 0.08 + 0.03 * math.sin(9.0 * time)) as robot:
        assert robot.estimate.heading > math.radians(7.0)
