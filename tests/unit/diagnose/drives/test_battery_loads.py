"""Servos and other motors on the same battery: its reading shows them, and nothing is compared then."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from blind import drives
from blind.generator import make
from blind.hidden import CAUSES, Hidden, draw
from raccoon.core.config import RobotConfig
from raccoon.diagnose.diagnosis import diagnose
from raccoon.diagnose.drives.battery_loads import LOADED_DRIVE_NOTE, find_loads, load_notes
from raccoon.diagnose.drives.battery_sag import SagResidual
from raccoon.diagnose.drives.features import Features
from raccoon.diagnose.drives.log import Log, log_from_columns
from raccoon.diagnose.experiment.drive_manoeuvre import drive_and_record
from raccoon.diagnose.experiment.manoeuvres import CHECKUP, manoeuvre
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.result import Verdict
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.sim.world.table import World
from raccoon.trace.loading import load_run
from simulated_drives import BLIND_CONTROLLER

Array = NDArray[np.float64]
Spans = tuple[tuple[float, float], ...]
ROBOT = RobotConfig()
VOLTS = 6.6
"""Of the battery while it drives."""
FULL = 0.15
"""V by which a servo that moves takes it down, at 0.15 ohm."""
CAUSES_OF_A_SAG = [each for each in drive_causes() if each.id.startswith(("battery.", "friction.", "motor."))]


def driven(
    seed: int, spans: Spans, sag: float = FULL, seconds: float = 24.0, hidden: Sequence[Hidden] = ()
) -> dict[str, Array]:
    """A team's drive, the battery and with it the motors lower by a sag within spans, s."""
    duty = drives.contest(np.random.default_rng(seed), seconds)
    left = 1.0 - acting(np.arange(len(duty)) / drives.RATE, spans, sag) / VOLTS
    columns = dict(make(seed, hidden, duty * left[:, None], seconds).columns)
    lower = acting(columns["t"], spans, sag)
    for port in (0, 1):
        columns[f"motor.{port}.duty"] = columns[f"motor.{port}.duty"] / (1.0 - lower / VOLTS)
    return columns | {"battery.voltage": columns["battery.voltage"] - lower}


def acting(time: Array, spans: Spans, sag: float) -> Array:
    low = np.zeros(len(time))
    for start, end in spans:
        low[(time >= start) & (time < end)] = sag
    return low


def seen(columns: dict[str, Array]) -> Log:
    return find_loads(log_from_columns(columns, ROBOT), columns, ROBOT)


def rests(seed: int, seconds: float = 24.0) -> Spans:
    """Half a second of each rest that is long enough."""
    moves = drives.contest(np.random.default_rng(seed), seconds).any(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[True], moves, [True]]).astype(int)))
    long = [(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if a > 100 and b - a > 140]
    return tuple((0.005 * float(a) + 0.1, 0.005 * float(a) + 0.6) for a, _ in long)


def assert_found(log: Log, spans: Spans, sag: float = FULL) -> None:
    assert len(log.loads) == len(spans)
    for load, (start, end) in zip(log.loads, spans, strict=True):
        assert start - 0.2 < load.start <= start + 0.05
        assert end - 0.05 <= load.end < end + 0.4
        assert load.sag == pytest.approx(sag, rel=0.15)


@pytest.mark.parametrize("seed", [5, 8])
def test_servos_that_move_at_rest(seed: int) -> None:
    spans = rests(seed)
    assert len(spans) > 1
    assert_found(seen(driven(seed, spans)), spans)


def test_an_arm_that_moves_at_any_time() -> None:
    spans = ((4.0, 4.9), (7.1, 8.2), (11.0, 12.4), (17.0, 17.8))
    assert_found(seen(driven(4, spans)), spans)


def test_a_servo_that_jams() -> None:
    assert_found(seen(driven(4, ((11.0, 30.0),))), ((11.0, 24.0),))


def test_one_that_jams_soon_is_the_battery_s_from_then_on() -> None:
    log = seen(driven(4, ((5.0, 30.0),), seconds=30.0))
    (load,) = log.loads
    assert load.start == log.time[0]
    assert load.end == pytest.approx(5.3, abs=0.2)
    assert load.sag < 0.0
    (told,) = load_notes(log, 0.15)
    assert re.match(r"from (4.9|5.0) s on something other than the wheels draws current", told)
    assert "the time before it is not compared" in told


def test_a_fuller_battery_that_was_put_in_late_is_left_out() -> None:
    # Said only, the drive had a gyro that drifts and one whose zero is off, each with a probability of 1.
    log = seen(driven(4, ((0.0, 19.0),), sag=0.35))
    (load,) = log.loads
    assert load.start == pytest.approx(18.8, abs=0.2)
    assert load.end > log.time[-1]
    (told,) = load_notes(log, 0.15)
    assert re.match(r"until (19.0|19.1) s the battery's voltage is lower by 3[2-7]\d mV", told)
    assert "another battery was put in" in told


def test_of_a_short_drive_no_second_is_all_that_is_compared() -> None:
    log = seen(driven(5, ((0.0, 1.8),), sag=0.35, seconds=3.5))
    assert log.loads == ()
    assert LOADED_DRIVE_NOTE in log.notes


def test_one_that_was_put_in_early_is_said_beside_loads() -> None:
    log = seen(driven(4, ((0.0, 7.0),), sag=0.35))
    assert log.loads[0].start < log.time[0]
    (told,) = load_notes(log, 0.15)
    assert re.search(r"0\.0 to 7\.\d s 3[2-7]\d mV, [\d.]+ A or another battery;", told)


def test_one_that_is_nearly_always_on_is_only_said() -> None:
    log = seen(driven(4, tuple((each + 0.3, each + 2.9) for each in np.arange(0.0, 24.0, 3.0))))
    assert log.loads == ()
    assert log.notes == (LOADED_DRIVE_NOTE,)


@pytest.mark.parametrize("name", [*(each for each in CAUSES if not each.startswith("imu")), ""])
def test_a_drive_without_is_the_same_log(name: str) -> None:
    rng = np.random.default_rng(len(name))
    hidden = [draw(name, rng)] if name else []
    kind = "contest" if len(name) % 2 else "exciting"
    log = log_from_columns(columns := dict(make(7, hidden, kind, 10.0).columns), ROBOT)
    assert find_loads(log, columns, ROBOT) is log


def test_what_was_lost_before_a_part_of_a_drive_hides_nothing_of_it() -> None:
    """An index below 0 counts from the end: only the last seconds were looked at."""
    log = log_from_columns(dict(make(7, seconds=16.0).columns), ROBOT)
    parts = [replace(log, lost=lost).between(8.0, np.inf) for lost in ((), ((3.0, 3.5),))]
    whole, same = (SagResidual.of(each) for each in parts)
    assert whole is not None
    assert same is not None
    np.testing.assert_array_equal(same.known, whole.known)


def test_a_reading_in_coarse_steps_is_no_load() -> None:
    columns = driven(6, ())
    columns["battery.voltage"] = 0.05 * np.round(columns["battery.voltage"] / 0.05)
    assert seen(columns).loads == ()


def test_quick_reversals_behind_the_filter_of_a_back_emf_are_no_load() -> None:
    time = np.arange(0.0, 24.0, 0.005)
    duty = np.where((time // 1.6) % 2 > 0.0, -0.7, 0.7)
    quick = (time > 9.0) & (time < 10.0)
    duty[quick] = np.where((time[quick] // 0.09) % 2 > 0.0, -1.0, 1.0)
    speed = behind(duty * 6.0, 0.03)
    sag = 2.0 * 0.1 * duty * (6.8 * duty - 1.08 * speed) / 1.8  # of two wheels, at 0.1 ohm
    noise = np.random.default_rng(3).normal(scale=0.01, size=len(time))
    columns = {f"motor.{port}.bemf": behind(328.0 * speed, 0.0225) for port in (0, 1)}
    columns |= {"motor.0.duty": duty, "motor.1.duty": duty, "t": time, "battery.voltage": 6.8 - sag + noise}
    log = log_from_columns(columns, ROBOT)
    assert find_loads(log, columns, ROBOT) is log


def test_currents_that_a_simulation_adds_up_are_no_load() -> None:
    """U = U_0 - R_b (|I_left| + |I_right|), whatever a driver by PWM takes from its battery: eight of 48 such
    drives had loads, one twelve of them."""
    row, speed = 0.01, np.zeros(2)
    time = np.arange(0.0, 18.0, row)
    duty, speeds, volts = np.zeros((len(time), 2)), np.zeros((len(time), 2)), np.full(len(time), 6.8)
    for index, within in enumerate(time % 4.2):  # a square: ahead, wait, turn, wait
        duty[index] = (0.6, 0.6) if within < 2.5 else (-0.4, 0.4) if 2.8 < within < 3.8 else (0.0, 0.0)
        speeds[index] = speed
        for _ in range(8):
            current = (duty[index] * volts[index] - 1.08 * speed) / 1.8
            volts[index] = 6.8 - 0.2 * float(np.abs(current).sum())
        inertia = 0.014 if duty[index].sum() == 0.0 else 0.02
        speed = speed + row * (1.08 * current - 0.18 * np.tanh(speed / 0.1)) / inertia
    noise = np.random.default_rng(5).normal(scale=0.005, size=len(time))
    columns = {"t": time, "battery.voltage": 6.8 - behind(6.8 - volts, 0.025) + noise}
    for port in (0, 1):
        columns |= {f"motor.{port}.duty": duty[:, port], f"motor.{port}.bemf": 328.0 * speeds[:, port]}
    log = log_from_columns(columns, ROBOT)
    assert find_loads(log, columns, ROBOT) is log


def test_a_battery_that_is_read_without_a_filter_has_no_load(tmp_path: Path) -> None:
    """Only fits that left most of the drive out added no voltage: 7 of these 12 s were taken for a servo."""
    robot = Parameters.from_robot(ROBOT).with_effect("battery.internal_resistance", resistance=0.16)
    port = SimPort(robot.with_effect("motor.back_emf_constant", "left", factor=0.94), World.empty(), seed=0)
    drive_and_record(ROBOT, manoeuvre(CHECKUP)[:2400], tmp_path / "run.jsonl", port)
    columns = load_run(tmp_path / "run.jsonl").recording.columns
    log = log_from_columns(columns, ROBOT)
    assert find_loads(log, columns, ROBOT) is log


def behind(values: Array, constant: float) -> Array:
    """A low-pass of rows of 5 ms."""
    keep = float(np.exp(-0.005 / constant))
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], values), float)


def test_without_a_battery_or_a_wheel_nothing_is_seen() -> None:
    columns = driven(3, rests(3))
    for name in ("battery.voltage", "motor.1.bemf"):
        assert seen({key: each for key, each in columns.items() if key != name}).loads == ()


def test_nothing_is_compared_while_they_act() -> None:
    spans = rests(3)
    log = seen(driven(3, spans))
    time = Features.of(log).time
    for start, end in spans:
        assert not ((time > start) & (time < end)).any()
    lost = sum(each.end - each.start for each in log.loads)
    assert 0.02 * len(time) == pytest.approx(log.seconds - 0.3 - lost, abs=0.3)


def test_they_are_told_with_what_moved() -> None:
    columns = driven(4, ((4.0, 4.9), (9.0, 9.8)))
    time = columns["t"]
    columns["servo.2.pulse_us"] = np.where(time < 4.0, 1200.0, 1800.0)
    columns["servo.1.pulse_us"] = np.full(len(time), 1500.0)
    columns["motor.3.duty"] = np.where((time > 9.0) & (time < 9.8), 0.8, 0.0)
    (told,) = load_notes(seen(columns), 0.15)
    first, second = told.split(";")[0], told.split(";")[1]
    assert re.search(r"voltage shows: (3.9|4.0) to (4.9|5.0) s 1\d\d mV, 1.\d A \(servo.2.pulse_us\)$", first)
    assert re.search(r" (8.9|9.0) to (9.8|9.9|10.0) s 1\d\d mV, \d.\d A \(motor.3.duty\)$", second)
    assert "loose" not in told


def test_the_battery_s_resistance_beside_servos() -> None:
    hidden = [draw("battery.internal_resistance", np.random.default_rng(0), 0.6)]
    columns = driven(8, rests(8, 16.0), sag=0.3, seconds=16.0, hidden=hidden)
    found = diagnose(columns, ROBOT, causes=CAUSES_OF_A_SAG, firmware=BLIND_CONTROLLER)
    assert [each.id for each in found.causes] == ["battery.internal_resistance"]
    number = found.causes[0].parameters["resistance"]
    true = make(8, hidden, np.zeros((int(16.0 * drives.RATE), 2)), 16.0).robot["rint"]
    assert abs(number.value - true) < 3.0 * number.std
    (told,) = (each for each in found.notes if each.startswith("something other than the wheels draws"))
    assert "look for a loose contact" in told


def test_a_servo_that_jams_is_no_discharge() -> None:
    found = diagnose(
        driven(4, ((13.0, 30.0),), sag=0.13), ROBOT, causes=CAUSES_OF_A_SAG, firmware=BLIND_CONTROLLER
    )
    assert found.verdict is Verdict.ADEQUATE
    assert found.causes == ()
