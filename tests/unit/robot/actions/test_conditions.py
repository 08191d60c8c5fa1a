"""A condition that ends what blocked the robot does not end at once what leads away from it."""

from dataclasses import replace

import pytest

from raccoon import (
    Condition,
    ConfigError,
    MotionTimeout,
    after_distance,
    bumped,
    button_pressed,
    drive,
    open_robot,
    race,
    seq,
    stalled,
    wait,
    wait_for,
    when,
)
from raccoon.core.clock import SteppedClock
from raccoon.core.config import ControllerConfig
from raccoon.core.readings import Inputs
from raccoon.hal.wombat.emulator import Emulator, Firmware
from raccoon.hal.wombat.port import WombatPort
from raccoon.robot.emulated import SimulatedPlant
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.sim.world.table import Wall, World
from robots import CONFIG, InterceptingPort, simulated_port

WALL = World(walls=(Wall((0.29, -1.0), (0.29, 1.0)),))
"""Met after 0.2 m."""


def walled() -> SimPort:
    """The simulated robot before a wall, with drivers that give 0.5 A: a push that its tyres hold."""
    return simulated_port(world=WALL, effects={"motor.current_limit": {"limit": 0.5}})


class Struck(InterceptingPort):
    """The simulated robot, which is struck once on its way, from the front."""

    def __init__(self) -> None:
        super().__init__(seen=self._felt)
        self._struck: float | None = None

    def _felt(self, inputs: Inputs) -> Inputs:
        assert inputs.truth is not None
        assert inputs.accel is not None
        if self._struck is None and inputs.truth.x > 0.2:
            self._struck = inputs.time
        if self._struck is None or inputs.time - self._struck > 0.03:
            return inputs
        return replace(inputs, accel=(-15.0 / inputs.device.accel_m_s2, *inputs.accel[1:]))


def test_a_robot_backs_off_from_what_stalls_it() -> None:
    with open_robot(CONFIG, port=walled()) as robot:
        robot.run(wait(0.5))
        robot.run(seq(drive(0.15).until(stalled()), drive(-0.15).until(stalled() | after_distance(0.1))))
        assert robot.inputs is not None
        assert robot.inputs.truth is not None
        assert robot.inputs.truth.x == pytest.approx(0.1, abs=0.02)


def test_wheels_that_spin_at_a_wall_are_not_stalled() -> None:
    with open_robot(CONFIG, port=simulated_port(world=WALL)) as robot:
        robot.run(wait(0.5))
        with pytest.raises(MotionTimeout):
            robot.run(drive(0.15).until(stalled()).timeout(3.0))


def test_a_robot_backs_off_from_what_struck_it() -> None:
    with open_robot(CONFIG, port=Struck()) as robot:
        robot.run(wait(0.5))
        robot.run(drive(0.15).until(bumped()).timeout(3.0))
        struck = robot.estimate.distance
        assert 0.19 < struck < 0.23
        robot.run(drive(-0.15).until(bumped() | after_distance(0.1)))
        assert robot.estimate.distance == pytest.approx(struck - 0.1, abs=0.01)


def test_a_wheel_that_goes_on_standing_still_is_stalled() -> None:
    with open_robot(CONFIG, port=walled()) as robot:
        robot.run(wait(0.5))
        robot.run(race(drive(0.15), seq(wait_for(stalled()), wait_for(stalled()))).timeout(6.0))


def test_what_still_holds_is_not_its_opposite() -> None:
    with open_robot(CONFIG, port=walled()) as robot:
        robot.run(wait(0.5))
        stuck = seq(wait_for(stalled()), wait_for(~stalled()))
        assert robot.run(race(drive(0.15), stuck, seq(wait_for(stalled()), wait(0.5))))[0] == 2


def test_what_holds_at_the_start_is_turned_round_in_a_composition_as_alone() -> None:
    """Of a wheel that stalls already: not anew, but it does."""
    stalls = Condition("stalls", lambda _: lambda: False, opposed=lambda _: lambda: True)
    with open_robot(CONFIG, port=simulated_port()) as robot:
        robot.tick()
        for inverted in (~stalls, ~(stalls | stalls), ~(stalls & stalls), ~stalls & ~stalls, ~(~~stalls)):
            assert inverted.start(robot)() is False, inverted
        for anew in (stalls, ~~stalls, ~(~stalls & ~stalls)):
            assert anew.start(robot)() is False, anew
        assert (~(stalls & when(lambda _: False))).start(robot)() is True


@pytest.mark.parametrize("firmware", ["stock", 21])
def test_the_controllers_own_button_ends_a_wait_on_both_firmwares(firmware: Firmware) -> None:
    clock = SteppedClock()
    plant = SimulatedPlant(Parameters.from_robot(CONFIG))
    port = WombatPort(Emulator(plant, firmware, clock=clock), clock=clock)
    with open_robot(CONFIG, port=port) as robot:
        with pytest.raises(MotionTimeout):
            robot.run(wait_for(button_pressed()).timeout(0.1))
        assert robot.button is False
        plant.button = True
        robot.run(wait_for(button_pressed()).timeout(0.1))
        robot.run(seq(wait(0.1), wait_for(~button_pressed() | button_pressed())))
        assert not robot.drive.remarks


def test_a_simulated_button_is_pressed_for_who_waits_for_it_alone_or_by_who_says_so() -> None:
    port = simulated_port()
    with open_robot(CONFIG, port=port) as robot:
        robot.run(wait_for(button_pressed()).timeout(1.0))
        assert robot.time == pytest.approx(0.5, abs=0.02)
        told = [robot.button]
        robot.run(wait(0.25))
        assert [*told, robot.button] == [True, False]
        assert not robot.drive.remarks
        with pytest.raises(MotionTimeout):
            robot.run(wait_for(button_pressed() | button_pressed()).timeout(1.0))
        assert any("a simulated button is pressed only for" in said for said in robot.drive.remarks.values())
        port.button = True
        robot.run(wait_for(button_pressed()).timeout(0.1))


def test_a_controller_without_a_button_says_so_before_anything_moves() -> None:
    config = replace(CONFIG, controller=ControllerConfig(port="create"))
    with open_robot(config, port=simulated_port()) as robot:
        with pytest.raises(ConfigError, match=r"a Create has no such button: .*pressed\(8\)"):
            robot.run(seq(drive(0.1), wait_for(button_pressed())))
        assert robot.ticks == 0
