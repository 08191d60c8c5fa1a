"""Motors that have power and do not turn, in what has no goal and so never gives up by itself."""

from collections.abc import Callable
from typing import Any

import pytest

from raccoon import (
    MotionTimeout,
    Robot,
    align_on_wall,
    deg,
    drive,
    motors,
    move,
    open_robot,
    spin,
    straight,
    wait,
)
from raccoon.core.config import MechanismConfig, RobotConfig
from raccoon.hal.wombat.emulator import Emulator, Firmware
from raccoon.robot.emulated import open_emulated
from raccoon.sim.world.table import World

ARM = RobotConfig(mechanisms={"arm": MechanismConfig(2)})


def own_loop(robot: Robot) -> None:
    for _ in range(280):
        robot.drive.velocity(0.12, -2.0 * robot.pose.heading)
        robot.tick()


def unplugged(firmware: Firmware, motor: int, act: Callable[[Robot], Any]) -> Robot:
    """The robot after `act`, whose motor comes off 0.2 s after its beginning."""
    port = open_emulated(ARM, firmware, world=World.empty())
    with open_robot(ARM, port=port) as robot:
        robot.run(wait(0.3))
        link, off, read = port._link, robot.time + 0.2, port.read
        assert isinstance(link, Emulator)

        def reading() -> Any:
            inputs = read()
            if inputs.time > off:
                link.faults.blown_fuse = {motor}
            return inputs

        port.read = reading  # type: ignore[method-assign]
        act(robot)
        return robot


@pytest.mark.parametrize(
    ("firmware", "motor", "name", "act"),
    [
        ("stock", 0, "left (motor port 0)", own_loop),
        (
            "stock",
            1,
            "right (motor port 1)",
            lambda robot: robot.run(motors(0.4, 0.4).timeout_or(1.4, wait(0.1))),
        ),
        (21, 0, "left (motor port 0)", lambda robot: robot.run(drive(0.12).timeout_or(1.4, wait(0.1)))),
        (21, 2, "arm (motor port 2)", lambda robot: robot.run(spin("arm", 1.0).timeout_or(1.4, wait(0.1)))),
    ],
    ids=["own loop", "motors", "drive", "spin"],
)
def test_a_motor_that_comes_off_is_said(
    firmware: Firmware, motor: int, name: str, act: Callable[[Robot], Any]
) -> None:
    said = unplugged(firmware, motor, act).drive.remarks.values()
    assert f"power but no motion at {name}: blocked, unplugged, or a tripped fuse" in said


def test_what_holds_or_turns_is_not_said() -> None:
    def act(robot: Robot) -> None:
        robot.run(move("arm", deg(30)))
        robot.run(straight(0.1))
        robot.run(wait(1.2))

    assert not any("power but no" in each for each in unplugged("stock", 3, act).drive.remarks.values())


def test_one_wheel_that_stands_is_no_wall() -> None:
    with pytest.raises(
        MotionTimeout, match=r"no wall after 2 s: only the left wheel stands still \(motor port 0\)"
    ):
        unplugged("stock", 0, lambda robot: robot.run(align_on_wall(0.08, timeout=2.0)))
