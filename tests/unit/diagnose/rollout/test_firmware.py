"""Recordings of a Wombat: what its firmware does is known, and no fault of the robot."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from blind.drives import exciting
from emulated_drives import record_emulated_drive
from raccoon.core.clock import SteppedClock
from raccoon.core.config import RobotConfig
from raccoon.core.readings import BATTERY_VOLTS_PER_COUNT, BEMF_VOLTS_PER_COUNT, SI_WORDS, SIMULATOR
from raccoon.diagnose.drives.log import Log, log_from_columns
from raccoon.diagnose.fit.problem import Problem
from raccoon.diagnose.habits.lags import _with_lag_in_base
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.hypotheses.coordinates import neutral_settings
from raccoon.diagnose.recordings.diagnosis import diagnose_recording
from raccoon.diagnose.recordings.firmware.filter_prior import with_device_filter
from raccoon.diagnose.result import Diagnosis
from raccoon.diagnose.rollout.dead_zone_evidence import ZONE
from raccoon.diagnose.rollout.firmware import FIRMWARES, LAG, firmware_of
from raccoon.diagnose.rollout.plant_rollout import Habits, PlantRollout
from raccoon.hal.wombat.emulator import Emulator, Firmware, PlantState
from raccoon.hal.wombat.firmware.devices import RACCOON_17, RACCOON_21, STOCK
from raccoon.hal.wombat.port import WombatPort
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.plant.sensing import battery_word
from raccoon.sim.port import SimPort

ROBOT = RobotConfig()


def diagnosed(firmware: Firmware, seconds: float, **factor: float) -> Diagnosis:
    robot = Parameters.from_robot(ROBOT)
    if factor:
        robot = robot.with_effect("motor.back_emf_constant", "left", **factor)
    recording = record_emulated_drive(firmware, robot, exciting(np.random.default_rng(1), seconds), seed=1)
    return diagnose_recording(recording.columns, ROBOT, device=recording.device)


@pytest.mark.parametrize("firmware", ["stock", 21])
def test_a_strong_motor_is_all_that_is_named(firmware: Firmware) -> None:
    """The stock firmware's filter in whole counts, dead zone, pauses and clock were nine causes of a sound
    robot (see test_named), and what its filter holds the battery's reading off by, for a second each, a
    discharge beside this one. `benchmarks/diagnosis_wombat.py` has each cause behind each firmware."""
    said = diagnosed(firmware, 5.5, factor=1.08)
    assert [each.name for each in said.causes] == ["motor.back_emf_constant@left"]
    number = said.causes[0].parameters["factor"]
    assert abs(number.value - 1.08) < 2.5 * number.std < 0.05
    if firmware == "stock":
        assert any("the stock firmware" in note for note in said.notes)
        assert any("counters show when" in note and "235.0 a second" in note for note in said.notes)
        assert said.model is not None
        assert said.model.chain == Chain.stock()
        assert said.model.value(ZONE, "counts", "left") == FIRMWARES["wombat-stock"].dead_zone
        assert not {ZONE, LAG} & {each.id for each in said.rejected}


def test_only_the_usual_chain_is_the_simulator_s() -> None:
    robot = Parameters.from_robot(ROBOT)
    for chain, name in ((Chain(), "simulator"), (Chain.firmware(), "simulator-chain")):
        assert SimPort(robot.with_chain(chain)).read().device.name == name


@pytest.fixture(scope="module", params=["stock", 17, 21])
def understood(request: pytest.FixtureRequest) -> tuple[Firmware, Log, Log]:
    """A drive as it was recorded, and as its firmware is known to have made it."""
    firmware: Firmware = request.param
    duty = exciting(np.random.default_rng(5), 8.0)
    recording = record_emulated_drive(firmware, Parameters.from_robot(ROBOT), duty, seed=5)
    log, known = log_from_columns(recording.columns, ROBOT), firmware_of(recording.device)
    assert known is not None
    return firmware, log, known.correct_log(log, recording.columns, ROBOT)


def test_samples_tell_their_clock(understood: tuple[Firmware, Log, Log]) -> None:
    firmware, _, log = understood
    rate, lead = (235.0, 0.0) if firmware == "stock" else (181.0, 1.0 / 4.0 / 181.0 - 0.000544)
    for clock in log.clocks:
        assert clock is not None
        assert 1.0 / clock.period == pytest.approx(rate, abs=0.05)
        assert clock.lead == pytest.approx(lead)
    left, right = log.clocks
    assert left is not None
    assert right is not None
    middle = np.array([4.0])
    turn = (right.latest_samples(middle)[1] - left.latest_samples(middle)[1]) / left.period % 1.0
    assert min(turn, 1.0 - turn) == pytest.approx(0.0 if firmware == "stock" else 0.25, abs=0.03)


def test_commands_are_those_that_the_drivers_get(understood: tuple[Firmware, Log, Log]) -> None:
    _, before, log = understood
    assert np.abs(log.duty - before.duty).max() <= 0.5 / 400.0
    assert np.abs(log.duty * 400.0 - np.rint(log.duty * 400.0)).max() < 1e-9
    faint = np.abs(before.duty) < 0.5 / 400.0
    assert (before.duty[faint] != 0.0).any()
    assert (log.duty[faint] == 0.0).all()


@pytest.mark.parametrize("firmware", [17, 21])
def test_a_wheel_that_is_faster_than_can_be_read_has_no_reading(firmware: Firmware) -> None:
    """RaccoonOS keeps the last one below 2000 counts, and its counter, until that is noticed."""
    fast = Parameters.from_robot(ROBOT).with_effect("battery.open_circuit_voltage", voltage=8.4)
    duty = np.repeat([[0.5, 0.5], [1.0, 1.0], [0.5, 0.5]], 200, axis=0)
    recording = record_emulated_drive(firmware, fast, duty, seed=2)
    known = firmware_of(recording.device)
    assert known is not None
    log = known.correct_log(log_from_columns(recording.columns, ROBOT), recording.columns, ROBOT)
    for side, port in (("left", 0), ("right", 1)):
        channel = log.channel(f"bemf_{side}")
        assert channel is not None
        said = recording.columns[f"motor.{port}.bemf"]
        position = recording.columns[f"motor.{port}.position"]
        kept = np.flatnonzero((np.diff(said) == 0.0) & (np.diff(position) == 0.0) & (said[1:] > 1900.0)) + 1
        assert len(kept) >= 2
        assert np.isnan(channel.values[kept]).all()
        assert np.isnan(channel.values[260:390]).all()
        assert np.isfinite(channel.values[20:200]).all()
        assert np.isfinite(channel.values[450:]).all()


def test_the_simulation_differs_by_a_part_of_what_it_did(understood: tuple[Firmware, Log, Log]) -> None:
    """All else as it is: what is left of the wheels' errors, root mean square, once samples have one age,
    commands wait for them and are in whole levels."""
    firmware, before, log = understood
    name = {"stock": "wombat-stock", 17: "wombat-raccoon-17", 21: "wombat-raccoon-21"}[firmware]
    device = next(each for each in (STOCK, RACCOON_17, RACCOON_21) if each.name == name)
    robot, habits = with_device_filter(device, ROBOT), Habits(FIRMWARES[name].chain, False)
    errors = []
    for each in (before, log):
        run = PlantRollout(each, robot, habits, plain=True).samples([neutral_settings(robot)])
        measured = np.array([channel.values for channel in each.channels[:2]])
        known = np.abs(measured) > 150.0
        late = [np.interp(each.time - 0.001 * ms, each.time, run[0, 0]) for ms in range(8)]
        errors.append(min(float(np.std((measured[0] - other)[known[0]])) for other in late))
    assert errors[1] < (0.65 if firmware == "stock" else 0.4) * errors[0]


def test_a_firmware_is_known_by_its_devices_name() -> None:
    for device in (STOCK, RACCOON_17, RACCOON_21):
        assert firmware_of(device) is FIRMWARES[device.name]
    assert firmware_of(SI_WORDS) is None
    assert firmware_of(replace(SIMULATOR, name="simulator-chain")) is None
    stock = firmware_of(STOCK)
    assert stock is not None
    assert firmware_of(replace(STOCK, name="wombat-stock+mpu6050")) == replace(
        stock, has_gyro_low_pass=False, gyro_rates=None
    )
    assert FIRMWARES["wombat-raccoon-21"].dead_zone == RACCOON_21.bemf_dead_zone
    assert FIRMWARES["wombat-stock"].max_silent_counts == STOCK.bemf_dead_zone


def test_a_dead_zone_and_a_filter_that_are_known_are_not_asked_for() -> None:
    """A line's steering made 15 ms of the stock firmware's filter 10, beside a wheel that was too small."""
    newer, older = FIRMWARES[RACCOON_21.name], FIRMWARES[RACCOON_17.name]
    causes = drive_causes()
    assert FIRMWARES[SIMULATOR.name].without_known_causes(causes, filters=True) == list(causes)
    for each in (FIRMWARES[STOCK.name], newer, older):
        for filters, known in ((True, {ZONE, LAG}), (False, {ZONE})):
            left = each.without_known_causes(causes, filters=filters)
            assert {cause.id for cause in causes} - {cause.id for cause in left} == known
    assert older.with_dead_zone(ROBOT, None) is None
    model = Parameters.from_robot(ROBOT).with_effect("imu.latency", None, seconds=0.01)
    start = newer.with_dead_zone(ROBOT, model)
    assert start is not None
    assert start.value("imu.latency", "seconds") == 0.01


def test_the_battery_is_as_unsure_as_its_readings() -> None:
    stock = FIRMWARES[STOCK.name]
    number = stock.with_battery_uncertainty(ROBOT).model.battery.internal_resistance
    assert number.value == ROBOT.model.battery.internal_resistance.value
    assert number.std == pytest.approx(np.hypot(0.005, stock.unread_resistance_share * number.value))
    exact = replace(ROBOT.model.battery, internal_resistance=replace(number, std=0.0))
    robot = replace(ROBOT, model=replace(ROBOT.model, battery=exact))
    assert stock.with_battery_uncertainty(robot) is robot


def truncated(raw: np.ndarray[Any, Any], share: float = 0.25, start: int = 0) -> np.ndarray[Any, Any]:
    """A filter of the stock firmware, in whole counts."""
    value, found = start, []
    for each in raw:
        value = int(share * each + (1.0 - share) * value)
        found.append(value)
    return np.array(found, float)


@pytest.mark.parametrize(("firmware", "volts"), [("stock", -2.7), (17, 1.0), (21, -2.7)])
def test_back_emf_is_read_without_a_bias_but_for_half_a_count_cut_off(
    firmware: Firmware, volts: float
) -> None:
    """So nothing but that half is given back. What the stock filter loses is made up for where it is read."""
    state = PlantState((volts, -volts, 0.0, 0.0), 7.5, (0.0, 0.0, 0.0), (0.0, 0.0, 9.81), (0.0,) * 6)
    plant = SimpleNamespace(advance=lambda _seconds, _drives: state)
    clock = SteppedClock()
    link = Emulator(plant, firmware, clock=clock, seed=1)
    with WombatPort(link, clock=clock, rate_hz=200.0, reset_line=link) as port:
        seen = [port.read().bemf for _ in range(2000)][200:]
    means = np.mean(np.array([each[:2] for each in seen if each is not None], float), axis=0)
    cut = 0.0 if firmware == "stock" else 0.5
    true = np.array([volts, -volts]) / BEMF_VOLTS_PER_COUNT
    assert means == pytest.approx(true - cut * np.sign(true), abs=0.25)


@pytest.mark.parametrize("drive", ["slow", "starts"])
def test_the_battery_is_held_where_it_rises_and_followed_where_it_falls(drive: str) -> None:
    """As the chain says, to a count or so, with a count of noise as a converter has: also how far the reading
    goes down with each start of a motor, which is what a battery's resistance is told by."""
    counts = np.concatenate([np.linspace(760.0, 700.0, 600), np.linspace(700.0, 760.0, 600)])
    if drive == "starts":
        since = np.arange(1200) % 120
        counts = 740.0 - np.where(since < 90, 10.0 + 35.0 * np.exp(-since / 19.0), 0.0)
    raw = np.round(counts + np.random.default_rng(4).standard_normal(1200))
    volts = BATTERY_VOLTS_PER_COUNT * truncated(raw, 0.05, start=760)
    seen = FIRMWARES[STOCK.name].undo_truncation({"battery.voltage": volts})["battery.voltage"]
    reading, held = counts[0] * BATTERY_VOLTS_PER_COUNT, Chain.stock().battery_held
    simulated = []
    for volt in counts * BATTERY_VOLTS_PER_COUNT:
        reading = battery_word(reading, volt, 0.95, held)
        simulated.append(reading)
    off = (seen - simulated)[240:] / BATTERY_VOLTS_PER_COUNT
    assert np.abs(off).max() < 5.0
    assert np.abs(off).mean() < 2.0
    if drive == "starts":
        lowest = off.reshape(-1, 120)[:, 10:40]
        assert abs(lowest.mean() - off.mean()) < 1.0


def test_a_lag_that_the_firmware_may_have_is_added_to_what_is_open(problem: Problem) -> None:
    key = ("actuation.latency", None, "seconds")
    width = problem.causes["actuation.latency"].coordinates[0].value(1.0)
    nominal = problem.nominal()
    for seconds, open_ in ((0.0005, True), (0.02, False)):
        point = nominal.with_cause("actuation.latency", np.array([seconds / width]))
        search: Any = SimpleNamespace(problem=problem, fit=SimpleNamespace(point=point))
        start = _with_lag_in_base(search, "actuation.latency")
        assert (start is not None) is open_
        if start is not None:
            assert start.active == {}
            assert problem.settings(start)[key] == pytest.approx(problem.settings(point)[key])
    slip = nominal.with_cause("drive.wheel_slip", np.array([0.1]))
    search = SimpleNamespace(problem=problem, fit=SimpleNamespace(point=slip))
    assert _with_lag_in_base(search, "drive.wheel_slip") is None
