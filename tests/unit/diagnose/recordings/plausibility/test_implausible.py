"""Numbers that no robot has, and commands that are speeds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from diagnoses import factor_parameters, make_cause, make_diagnosis
from raccoon.core.config import RobotConfig
from raccoon.core.readings import BEMF_VOLTS_PER_COUNT
from raccoon.diagnose.drives.log import log_from_columns
from raccoon.diagnose.drives.speed_loop import find_speed_loop
from raccoon.diagnose.recordings import drive as drive_diagnosis
from raccoon.diagnose.recordings.diagnosis import diagnose_recording
from raccoon.diagnose.recordings.plausibility.implausible import (
    diagnose_speed_commands,
    with_plausibility_hints,
)
from raccoon.diagnose.reports.cause_text import describe_cause
from raccoon.diagnose.reports.terminal import terminal_report
from raccoon.diagnose.result import Diagnosis, ParameterResult, Verdict

Columns = dict[str, NDArray[np.float64]]
ROBOT = RobotConfig()
RESISTANCE = "motor.armature_resistance"


def driven(friction: float, per_duty: float = 5.0, right: float = 1.0) -> Columns:
    """Wheels at several commands for a second each, of which friction takes so many V."""
    time = np.arange(0.0, 16.0, 0.005)
    levels = np.array([0.3, 0.6, -0.4, 0.8, -0.6, 0.5, -0.3, 0.7])
    duty = levels[(time.astype(int) // 1) % len(levels)]
    rng = np.random.default_rng(1)
    found = {"t": time, "battery.voltage": 6.7 + 0.01 * rng.standard_normal(len(time))}
    for port, share in ((0, 1.0), (1, right)):
        volts = per_duty * share * duty - friction * np.sign(duty)
        found[f"motor.{port}.duty"] = duty
        found[f"motor.{port}.bemf"] = volts / BEMF_VOLTS_PER_COUNT + 3.0 * rng.standard_normal(len(time))
    return found


def slowly(columns: Columns) -> Columns:
    """The same of wheels that take time to change their speeds."""
    kernel = np.exp(-0.005 / 0.06 * np.arange(200))
    smooth = {
        name: np.convolve(each, kernel / kernel.sum())[: len(each)]
        for name, each in columns.items()
        if name.endswith(".bemf")
    }
    return columns | smooth


def test_a_loop_takes_friction_from_no_speed() -> None:
    found = find_speed_loop(log_from_columns(driven(0.02), ROBOT), ROBOT)
    assert found is not None
    assert found.counts == pytest.approx(5.0 / BEMF_VOLTS_PER_COUNT, rel=0.01)
    assert found.taken == pytest.approx(0.02, abs=0.01)
    still = replace(log_from_columns(driven(0.02), ROBOT), duty=np.full((3200, 2), 0.5))
    assert find_speed_loop(still, ROBOT) is None  # one command
    for other in (driven(0.3), driven(0.02, right=0.9)):  # friction; two motors that are not alike
        assert find_speed_loop(log_from_columns(other, ROBOT), ROBOT) is None


def test_a_duty_of_a_robot_that_rubs_less_is_no_speed() -> None:
    """robot.toml of another robot: a command of 1 was the battery's voltage, and friction a third."""
    less = driven(0.09, per_duty=6.65)
    assert find_speed_loop(log_from_columns(less, ROBOT), ROBOT) is None
    assert find_speed_loop(log_from_columns(driven(0.01, per_duty=6.65), ROBOT), ROBOT) is not None
    found = with_plausibility_hints(
        make_diagnosis(make_cause(RESISTANCE, factor_parameters(0.3))), less, ROBOT
    )
    assert "is it this robot's?" in found.causes[0].explanation


def test_commands_that_are_clearly_speeds_are_told_before_a_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """40 s of them took some minutes of searching, after which nothing was named."""
    monkeypatch.setattr(drive_diagnosis, "diagnose", None)
    found = diagnose_recording(slowly(driven(0.02)), ROBOT)
    assert (found.verdict, found.causes, found.model) == (Verdict.NOT_IDENTIFIABLE, (), None)
    assert any("hold a speed, not a duty" in each.text for each in found.sensor_faults)
    assert RESISTANCE in {each.id for each in found.rejected}
    for other in (driven(0.05), driven(0.3)):  # a guess, and a duty
        assert diagnose_speed_commands(slowly(other), ROBOT, None) is None


@pytest.mark.parametrize("id_", [RESISTANCE, "drive.inertia"])
def test_commands_that_are_speeds_are_no_winding_of_a_fifth(id_: str) -> None:
    """It was "explained", by a winding resistance 82 % lower than assumed."""
    found = with_plausibility_hints(
        make_diagnosis(
            make_cause(id_, factor_parameters(0.18)), make_cause("bemf.scale", factor_parameters(0.74))
        ),
        driven(0.02),
        ROBOT,
    )
    assert (found.verdict, found.causes, found.model) == (Verdict.NOT_IDENTIFIABLE, (), None)
    assert "Commands: the columns motor.0.duty and motor.1.duty hold a speed, not a duty" in terminal_report(
        found
    )
    assert {each.id for each in found.rejected} == {id_, "bemf.scale"}


def test_a_number_that_no_motor_has_is_doubted() -> None:
    found = with_plausibility_hints(
        make_diagnosis(make_cause(RESISTANCE, factor_parameters(0.2))), driven(0.3), ROBOT
    )
    assert found.verdict is Verdict.PARTLY
    (doubted,) = found.causes
    assert "No motor's winding is that far off" in doubted.explanation
    assert describe_cause(doubted).todo == "calibrate the motors (raccoon tune wheels)"
    assert describe_cause(doubted).more.startswith("No motor's winding")


@pytest.mark.parametrize(
    ("id_", "value"), [(RESISTANCE, 1.9), ("drive.inertia", 0.2), ("drive.track_width", 1.75)]
)
def test_what_a_robot_may_have_is_not(id_: str, value: float) -> None:
    found = make_diagnosis(make_cause(id_, factor_parameters(value)))
    assert with_plausibility_hints(found, driven(0.3), ROBOT) is found


def test_where_nothing_is_named_a_loop_is_a_guess() -> None:
    unknown = replace(make_diagnosis(), verdict=Verdict.UNKNOWN)
    found = with_plausibility_hints(unknown, driven(0.05), ROBOT)
    assert found.verdict is Verdict.UNKNOWN
    assert "seem to hold a speed" in found.sensor_faults[0].text
    assert with_plausibility_hints(unknown, driven(0.3), ROBOT) is unknown


@pytest.mark.parametrize(
    ("id_", "parameter", "nominal", "usual", "strange", "said"),
    [
        ("actuation.deadband", "duty", 0.0, 0.25, 0.38, "No motor driver has a deadband that large"),
        ("friction.quadratic", "coefficient", 0.0, 0.007, 0.0145, "No wheel is braked that much"),
        ("friction.coulomb", "torque", 0.18, 0.1, 0.004, "No gears and tyres have a friction that different"),
    ],
)
def test_numbers_that_a_bent_command_makes_are_doubted(
    id_: str, parameter: str, nominal: float, usual: float, strange: float, said: str
) -> None:
    """Of commands whose root or square was logged."""

    def found(value: float) -> Diagnosis:
        values = {parameter: ParameterResult(value, 0.001, "", nominal)}
        return with_plausibility_hints(make_diagnosis(make_cause(id_, values)), driven(0.3), ROBOT)

    assert found(usual).verdict is Verdict.EXPLAINED
    assert found(strange).verdict is Verdict.PARTLY
    assert said in found(strange).causes[0].explanation


def both_slow(inertia: float, lag: float) -> Diagnosis:
    values = {"time_constant": ParameterResult(0.0225 * lag, 0.0002, "s", 0.0225)}
    named = make_diagnosis(
        make_cause("drive.inertia", factor_parameters(inertia)), make_cause("bemf.filter_lag", values)
    )
    return with_plausibility_hints(named, driven(0.3), ROBOT)


@pytest.mark.parametrize(("inertia", "lag", "times"), [(1.88, 2.1, "2"), (0.5, 0.48, "0.49")])
def test_a_time_that_is_too_slow_or_too_fast_is_thought_of(inertia: float, lag: float, times: str) -> None:
    said = [each for each in both_slow(inertia, lag).notes if "watch" in each]
    assert len(said) == 1
    assert f"are both about {times} times what robot.toml says" in said[0]


@pytest.mark.parametrize(("inertia", "lag"), [(1.3, 2.1), (1.9, 0.5), (1.15, 1.2)])
def test_a_heavy_robot_with_a_slow_filter_has_a_right_time(inertia: float, lag: float) -> None:
    assert not any("watch" in each for each in both_slow(inertia, lag).notes)


@pytest.mark.parametrize(
    ("rows", "lag", "said"),
    [(1.1, 1.106, "10 % longer"), (0.9, 0.9, "10 % shorter"), (1.1, 1.2, ""), (1.0, 1.1, ""), (2.0, 1.1, "")],
)
def test_a_filter_that_is_off_as_rows_are_is_a_wrong_time(rows: float, lag: float, said: str) -> None:
    """A clock 10 % too fast was a slow filter alone, with a probability of 1."""
    columns = driven(0.3)
    stretched = {**columns, "t": rows * columns["t"]}
    value = {"time_constant": ParameterResult(0.0225 * lag, 0.0002, "s", 0.0225)}
    found = with_plausibility_hints(make_diagnosis(make_cause("bemf.filter_lag", value)), stretched, ROBOT)
    assert found.verdict is (Verdict.PARTLY if said else Verdict.EXPLAINED)
    assert ("more likely t is wrong" in found.causes[0].explanation) is bool(said)
    assert said in found.causes[0].explanation


@pytest.mark.parametrize(
    ("factor", "std", "told"), [(1.14, 0.03, True), (1.14, 0.01, False), (1.4, 0.03, False)]
)
def test_so_is_an_inertia(factor: float, std: float, told: bool) -> None:
    """A clock 10 % too fast was an inertia alone, explained."""
    columns = driven(0.3)
    value = {"factor": ParameterResult(factor, std, "", 1.0)}
    found = with_plausibility_hints(
        make_diagnosis(make_cause("drive.inertia", value)), {**columns, "t": 1.1 * columns["t"]}, ROBOT
    )
    assert ("more likely t is wrong" in found.causes[0].explanation) is told
