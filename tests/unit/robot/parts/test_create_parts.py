"""A Create has two motors, its wheels, and no servo: a servo that was sent somewhere "arrived" there."""

import pytest

from raccoon import Action, ConfigError, move, move_by, open_robot, release, seq, servo, servo_off, spin, zero
from raccoon.core.config import ControllerConfig, MechanismConfig, RobotConfig, ServoConfig
from robots import simulated_port

CONFIG = RobotConfig(
    controller=ControllerConfig(port="create"),
    servos={"claw": ServoConfig(0)},
    mechanisms={"arm": MechanismConfig(2)},
)


@pytest.mark.parametrize(
    ("action", "part"),
    [
        (servo("claw", 1500), "servo.claw"),
        (servo_off("claw"), "servo.claw"),
        (move("arm", 1.0), "mechanism.arm"),
        (move_by("arm", 1.0), "mechanism.arm"),
        (spin("arm", 1.0), "mechanism.arm"),
        (zero("arm"), "mechanism.arm"),
        (release("arm"), "mechanism.arm"),
    ],
    ids=lambda value: getattr(value, "name", value),
)
def test_a_part_that_a_create_has_no_port_for_is_refused_before_anything_moves(
    action: Action[object], part: str
) -> None:
    with open_robot(CONFIG, port=simulated_port()) as robot:
        with pytest.raises(ConfigError, match=f"{part}: a Create has no port for a .*; use a Wombat"):
            robot.run(seq(action))
        assert robot.ticks == 0
