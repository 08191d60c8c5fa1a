"""What habits leave open of the numbers that are named."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from diagnoses import make_cause
from raccoon.diagnose.habits.notes import MAY_BE_READ_TIME, with_habit_uncertainty
from raccoon.diagnose.reports.cause_text import describe_cause
from raccoon.diagnose.result import ParameterResult
from raccoon.diagnose.rollout.firmware import FIRMWARES
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.sim.effects.chain import Chain


@pytest.mark.parametrize(
    ("firmware", "std"), [(None, 0.015), ("wombat-raccoon-17", 0.011), ("simulator", 0.003)], ids=str
)
def test_when_a_battery_is_read_leaves_its_resistance_open(firmware: str | None, std: float) -> None:
    """0.17 ohm was 0.184 or 0.197, each +- 0.003, by when in a row the reading was taken."""
    number = {"resistance": ParameterResult(0.184, 0.003, "ohm", 0.05)}
    found = make_cause("battery.internal_resistance", number, "")
    other = replace(found, id="friction.coulomb")
    known = None if firmware is None else FIRMWARES[firmware]
    (wider, same) = with_habit_uncertainty((found, other), Habits(Chain(), False, firmware=known))
    assert wider.parameters["resistance"].std == pytest.approx(std, abs=0.0006)
    assert same == other


@pytest.mark.parametrize(
    ("name", "firmware", "smooths", "std"),
    [
        ("actuation.latency", None, False, 0.00145),
        ("actuation.latency", "wombat-stock", True, 0.0001),
        ("actuation.latency", "simulator", False, 0.0001),
        ("imu.latency", None, False, 0.0032),
        ("imu.latency", None, True, 0.0025),
        ("imu.latency", "wombat-raccoon-21", True, 0.0001),
    ],
)
def test_when_samples_are_taken_leaves_a_latency_open(
    name: str, firmware: str | None, smooths: bool, std: float
) -> None:
    """Of a controller whose samples were 4.3 ms old in each row a latency of 14.7 ms was said to be
    17.3 +- 0.12, and a gyro 20.6 ms late, whose chip smooths, 26.0 +- 0.2; and one of 1.2 ms, which is none,
    had a probability of 1."""
    found = make_cause(name, {"seconds": ParameterResult(0.0012, 0.0001, "s", 0.0)}, "")
    known = None if firmware is None else FIRMWARES[firmware]
    (wider,) = with_habit_uncertainty((found,), Habits(Chain(), False, low_pass=smooths, firmware=known))
    assert wider.parameters["seconds"].std == pytest.approx(std, abs=0.00005)
    unsure = 1.0 / (1.0 + math.exp(-0.5 * (0.0012 / std) ** 2))
    assert wider.probability == pytest.approx(min(found.probability, unsure), abs=0.01)


def test_of_what_has_rivals_a_number_says_nothing_of_its_probability() -> None:
    found = replace(
        make_cause("imu.latency", {"seconds": ParameterResult(0.0012, 0.0001, "s", 0.0)}, ""),
        confounded_with=("drive.wheel_slip",),
    )
    (wider,) = with_habit_uncertainty((found,), Habits(Chain(), False))
    assert wider.probability == found.probability


@pytest.mark.parametrize(
    ("late", "drifting", "free_running", "may_be_nothing"),
    [
        (0.0012, False, False, True),
        (0.0032, False, False, False),
        (0.0032, True, False, True),
        (0.0032, True, True, False),
        (0.012, True, False, False),
    ],
)
def test_what_may_be_the_moment_of_a_reading_alone_is_said_to_be(
    late: float, drifting: bool, free_running: bool, may_be_nothing: bool
) -> None:
    """What is within 1.75 of its deviations of what was assumed is not named, but these are widened when it
    has been. In rows of a program that sleeps for 10 ms a fault-free robot's samples were 2.5 ms old on
    average, of 5, and it was called 3.2 +- 1.5 ms late."""
    found = make_cause("actuation.latency", {"seconds": ParameterResult(late, 0.0001, "s", 0.0)})
    chain = Chain(free_running=free_running)
    (wider,) = with_habit_uncertainty((found,), Habits(chain, False), drifting)
    assert (wider.explanation != found.explanation) == may_be_nothing
    assert describe_cause(wider).more == (MAY_BE_READ_TIME if may_be_nothing else "")
    assert describe_cause(wider).todo == describe_cause(found).todo


@pytest.mark.parametrize(
    ("name", "parameter", "rival", "std"),
    [
        ("drive.wheel_slip", "time", "imu.latency", 0.0032),
        ("drive.wheel_slip", "time", "friction.coulomb", 0.0002),
        ("drive.wheel_slip", "time", "actuation.latency", 0.0002),
        ("bemf.filter_lag", "time_constant", "actuation.latency", 0.00145),
    ],
)
def test_what_may_be_a_latency_is_as_unsure_as_one(name: str, parameter: str, rival: str, std: float) -> None:
    """If a slip may be a late gyro, its time is no better known than when the gyro is read."""
    found = replace(
        make_cause(name, {parameter: ParameterResult(0.0096, 0.0002, "s", 0.0)}), confounded_with=(rival,)
    )
    (wider,) = with_habit_uncertainty((found,), Habits(Chain(), False))
    assert wider.parameters[parameter].std == pytest.approx(std, abs=0.00005)


def test_what_is_less_sure_is_said_with_fewer_places() -> None:
    found = make_cause("imu.latency", {"seconds": ParameterResult(0.00618, 0.0001, "s", 0.0)})
    (wider,) = with_habit_uncertainty((found,), Habits(Chain(), False))
    assert (describe_cause(found).what, describe_cause(wider).what) == tuple(
        f"Gyro readings come {number} ms late" for number in ("6.18", "6.2")
    )
    assert describe_cause(wider).todo == describe_cause(found).todo
