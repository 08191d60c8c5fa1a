"""Both wheels are pushed about alike; what only one of them has is no noise."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from blind.drives import exciting
from raccoon.core.config import RobotConfig
from raccoon.diagnose.diagnosis import diagnose
from raccoon.diagnose.reports.unknown_text import depends_text
from raccoon.diagnose.result import Verdict
from raccoon.diagnose.unknown.one_sided_error import find_one_sided_error
from raccoon.sim.effects.chain import Chain, Noise
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.rollout.commands import Commands
from raccoon.sim.rollout.rollout import rollout
from simulated_drives import BLIND_CONTROLLER

Array = NDArray[np.float64]
ROLES = ("bemf_left", "bemf_right", "gyro")
EVENT = 25
FAST = np.array([1500.0, -1500.0, 0.5])


def left_of(sizes: tuple[float, float], seconds: int = 20) -> Array:
    """What is left of a drive, as large as that of the wheels."""
    random = np.random.default_rng(1)
    return np.array([*sizes, 0.01]) * random.standard_normal((2 * EVENT * seconds, 3))


def said_of(
    left: Array, speed: Array = FAST, roles: tuple[str, ...] = ROLES, counting: tuple[float, ...] = (0.4,) * 3
) -> str | None:
    found = find_one_sided_error(roles, np.full(left.shape, speed), left, EVENT, counting)
    return found and found[0]


def test_a_wheel_that_is_several_times_as_far_off_is_unknown() -> None:
    assert said_of(left_of((8.0, 40.0))) == "right wheel alone"
    assert said_of(left_of((150.0, 8.0))) == "left wheel alone"
    found = find_one_sided_error(
        ROLES, np.full((1000, 3), FAST), np.full((1000, 3), [150.0, 8.0, 0.01]), EVENT, (0.4,) * 3
    )
    assert found is not None
    assert found[1].startswith(
        "the remaining error of the left wheel is 150 counts all the time, that of the right one 8"
    )
    assert depends_text(["left wheel alone"]) == "the left wheel alone"


def test_wheels_that_are_alike_or_little_off_are_not() -> None:
    assert said_of(left_of((30.0, 60.0))) is None
    assert said_of(left_of((1.0, 7.0))) is None


def test_a_wheel_that_stands_or_is_read_in_another_way_is_no_measure_of_the_other() -> None:
    left = left_of((0.5, 40.0))
    assert said_of(left, np.array([20.0, 1500.0, 0.5])) is None
    assert said_of(left, roles=("speed_left", "bemf_right", "gyro")) is None
    assert said_of(left[:, 1:], FAST[1:], ROLES[1:]) is None


def test_what_a_counter_in_whole_ticks_does_not_show_is_no_error_of_its_wheel() -> None:
    """A reading that was missing and derived from whole ticks was 27 counts off on a fault-free robot, the
    other wheel's 3.7."""
    left = left_of((27.0, 3.7))
    assert said_of(left) == "left wheel alone"
    assert said_of(left, counting=(27.2, 0.4, 0.0)) is None
    assert said_of(left_of((40.0, 3.7)), counting=(27.2, 0.4, 0.0)) == "left wheel alone"


def test_a_short_drive_and_a_few_moments_say_nothing() -> None:
    assert said_of(left_of((8.0, 40.0), seconds=6)) is None
    bumped = left_of((8.0, 8.0))
    for second in (3, 9, 14):
        bumped[2 * EVENT * second : 2 * EVENT * second + EVENT, 0] += 300.0
    assert said_of(bumped) is None


def test_a_motor_that_loses_contact_at_random_is_not_adequate() -> None:
    """A plug that gives its motor 0.8 of the duty for 60 ms now and then: no cause and no curve has that."""
    random = np.random.default_rng(6)
    duty = exciting(random, 12.0)
    time = np.arange(len(duty)) * 0.005
    loose = np.repeat(random.random(len(duty) // 12 + 1) < 0.2, 12)[: len(duty)]
    commands = Commands.of_wheels(time, np.where(loose, 0.8, 1.0) * duty[:, 0], duty[:, 1], False)
    run = rollout(
        Parameters.from_robot(RobotConfig()).with_chain(Chain.firmware()), commands, noise=Noise(), seed=3
    )
    columns = {name: np.array(run[name][0]) for name in run.channels if not name.startswith("truth.")}
    columns |= {"t": time, "motor.0.duty": duty[:, 0], "motor.1.duty": duty[:, 1]}
    said = diagnose(columns, RobotConfig(), firmware=BLIND_CONTROLLER)
    assert said.verdict is Verdict.UNKNOWN
    assert said.unexplained.depends_on == ("left wheel alone",)
    assert [note for note in said.notes if note.startswith("the remaining error of the left wheel is ")]
