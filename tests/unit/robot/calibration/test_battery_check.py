"""The check before the start."""

from dataclasses import replace

import pytest

from raccoon import CalibrationError, open_robot, repeat, seq, straight, wait
from raccoon.core.config import BatteryConfig, Measured, RobotConfig
from raccoon.core.readings import Inputs
from raccoon.robot.calibration.battery_check import check_battery, judge_voltage, tuned_voltage
from robots import CONFIG, InterceptingPort, simulated_port

TUNED = replace(CONFIG, battery=BatteryConfig(tuned_at=Measured(7.0)))


def test_the_paper_s_swap_of_batteries_is_seen_and_its_size_said() -> None:
    check = judge_voltage(6.1, TUNED, 0.15)
    assert not check.ok
    assert check.speed_change == pytest.approx(-0.134, abs=0.002)  # (6.1 - 0.3) / (7.0 - 0.3) - 1
    assert "tuned at 7.00 V" in check.advice


def test_on_the_robot_it_warns_or_refuses() -> None:
    port = simulated_port(effects={"battery.open_circuit_voltage": {"voltage": 6.4}})
    with open_robot(TUNED, port=port) as robot:
        check = robot.run(check_battery())
        assert check.voltage == pytest.approx(6.4, abs=0.02)
        assert not check.ok
        assert str(check) == check.advice
        with pytest.raises(CalibrationError, match=r"6\.\d+ V, tuned at 7.00 V"):
            robot.run(check_battery(refuse=True))


def test_the_voltage_itself_is_no_tolerance() -> None:
    with pytest.raises(ValueError, match=r"tolerance is 7: allowed are .* up to 1 V \(battery.tuned_at of"):
        check_battery(7.0)


@pytest.mark.parametrize(
    ("voltage", "ok", "words"),
    [(7.05, True, "as tuned"), (5.5, False, "charge it"), (None, False, "no battery reading")],
)
def test_verdicts(voltage: float | None, ok: bool, words: str) -> None:
    check = judge_voltage(voltage, TUNED, 0.15)
    assert check.ok is ok
    assert words in check.advice


def test_the_voltage_of_the_calibrations_counts_where_nothing_else_is_said() -> None:
    motors = {
        port: replace(motor, radians_per_tick=Measured(0.003, 1e-5, battery_voltage=6.5 + port * 0.2))
        for port, motor in CONFIG.motors.items()
    }
    assert tuned_voltage(replace(CONFIG, motors=motors)) == pytest.approx(6.6)
    assert tuned_voltage(RobotConfig()) is None
    assert judge_voltage(6.5, RobotConfig(), 0.15).ok


def test_the_pack_s_resistance_is_learnt_while_driving() -> None:
    effects = {
        "battery.internal_resistance": {"resistance": 0.12},
        "battery.open_circuit_voltage": {"voltage": 6.6},
    }
    with open_robot(CONFIG, port=simulated_port(effects=effects)) as robot:
        robot.run(wait(0.6))
        robot.run(repeat(seq(straight(0.15), wait(0.5), straight(-0.15), wait(0.5)), 2))
        pack = robot.pack.estimate
    assert pack.internal_resistance == pytest.approx(0.12, abs=0.02)
    assert pack.open_circuit_voltage == pytest.approx(6.6, abs=0.01)
    assert 0.3 < pack.charge < 0.8  # 3.30 V a cell, in the flat middle of LiFePO4


def dying(inputs: Inputs) -> Inputs:
    """The battery reads 1 V after 2 s, as a converter that dies does."""
    return inputs if inputs.time < 2.0 else replace(inputs, battery=1.0 / inputs.device.battery_volts)


def test_a_battery_reading_that_dies_on_the_way_changes_nothing() -> None:
    with open_robot(CONFIG, port=InterceptingPort(seen=dying)) as robot:
        robot.run(wait(0.5))
        result = robot.run(straight(0.6, 0.25))
        assert not result.saturated
        assert result.duration < 4.5
        assert robot.battery_voltage == pytest.approx(6.7, abs=0.2)
