from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from diagnoses import factor_parameters, make_cause, make_diagnosis
from raccoon.core.config import Measured, RobotConfig
from raccoon.diagnose.findings.deviations import MEASURE_ADVICE
from raccoon.diagnose.recordings.channels.battery_sag import missing_sag_fault
from raccoon.diagnose.recordings.channels.faulty import without_faulty_channels
from raccoon.diagnose.recordings.channels.review import with_channel_faults
from raccoon.diagnose.recordings.channels.saturation import saturation_fault
from raccoon.diagnose.result import ChannelResult, Diagnosis, Rejected, Verdict

ROBOT = RobotConfig()
RNG = np.random.default_rng(3)
TIME = 0.01 * np.arange(1000)
DUTY = np.sign(np.sin(TIME))


def behind(values: np.ndarray, seconds: float) -> np.ndarray:
    keep = np.exp(-0.01 / seconds)
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], values))


TURNS = behind(DUTY, 0.03)
"""Of the wheels, of what they turn at last."""
GOOD = {
    "t": TIME,
    "motor.0.duty": DUTY,
    "motor.1.duty": DUTY,
    "motor.0.bemf": 1500.0 * behind(TURNS, 0.0225) + 4.0 * RNG.standard_normal(1000),
    "motor.1.bemf": 1500.0 * behind(TURNS, 0.0225) + 4.0 * RNG.standard_normal(1000),
    "imu.gyro.z": 0.01 * RNG.standard_normal(1000),
    "battery.voltage": 6.8 - 0.05 * (DUTY * (6.8 * DUTY - 4.94 * TURNS) / 0.9) - 0.01 * (np.arange(1000) % 3),
}
STATE = RNG.bit_generator.state


@pytest.fixture(autouse=True)
def same_noise() -> None:
    """In whichever order the tests run."""
    RNG.bit_generator.state = STATE


def faults(**changes: np.ndarray) -> list[tuple[str, str]]:
    sound = without_faulty_channels({**GOOD, **changes}, ROBOT)
    return [(each.channel, each.fault) for each in sound.faults]


def test_sound_channels_pass() -> None:
    assert faults() == []


def test_stuck_saturated_and_impossible_readings_are_left_out() -> None:
    assert faults(**{"imu.gyro.z": np.full(1000, 0.01)}) == [("imu.gyro.z", "stuck")]
    assert faults(**{"motor.0.bemf": np.clip(GOOD["motor.0.bemf"], -900.0, 900.0)}) == [
        ("motor.0.bemf", "saturated")
    ]
    wild = np.where(np.arange(1000) == 500, 1e200, GOOD["motor.1.bemf"])
    sound = without_faulty_channels({**GOOD, "motor.1.bemf": wild}, ROBOT)
    assert sound.faults[0].fault == "impossible"
    assert np.isnan(sound.columns["motor.1.bemf"][500])


@pytest.mark.parametrize("seed", [28, 143])
def test_a_gyro_that_is_cut_off_either_way_is_said(seed: int) -> None:
    """7 % at one end and 5 % at the other were a robot in a hand. With the noise of these seeds, which left
    the end for one sample after long, it was a motion that settles there."""
    turn = 1.5 * np.sin(2.0 * TIME) + 0.01 * np.random.default_rng(seed).standard_normal(1000)
    (fault,) = without_faulty_channels({**GOOD, "imu.gyro.z": np.clip(turn, -1.2, 1.2)}, ROBOT).faults
    assert (fault.channel, fault.fault) == ("imu.gyro.z", "saturated")
    once = np.where(TIME < 0.5, np.clip(turn, -1.2, 1.2), np.minimum(turn, 1.2) * (TIME < 1.2))
    once[800:830] = -1.2
    sound = without_faulty_channels({**GOOD, "imu.gyro.z": once}, ROBOT)
    assert [each.fault for each in sound.faults] == ["cut"]
    assert np.array_equal(np.isnan(sound.columns["imu.gyro.z"]), np.abs(once) == 1.2)


def test_turns_that_settle_at_the_same_speed_either_way_are_not_cut_off() -> None:
    """Without noise and rounded, as simulations are written."""
    assert faults(**{"imu.gyro.z": np.round(1.5 * behind(DUTY, 0.06), 4)}) == []
    assert faults(**{"motor.0.bemf": np.trunc(1500.0 * behind(DUTY, 0.06))}) == []
    assert faults(**{"motor.0.bemf": np.trunc(np.clip(1500.0 * behind(DUTY, 0.06), -1200.0, 1200.0))}) != []


@pytest.mark.parametrize(("most", "fault"), [(9.0, []), (6.5, [("motor.0.bemf", "cut")])])
def test_the_fastest_step_of_few_ticks_a_row_is_no_end(most: float, fault: list[tuple[str, str]]) -> None:
    """Encoders whose wheels turned by six ticks a row at most lost their fastest rows."""
    ticks = np.trunc(6.9 * np.sin(0.8 * TIME) ** 3)
    assert ticks.max() == -ticks.min() == 6.0
    assert faults(**{"motor.0.bemf": 200.0 * ticks}) == []
    assert faults(**{"motor.0.bemf": 200.0 * ticks * (1.0 + 1e-15 * RNG.integers(0, 2, 1000))}) == []
    fine = np.round(200.0 * 7.5 * np.sin(5.0 * TIME) * np.sin(0.3 * TIME))
    assert faults(**{"motor.0.bemf": np.clip(fine, -200.0 * most, 200.0 * most)}) == fault


def test_a_motion_that_settles_in_coarse_steps_is_not_cut_off() -> None:
    """Back-EMF by counters in whole ticks goes in steps of 40 counts, of which none was near the largest."""
    command = 1957.0 * np.sign(np.sin(2.0 * np.pi * (0.025 * np.arange(1600) + 0.01) / 3.0))
    share = 1.0 - np.exp(-0.025 / 0.06)
    speed = lfilter([share], [1.0, share - 1.0], command)
    reading = 40.0 * np.round(speed / 40.0)
    assert reading.max() == 1960.0
    assert saturation_fault("motor.0.bemf", "bemf_left", reading) is None
    fault = saturation_fault("motor.0.bemf", "bemf_left", np.clip(reading, -1200.0, 1200.0))
    assert fault is not None
    assert fault.fault == "saturated"


def test_a_rest_of_zeros_is_no_saturation() -> None:
    resting = np.where(TIME < 5.0, 0.0, GOOD["motor.0.bemf"])
    assert faults(**{"motor.0.bemf": resting}) == []


def test_uneven_time_is_noted() -> None:
    uneven = np.sort(TIME + 0.02 * RNG.standard_normal(1000))
    assert "t is uneven" in without_faulty_channels({**GOOD, "t": uneven}, ROBOT).notes[0]


def found(error: float, constant: float) -> Diagnosis:
    channel = ChannelResult("motor.0.bemf", "counts", 2.0 * error, error, 4.0, 0.5)
    named = make_cause("motor.back_emf_constant", factor_parameters(constant), "wrong: do.", change=math.nan)
    return make_diagnosis(named, channels=(channel,))


def test_nothing_is_named_where_motion_does_not_follow_commands() -> None:
    sound = without_faulty_channels(GOOD, ROBOT)
    again = with_channel_faults(found(1200.0, 0.9), GOOD, sound, ROBOT)
    assert (again.verdict, again.causes) == (Verdict.UNKNOWN, ())
    assert "does not follow" in again.rejected[0].reason
    assert with_channel_faults(found(12.0, 0.9), GOOD, sound, ROBOT).causes


@pytest.mark.parametrize(
    ("share", "verdict", "told"), [(0.03, Verdict.EXPLAINED, 0), (0.06, Verdict.PARTLY, 1)]
)
def test_a_drive_is_explained_in_part_where_the_wheels_stay_off(
    share: float, verdict: Verdict, told: int
) -> None:
    """Readings that had 4 % of the other motor's in them were 5 % off with a scale of both, which was said to
    explain everything."""
    named = replace(found(share * np.std(GOOD["motor.0.bemf"]), 0.9), verdict=Verdict.EXPLAINED)
    again = with_channel_faults(named, GOOD, without_faulty_channels(GOOD, ROBOT), ROBOT)
    assert (again.verdict, again.causes) == (verdict, named.causes)
    assert sum("6 % of motor.0.bemf's spread" in each for each in again.notes) == told


def test_steps_of_an_encoder_are_not_what_does_not_follow() -> None:
    """One of 0.87 rad/s a tick was 0.17 of what it said off, of a robot with more friction."""
    turned = np.cumsum(2.2 * 0.01 * np.sin(3.0 * TIME))
    speed = np.diff(np.floor(720.0 * turned / (2.0 * np.pi)), prepend=0.0) / 720.0 * 2.0 * np.pi / 0.01
    coarse = {**GOOD, "motor.0.bemf": 300.0 * speed}
    off = float(np.std(coarse["motor.0.bemf"] - 660.0 * np.sin(3.0 * TIME)))
    assert off > 0.15 * np.std(coarse["motor.0.bemf"])
    sound = without_faulty_channels(coarse, ROBOT)
    assert with_channel_faults(found(off, 0.9), coarse, sound, ROBOT).causes
    assert not with_channel_faults(found(2.0 * off, 0.9), coarse, sound, ROBOT).causes


def test_what_a_simulation_that_cannot_follow_bent_is_no_news() -> None:
    """Each of ten numbers of robot.toml was 3.5 standard deviations off, and to be measured."""
    sound = without_faulty_channels(GOOD, ROBOT)
    bent = f"robot.toml's friction.viscous is 3.5 of its standard deviations off{MEASURE_ADVICE}"
    again = with_channel_faults(replace(found(1200.0, 0.5), notes=(bent, "kept")), GOOD, sound, ROBOT)
    assert again.notes[0] == "kept"
    assert "are commands and readings of the same drive?" in again.notes[-1]
    assert not any("of this robot?" in each for each in again.notes)
    assert bent in with_channel_faults(replace(found(12.0, 0.9), notes=(bent,)), GOOD, sound, ROBOT).notes
    nothing = replace(found(1200.0, 0.9), causes=(), verdict=Verdict.UNKNOWN)
    assert "does not follow" in with_channel_faults(nothing, GOOD, sound, ROBOT).notes[-1]


def test_a_file_of_another_robot_is_suspected() -> None:
    sound = without_faulty_channels(GOOD, ROBOT)
    assert any(
        "of this robot?" in each for each in with_channel_faults(found(12.0, 0.55), GOOD, sound, ROBOT).notes
    )
    one_side = replace(found(12.0, 0.55).causes[0], where="left")
    alone = replace(found(12.0, 0.55), causes=(one_side,))
    assert with_channel_faults(alone, GOOD, sound, ROBOT).notes == ()


def test_a_missing_side_is_named() -> None:
    sound = without_faulty_channels(
        {name: each for name, each in GOOD.items() if name != "motor.0.bemf"}, ROBOT
    )
    assert "motor.0.bemf is missing" in with_channel_faults(found(12.0, 0.9), GOOD, sound, ROBOT).notes[0]


def test_a_side_that_was_left_out_is_not_called_missing() -> None:
    sound = without_faulty_channels(
        {**GOOD, "motor.0.bemf": np.clip(GOOD["motor.0.bemf"], -900.0, 900.0)}, ROBOT
    )
    note = with_channel_faults(found(12.0, 0.9), GOOD, sound, ROBOT).notes[0]
    reason = "motor.0.bemf was left out (it is cut off)"
    assert note == f"{reason}: causes that only this wheel shows are not checked"


def test_what_a_missing_channel_leaves_open_is_said_where_nothing_is_named() -> None:
    adequate = replace(found(12.0, 0.9), verdict=Verdict.ADEQUATE, causes=())
    reason = "not identifiable: imu.gyro.z was left out (it is stuck)"
    adequate = replace(
        adequate, rejected=(Rejected("imu.latency", reason), Rejected("drive.slope", "nothing"))
    )
    sound = without_faulty_channels({**GOOD, "imu.gyro.z": np.full(1000, 0.01)}, ROBOT)
    (note,) = with_channel_faults(adequate, GOOD, sound, ROBOT).notes
    assert note == "not checked, since imu.gyro.z was left out (it is stuck): imu.latency"


def test_a_battery_that_is_not_recorded_is_said_to_be_checked_by_the_wheels() -> None:
    sound = without_faulty_channels(
        {name: each for name, each in GOOD.items() if name != "battery.voltage"}, ROBOT
    )
    (note,) = with_channel_faults(found(12.0, 0.9), GOOD, sound, ROBOT).notes
    assert note == "battery.voltage is missing: the battery was checked by the wheels alone"


def test_where_the_time_is_uneven_only_large_causes_are_believed() -> None:
    uneven = np.sort(TIME + 0.02 * RNG.standard_normal(1000))
    sound = without_faulty_channels({**GOOD, "t": uneven}, ROBOT)
    (large,) = found(12.0, 0.9).causes
    small = replace(large, id="friction.load_dependent", change=0.34, rank=1)
    both = replace(found(12.0, 0.9), causes=(small, replace(large, change=8.0, rank=2)))
    again = with_channel_faults(both, GOOD, sound, ROBOT)
    assert [(each.id, each.rank) for each in again.causes] == [("motor.back_emf_constant", 1)]
    assert again.verdict is Verdict.PARTLY
    assert "t is uneven" in again.rejected[0].reason
    nothing = with_channel_faults(replace(both, causes=(small,)), GOOD, sound, ROBOT)
    assert (nothing.verdict, nothing.causes) == (Verdict.NOT_IDENTIFIABLE, ())
    even = without_faulty_channels(GOOD, ROBOT)
    assert with_channel_faults(both, GOOD, even, ROBOT).causes == both.causes


@pytest.mark.parametrize(
    ("row", "said"), [(0.005, False), (0.0057, False), (0.01, False), (0.004, True), (0.0065, True)]
)
def test_rows_that_are_no_cycles_of_the_controller_are_said(row: float, said: bool) -> None:
    """A clean drive at 200 Hz whose time says 250 Hz had a slow filter and another inertia."""
    notes = without_faulty_channels({**GOOD, "t": row * np.arange(1000.0)}, ROBOT).notes
    assert any(f"write controller.rate_hz = {1.0 / row:.3g}; " in each for each in notes) is said


def test_a_time_that_stands_is_left_for_the_log_to_refuse() -> None:
    notes = without_faulty_channels({**GOOD, "t": np.zeros(1000)}, ROBOT).notes
    assert not any("rate_hz" in each for each in notes)


def circling(**changes: np.ndarray) -> dict[str, np.ndarray]:
    """A robot that drives on a circle of 0.5 m, seen by a reference at 20 Hz."""
    rate, speed = 1.0, 0.5
    heading = rate * TIME
    columns = {
        **{name: each for name, each in GOOD.items() if name != "battery.voltage"},
        "motor.0.bemf": np.full(1000, 1300.0) + RNG.standard_normal(1000),
        "motor.1.bemf": np.full(1000, 1800.0) + RNG.standard_normal(1000),
        "imu.gyro.z": rate + 0.01 * RNG.standard_normal(1000),
        "truth.x": speed / rate * np.sin(heading),
        "truth.y": speed / rate * (1.0 - np.cos(heading)),
        "truth.heading": heading,
    }
    slow = np.arange(1000) % 5 != 0
    for name in ("truth.x", "truth.y", "truth.heading"):
        columns[name] = np.where(slow, np.nan, changes.get(name, columns[name]))
    return columns


def test_a_slow_reference_that_follows_the_robot_is_sound() -> None:
    assert without_faulty_channels(circling(), ROBOT).faults == ()


def test_a_reference_that_stands_still_while_the_robot_turns_is_said_and_left_out_there() -> None:
    frozen = np.where(TIME < 4.0, TIME, 4.0)
    sound = without_faulty_channels(circling(**{"truth.heading": frozen}), ROBOT)
    (fault,) = sound.faults
    assert (fault.channel, fault.fault) == ("truth.heading", "frozen")
    assert "from 4.0 to 9.9" in fault.text or "from 4.0 to 10.0" in fault.text
    assert np.isfinite(sound.columns["truth.heading"][TIME < 3.9]).any()
    assert not np.isfinite(sound.columns["truth.heading"][TIME > 4.1]).any()
    both = without_faulty_channels(
        circling(**{name: np.zeros(1000) for name in ("truth.x", "truth.y")}), ROBOT
    ).faults
    assert [(each.channel, each.fault) for each in both] == [("truth.x", "frozen"), ("truth.y", "frozen")]


def test_a_robot_that_a_wall_holds_has_no_frozen_reference() -> None:
    held = {**circling(), "imu.gyro.z": 0.01 * RNG.standard_normal(1000)}
    held |= {name: np.zeros(1000) for name in ("truth.x", "truth.y", "truth.heading")}
    assert without_faulty_channels(held, ROBOT).faults == ()


def test_a_reference_that_lost_the_robot_is_said() -> None:
    lost = np.where((TIME > 3.0) & (TIME < 6.0), np.nan, TIME)
    (fault,) = without_faulty_channels(circling(**{"truth.heading": lost}), ROBOT).faults
    assert (fault.channel, fault.fault) == ("truth.heading", "lost")
    assert "from 3.0 to 6.0 s" in fault.text
    few = np.where(TIME < 0.3, TIME, np.nan)
    (fault,) = without_faulty_channels(circling(**{"truth.heading": few}), ROBOT).faults
    assert (fault.channel, fault.fault) == ("truth.heading", "missing")
    without = circling()
    del without["truth.heading"]
    (fault,) = without_faulty_channels(without, ROBOT).faults
    assert "truth.heading is not in the recording" in fault.text


@pytest.mark.parametrize(("ohm", "told"), [(0.0, True), (0.03, False), (0.2, False)])
def test_a_battery_that_does_not_sag_is_no_reading_of_it(ohm: float, told: bool) -> None:
    """A number that stands for one, with some noise, was four causes with a probability of 1."""
    amps = DUTY * (6.8 * DUTY - 4.94 * TURNS) / 0.9
    volts = 12.0 - ohm * behind(amps, 0.1) + 0.005 * RNG.standard_normal(1000)
    sound = without_faulty_channels({**GOOD, "battery.voltage": volts}, ROBOT)
    assert [each.fault for each in sound.faults] == ["steady"] * told
    assert ("battery.voltage" in sound.columns) is not told
    if told:
        assert sound.left_out == {"battery.voltage": "it does not sag"}
    supply = replace(ROBOT.model.battery, internal_resistance=Measured(0.01, 0.002))
    stiff = replace(ROBOT, model=replace(ROBOT.model, battery=supply))  # of a bench, as robot.toml says
    assert without_faulty_channels({**GOOD, "battery.voltage": volts}, stiff).faults == ()


def test_a_battery_need_not_sag_where_no_motor_is_driven() -> None:
    """Of a robot that only stood it was said to be the reading of another one."""
    still = dict.fromkeys(("motor.0.duty", "motor.1.duty"), np.zeros(1000))
    assert (
        missing_sag_fault(
            {**GOOD, **still, "battery.voltage": 6.8 + 0.005 * RNG.standard_normal(1000)}, ROBOT
        )
        is None
    )


def test_a_battery_is_believed_where_commands_are_no_duties() -> None:
    """What a loop that keeps a speed draws is not in its commands, but the reading knows of the motors."""
    speeds = {f"motor.{port}.duty": 0.8 * TURNS for port in (0, 1)}
    assert faults(**speeds) == []


def test_a_battery_whose_wheels_are_not_read_is_believed() -> None:
    blind = {name: each for name, each in GOOD.items() if not name.endswith(".bemf")}
    assert (
        without_faulty_channels(
            {**blind, "battery.voltage": 6.8 + 0.01 * RNG.standard_normal(1000)}, ROBOT
        ).faults
        == ()
    )


def test_the_gyro_of_a_robot_that_stands_is_not_coarse() -> None:
    """It has the values of its noise alone: the only fault of a recording of 6 s at rest."""
    noise = 0.001 * np.round(RNG.standard_normal(1000))
    assert len(np.unique(noise)) < 9
    assert faults(**{"imu.gyro.z": noise}) == [("imu.gyro.z", "coarse")]
    still = {"motor.0.duty": np.zeros(1000), "motor.1.duty": np.zeros(1000)}
    assert ("imu.gyro.z", "coarse") not in faults(**{"imu.gyro.z": noise, **still})


def test_a_battery_that_is_read_now_and_then_counts_where_it_was_read() -> None:
    every = {seconds: GOOD["battery.voltage"][np.arange(1000) // round(100 * seconds) * round(100 * seconds)]
             for seconds in (0.1, 5.0)}  # fmt: skip
    sound = without_faulty_channels({**GOOD, "battery.voltage": every[0.1]}, ROBOT)
    assert sound.faults == ()
    kept = np.flatnonzero(np.isfinite(sound.columns["battery.voltage"]))
    assert set(kept) <= set(range(0, 1000, 10))
    assert faults(**{"battery.voltage": every[5.0]}) == [("battery.voltage", "rare")]


def test_a_battery_that_never_changes_was_not_read() -> None:
    """A number of robot.toml in its place was a battery without a resistance, with a probability of 1."""
    assert faults(**{"battery.voltage": np.full(1000, 6.8)}) == [("battery.voltage", "stuck")]
    volts = np.where(np.arange(1000) % 7 == 0, 6.0, 7.0)
    assert faults(**{"battery.voltage": volts}) == [("battery.voltage", "coarse")]
    sagging = 6.83 + 0.4 * (GOOD["battery.voltage"] - 6.8) - 0.2 * (np.arange(1000) % 100 < 2)
    assert faults(**{"battery.voltage": np.round(sagging, 1)}) == [("battery.voltage", "coarse")]
    assert faults(**{"battery.voltage": np.round(sagging / 0.008862) * 0.008862}) == []
    stiff = np.round(GOOD["battery.voltage"] / 0.03) * 0.03
    assert len(np.unique(stiff)) < 16
    assert faults(**{"battery.voltage": stiff}) == []
    weak = np.round(6.8 + 3.3 * (GOOD["battery.voltage"] - 6.8), 1)
    assert np.std(weak) > 0.1  # it sags by more than a step: most of that is known
    assert faults(**{"battery.voltage": weak}) == []


def test_the_rate_that_a_strange_time_has_is_no_advice() -> None:
    time = np.sort(np.concatenate([0.02 * np.arange(300), 0.02 * np.arange(700) % 6.0 + 1e-7]))
    notes = without_faulty_channels({**GOOD, "t": time + 1e-9 * np.arange(1000)}, ROBOT).notes
    assert any("the controller runs at 200 Hz" in each for each in notes)
    assert not any("write controller.rate_hz" in each for each in notes)
    assert any("Hz: if t is not right, filters" in each for each in notes)
