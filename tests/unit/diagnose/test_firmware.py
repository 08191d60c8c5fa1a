"""Recordings of a Wombat: what its firmware does is known, and no fault of the robot."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from blind.drives import exciting
from emulated_drives import recorded
from raccoon.core.config import RobotConfig
from raccoon.core.readings import BATTERY_VOLTS_PER_COUNT, SI_WORDS, SIMULATOR
from raccoon.diagnose.candidates import drive_causes
from raccoon.diagnose.firmware import FIRMWARES, firmware_of
from raccoon.diagnose.habits.lags import _open_instead
from raccoon.diagnose.problem import Problem
from raccoon.diagnose.recordings.kinds import diagnose_recording
from raccoon.diagnose.result import Diagnosis, Verdict
from raccoon.diagnose.silence import ZONE
from raccoon.hal.wombat.devices import RACCOON_17, RACCOON_21, STOCK
from raccoon.hal.wombat.emulator import Firmware
from raccoon.sim.chain import Chain
from raccoon.sim.parameters import Parameters
from raccoon.sim.sensing import followed_voltage

ROBOT = RobotConfig()


def diagnosed(firmware: Firmware, seconds: float, **factor: float) -> Diagnosis:
    robot = Parameters.from_robot(ROBOT)
    if factor:
        robot = robot.with_effect("motor.back_emf_constant", "left", **factor)
    recording = recorded(firmware, robot, exciting(np.random.default_rng(1), seconds), seed=1)
    return diagnose_recording(recording.columns, ROBOT, device=recording.device)


def test_a_sound_robot_with_the_stock_firmware_has_no_cause() -> None:
    """Its filter in whole counts, its dead zone, pauses and clock were nine causes of one."""
    said = diagnosed("stock", 12.0)
    assert said.causes == ()
    assert said.verdict is Verdict.ADEQUATE
    assert any("the stock firmware" in note for note in said.notes)
    assert said.model is not None
    assert said.model.chain == Chain.stock()
    assert said.model.value(ZONE, "counts", "left") == FIRMWARES["wombat-stock"].dead_zone


@pytest.mark.parametrize("firmware", ["stock", 21])
def test_a_strong_motor_is_all_that_is_named(firmware: Firmware) -> None:
    said = diagnosed(firmware, 14.0, factor=1.08)
    assert [each.name for each in said.causes] == ["motor.back_emf_constant@left"]
    number = said.causes[0].parameters["factor"]
    assert abs(number.value - 1.08) < 2.5 * number.std < 0.05


def test_a_firmware_is_known_by_its_devices_name() -> None:
    for device in (STOCK, RACCOON_17, RACCOON_21):
        assert firmware_of(device) is FIRMWARES[device.name]
    assert firmware_of(SIMULATOR) is firmware_of(SI_WORDS) is None
    stock = firmware_of(STOCK)
    assert stock is not None
    assert firmware_of(replace(STOCK, name="wombat-stock+mpu6050")) == replace(stock, smooths=False)
    assert FIRMWARES["wombat-raccoon-21"].dead_zone == RACCOON_21.bemf_dead_zone
    assert FIRMWARES["wombat-stock"].silent == STOCK.bemf_dead_zone


def test_a_dead_zone_that_is_known_is_not_asked_for() -> None:
    stock, newer, older = (FIRMWARES[each.name] for each in (STOCK, RACCOON_21, RACCOON_17))
    causes = drive_causes()
    for each in (stock, newer):
        left = each.asked_for(causes)
        assert {cause.id for cause in causes} - {cause.id for cause in left} == {ZONE}
    assert older.asked_for(causes) == list(causes)
    assert older.start(ROBOT, None) is None
    model = Parameters.from_robot(ROBOT).with_effect("imu.latency", None, seconds=0.01)
    start = newer.start(ROBOT, model)
    assert start is not None
    assert start.value("imu.latency", "seconds") == 0.01


def test_the_battery_is_as_unsure_as_its_readings() -> None:
    stock = FIRMWARES[STOCK.name]
    number = stock.known_of(ROBOT).model.battery.internal_resistance
    assert number.value == ROBOT.model.battery.internal_resistance.value
    assert number.std == pytest.approx(np.hypot(0.005, stock.sag * number.value))
    exact = replace(ROBOT.model.battery, internal_resistance=replace(number, std=0.0))
    robot = replace(ROBOT, model=replace(ROBOT.model, battery=exact))
    assert stock.known_of(robot) is robot


def truncated(raw: np.ndarray[Any, Any], share: float = 0.25, start: int = 0) -> np.ndarray[Any, Any]:
    """A filter of the stock firmware, in whole counts."""
    value, found = start, []
    for each in raw:
        value = int(share * each + (1.0 - share) * value)
        found.append(value)
    return np.array(found, float)


@pytest.mark.parametrize("speed", [400.0, -1500.0])
def test_what_the_filter_cuts_off_is_given_back(speed: float) -> None:
    raw = np.round(speed + 3.0 * np.random.default_rng(3).standard_normal(4000))
    seen = {"t": np.arange(4000.0), "motor.0.bemf": truncated(raw), "motor.1.bemf": np.zeros(4000)}
    whole = FIRMWARES[STOCK.name].before_cutting(seen, (0, 1))
    assert abs(seen["motor.0.bemf"][500:].mean() - speed) > 1.0
    assert whole["motor.0.bemf"][500:].mean() == pytest.approx(speed, abs=0.25)
    assert not whole["motor.1.bemf"].any()
    assert FIRMWARES[RACCOON_21.name].before_cutting(seen, (0, 1)) is seen


def test_the_battery_is_held_where_it_rises_and_followed_where_it_falls() -> None:
    """As the chain says, to two counts, with a count of noise as a converter has."""
    counts = np.concatenate([np.linspace(760.0, 700.0, 600), np.linspace(700.0, 760.0, 600)])
    raw = np.round(counts + np.random.default_rng(4).standard_normal(1200))
    volts = BATTERY_VOLTS_PER_COUNT * truncated(raw, 0.05, start=760)
    seen = FIRMWARES[STOCK.name].before_cutting({"battery.voltage": volts}, (0, 1))["battery.voltage"]
    reading, held = counts[0] * BATTERY_VOLTS_PER_COUNT, Chain.stock().battery_held
    simulated = []
    for volt in counts * BATTERY_VOLTS_PER_COUNT:
        reading = 0.95 * reading + 0.05 * followed_voltage(reading, volt, held)
        simulated.append(reading)
    assert np.abs(seen - simulated).max() < 5.0 * BATTERY_VOLTS_PER_COUNT
    assert np.abs(seen - simulated).mean() < 2.0 * BATTERY_VOLTS_PER_COUNT


def test_a_lag_that_the_firmware_may_have_is_added_to_what_is_open(problem: Problem) -> None:
    key = ("actuation.latency", None, "seconds")
    width = problem.causes["actuation.latency"].coordinates[0].value(1.0)
    nominal = problem.nominal()
    for seconds, open_ in ((0.0005, True), (0.02, False)):
        point = nominal.with_cause("actuation.latency", np.array([seconds / width]))
        search: Any = SimpleNamespace(problem=problem, fit=SimpleNamespace(point=point))
        start = _open_instead(search, "actuation.latency")
        assert (start is not None) is open_
        if start is not None:
            assert start.active == {}
            assert problem.settings(start)[key] == pytest.approx(problem.settings(point)[key])
    slip = nominal.with_cause("drive.wheel_slip", np.array([0.1]))
    search = SimpleNamespace(problem=problem, fit=SimpleNamespace(point=slip))
    assert _open_instead(search, "drive.wheel_slip") is None
