"""What motors do at duty 0, and robots that do both."""

from __future__ import annotations

from dataclasses import replace
from itertools import cycle

import numpy as np
import pytest
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.diagnose.diagnosis import diagnose
from raccoon.diagnose.drives.holdout import with_channels_of
from raccoon.diagnose.drives.log import log_from_columns
from raccoon.diagnose.drives.stops import MIXED_STOPS_NOTE, motors_brake, with_brake_by_stop
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.result import Verdict
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.rollout.commands import Commands
from raccoon.sim.rollout.rollout import rollout
from simulated_drives import NOISE

ROBOT = RobotConfig()
TIME = 0.005 * np.arange(3600)


def stops(
    kinds: tuple[bool, ...], ramp: float = 0.0
) -> tuple[dict[str, NDArray[np.float64]], NDArray[np.bool_]]:
    """Power for half a second, rest for as long, to both sides; each rest in its turn brakes or coasts.

    ramp: s in which the power of every third second ends before its rest, of a robot with little friction.
    """
    braking = np.zeros(len(TIME), bool)
    for second, kind in zip(range(18), cycle(kinds), strict=False):
        braking[np.floor(TIME) == second] = kind
    duty = np.where(TIME % 1.0 < 0.5, 0.8, 0.0) * np.where(TIME % 4.0 < 2.0, 1.0, -0.6)
    if ramp:
        duty *= np.where(TIME % 3.0 >= 2.0, np.clip((0.5 - TIME % 1.0) / ramp, 0.0, 1.0), 1.0)
    left, right = duty, np.where(TIME % 3.0 < 1.0, 0.6 * duty, duty)
    commands = Commands.of_wheels(TIME, left, right, braking)
    robot = Parameters.from_robot(ROBOT)
    if ramp:
        robot = robot.with_effect("friction.coulomb", torque=0.1)
    run = rollout([robot], commands, channels=tuple(NOISE), longest_step=0.001)
    rng = np.random.default_rng(7)
    columns = {name: run[name][0] + size * rng.standard_normal(len(TIME)) for name, size in NOISE.items()}
    return columns | {"t": TIME, "motor.0.duty": left, "motor.1.duty": right}, braking & (duty == 0.0)


@pytest.mark.parametrize("kinds", [(True,), (False,)])
def test_a_robot_that_stops_in_one_way_is_asked_as_before(kinds: tuple[bool, ...]) -> None:
    columns, _ = stops(kinds)
    log = log_from_columns(columns, ROBOT)
    assert with_brake_by_stop(log) is log
    assert motors_brake(log) is kinds[0]


def test_a_robot_that_does_both_is_taken_as_its_wheels_show() -> None:
    columns, braking = stops((True, False, False, True, True))
    log = with_brake_by_stop(log_from_columns(columns, ROBOT))
    assert log.brake is not None
    assert log.notes == (MIXED_STOPS_NOTE,)
    for side in (0, 1):
        idle = log.duty[:, side] == 0.0
        assert np.array_equal(log.brake[idle, side], braking[idle])


def test_stops_of_both_kinds_are_no_loose_part() -> None:
    """Something was said to be loose, twist or jump."""
    columns, _ = stops((True, False, False, True, True))
    begun = {name: each[:2400] for name, each in columns.items()}
    found = diagnose(begun, ROBOT, causes=[each for each in drive_causes() if "friction." in each.id])
    assert (found.verdict, found.causes) == (Verdict.ADEQUATE, ())
    assert MIXED_STOPS_NOTE in found.notes
    assert not any("loose" in each for each in found.notes)


def test_rows_decide_where_they_say() -> None:
    columns, braking = stops((True, False))
    columns |= {f"motor.{port}.brake": braking.astype(float) for port in (0, 1)}
    log = log_from_columns(columns, ROBOT)
    assert with_brake_by_stop(log) is log


def test_walls_and_slow_wheels_are_no_brakes() -> None:
    """A wheel that a wall or friction alone stops at once was a robot that brakes now and then."""
    columns, _ = stops((False,))
    for start in (2.5, 6.5, 10.5):
        late = TIME - start
        for port in (0, 1):
            held = np.where(late < 0.0, 0.6, 0.0)  # it spins at the wall, and stops there at once
            columns[f"motor.{port}.bemf"] = (
                np.where(np.abs(late - 0.125) < 0.375, held, 1.0) * columns[f"motor.{port}.bemf"]
            )
    log = log_from_columns(columns, ROBOT)
    assert with_brake_by_stop(log) is log


@pytest.mark.parametrize("ramp", [0.15, 0.2, 0.25])
def test_a_ramp_down_is_no_brake(ramp: float) -> None:
    """Its reading is late to show what the command has slowed down before it ends."""
    columns, _ = stops((False,), ramp)
    log = log_from_columns(columns, ROBOT)
    assert with_brake_by_stop(log) is log


@pytest.mark.parametrize("brake", [True, False])
def test_what_is_judged_on_stops_as_it_does_where_only_the_other_says_how(brake: bool) -> None:
    """As of several that are fitted together: else its motors were taken to coast."""
    silent = log_from_columns(stops((brake,))[0], ROBOT)
    said = replace(silent, brake=np.ones(silent.duty.shape, bool))
    other = with_channels_of(said, silent)
    assert other.brake is not None
    assert (other.brake == brake).all()
    assert with_channels_of(silent, silent).brake is None
    assert with_channels_of(silent, said).brake is said.brake
