from __future__ import annotations

from dataclasses import replace

import numpy as np

from raccoon.core.config import RobotConfig
from raccoon.diagnose.recordings.broken import judged_again, without_broken
from raccoon.diagnose.result import (
    CauseResult,
    ChannelResult,
    Diagnosis,
    Gain,
    ParameterResult,
    Unexplained,
    Verdict,
)

ROBOT = RobotConfig()
RNG = np.random.default_rng(3)
TIME = 0.01 * np.arange(1000)
DUTY = np.sign(np.sin(TIME))
GOOD = {
    "t": TIME,
    "motor.0.duty": DUTY,
    "motor.1.duty": DUTY,
    "motor.0.bemf": 1500.0 * DUTY + 4.0 * RNG.standard_normal(1000),
    "motor.1.bemf": 1500.0 * DUTY + 4.0 * RNG.standard_normal(1000),
    "imu.gyro.z": 0.01 * RNG.standard_normal(1000),
}


def faults(**changes: np.ndarray) -> list[tuple[str, str]]:
    sound = without_broken({**GOOD, **changes}, ROBOT)
    return [(each.channel, each.fault) for each in sound.faults]


def test_sound_channels_pass() -> None:
    assert faults() == []


def test_stuck_saturated_and_impossible_readings_are_left_out() -> None:
    assert faults(**{"imu.gyro.z": np.full(1000, 0.01)}) == [("imu.gyro.z", "stuck")]
    assert faults(**{"motor.0.bemf": np.clip(GOOD["motor.0.bemf"], -900.0, 900.0)}) == [
        ("motor.0.bemf", "saturated")
    ]
    wild = np.where(np.arange(1000) == 500, 1e200, GOOD["motor.1.bemf"])
    sound = without_broken({**GOOD, "motor.1.bemf": wild}, ROBOT)
    assert sound.faults[0].fault == "impossible"
    assert np.isnan(sound.columns["motor.1.bemf"][500])


def test_a_rest_of_zeros_is_no_saturation() -> None:
    resting = np.where(TIME < 5.0, 0.0, GOOD["motor.0.bemf"])
    assert faults(**{"motor.0.bemf": resting}) == []


def test_uneven_time_is_noted() -> None:
    uneven = np.sort(TIME + 0.02 * RNG.standard_normal(1000))
    assert "t is uneven" in without_broken({**GOOD, "t": uneven}, ROBOT).notes[0]


def found(error: float, factor: float) -> Diagnosis:
    numbers = {"factor": ParameterResult(factor, 0.01, "", 1.0)}
    cause = CauseResult(
        "motor.back_emf_constant", None, 1, numbers, Gain(9.0, 1.0, 1.0), 1.0, (), "wrong: do."
    )
    channel = ChannelResult("motor.0.bemf", "counts", 2.0 * error, error, 4.0, 0.5)
    return Diagnosis(Verdict.EXPLAINED, (channel,), (cause,), (), Unexplained(0.0), (), 0.1)


def test_nothing_is_named_where_motion_does_not_follow_commands() -> None:
    sound = without_broken(GOOD, ROBOT)
    again = judged_again(found(1200.0, 0.9), GOOD, sound, ROBOT)
    assert (again.verdict, again.causes) == (Verdict.UNKNOWN, ())
    assert "does not follow" in again.rejected[0].reason
    assert judged_again(found(12.0, 0.9), GOOD, sound, ROBOT).causes


def test_a_file_of_another_robot_is_suspected() -> None:
    sound = without_broken(GOOD, ROBOT)
    assert any("of this robot?" in each for each in judged_again(found(12.0, 0.55), GOOD, sound, ROBOT).notes)
    one_side = replace(found(12.0, 0.55).causes[0], where="left")
    alone = replace(found(12.0, 0.55), causes=(one_side,))
    assert judged_again(alone, GOOD, sound, ROBOT).notes == ()


def test_a_missing_side_is_named() -> None:
    sound = without_broken({name: each for name, each in GOOD.items() if name != "motor.0.bemf"}, ROBOT)
    assert "motor.0.bemf is missing" in judged_again(found(12.0, 0.9), GOOD, sound, ROBOT).notes[0]
