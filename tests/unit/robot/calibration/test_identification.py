"""Identifying the wheels of a whole robot, and refusing what cannot be identified."""

from dataclasses import replace
from functools import cache

import pytest

from raccoon import CalibrationError, MotionTimeout, Robot, open_robot, wait
from raccoon.control.voltage_fit import WheelVoltages
from raccoon.core.config import RobotConfig
from raccoon.core.port import Port
from raccoon.core.readings import SIMULATOR, Outputs
from raccoon.robot.calibration.identification import Excitation, WheelFit, excite, fit_wheels, power_factors
from raccoon.robot.parts.drive import Drive, dead_time
from robots import CONFIG, InterceptingPort, simulated_port


@cache
def seen_on_nominal() -> Excitation:
    """Of the robot as robot.toml has it."""
    return seen_on(simulated_port())


def seen_on(port: Port) -> Excitation:
    with Robot(port, CONFIG) as robot:
        robot.run(wait(0.5))
        return robot.run(excite())


def test_unequal_motors_are_found_and_their_factors_make_them_alike() -> None:
    port = simulated_port(
        effects={
            "motor.back_emf_constant@left": {"factor": 1.0},
            "friction.coulomb@right": {"torque": 0.24},
            "motor.armature_resistance@right": {"factor": 1.1},
        }
    )
    seen = seen_on(port)
    left, right = fit_wheels(seen, CONFIG, SIMULATOR)
    assert left.voltages.static == pytest.approx(0.30, abs=0.04)
    assert right.voltages.static == pytest.approx(1.8 * 1.1 * 0.24 / 1.08, abs=0.05)
    assert left.margins.gain_db > 6.0
    factors = power_factors((left, right), 6.6)
    assert factors["motor.1.power_factor"].value == pytest.approx(1.0)
    slower = (6.6 - right.voltages.static) / right.voltages.speed
    trimmed = (6.6 * factors["motor.0.power_factor"].value - left.voltages.static) / left.voltages.speed
    assert trimmed == pytest.approx(slower, rel=1e-6)


def test_a_drive_tuned_so_takes_each_wheel_s_own_voltages() -> None:
    fits = fit_wheels(seen_on_nominal(), CONFIG, SIMULATOR)
    motors = dict(CONFIG.motors)
    for fit in fits:
        values = {key.rsplit(".", 1)[1]: value for key, value in fit.entries(6.8).items()}
        motors[fit.port] = replace(
            motors[fit.port],
            static_voltage=values["static_voltage"],
            speed_voltage=values["speed_voltage"],
            acceleration_voltage=values["acceleration_voltage"],
        )
    model = Drive(replace(CONFIG, motors=motors)).wheels.models[0]
    assert 1.0 / model.gain == pytest.approx(fits[0].voltages.speed, rel=1e-3)
    assert model.acceleration_voltage == pytest.approx(fits[0].voltages.acceleration)


def test_commands_that_act_as_late_as_the_loop_takes_them_to_are_no_inertia() -> None:
    """Of such inertia the gains would be a quarter larger, and the margins not what is said of them."""
    port = simulated_port(effects={"actuation.latency": {"seconds": dead_time(CONFIG)}})
    for fit in fit_wheels(seen_on(port), CONFIG, SIMULATOR):
        assert fit.voltages.acceleration == pytest.approx(1.8 * 0.02 / 1.08, rel=0.08)


@pytest.mark.parametrize("seconds", [0.0, 0.008])
def test_an_inertia_says_how_unsure_it_is_for_a_delay_that_nobody_knows(seconds: float) -> None:
    """It was a fifth off, 26 of the deviations that it gave."""
    port = simulated_port(effects={"actuation.latency": {"seconds": seconds}})
    for fit in fit_wheels(seen_on(port), CONFIG, SIMULATOR):
        off = fit.voltages.acceleration - 1.8 * 0.02 / 1.08
        assert abs(off) < 2.0 * fit.voltages.acceleration_std < 0.5 * fit.voltages.acceleration


@pytest.mark.parametrize("port", ["emulator", "emulator-raccoon"])
def test_the_inertia_is_found_through_either_firmware(port: str) -> None:
    config = replace(RobotConfig(), controller=replace(RobotConfig().controller, port=port))
    with open_robot(config, seed=1) as robot:
        robot.run(wait(0.3))
        seen = robot.run(excite((0.3, 0.7)))
        assert robot.inputs is not None
        fits = fit_wheels(seen, config, robot.inputs.device)
    for fit in fits:
        assert fit.voltages.acceleration == pytest.approx(1.8 * 0.02 / 1.08, rel=0.2)


def without_left(outputs: Outputs) -> Outputs:
    """As where the plug of the left motor is out."""
    return replace(outputs, duty=(0.0, *outputs.duty[1:]), brake=(False, True, False, False))


def test_a_motor_that_does_not_turn_is_named() -> None:
    seen = seen_on(InterceptingPort(sent=without_left))
    with pytest.raises(CalibrationError, match=r"left wheel \(motor port 0\): \d+ windows.*plugged in"):
        fit_wheels(seen, CONFIG, SIMULATOR)


def test_a_robot_that_spins_instead_is_not_measured() -> None:
    """With its left motor plugged in the other way round it would feel its inertia of turning."""
    turned = replace(CONFIG, motors={**CONFIG.motors, 0: replace(CONFIG.motor(0), inverted=True)})
    with open_robot(CONFIG, port=simulated_port(config=turned)) as robot:
        robot.run(wait(0.5))
        with pytest.raises(MotionTimeout, match=r"left motor \(port 0\) were plugged in the other way round"):
            robot.run(excite())
        assert robot.time < 2.0


def test_a_motion_that_is_no_motor_s_is_refused() -> None:
    seen = seen_on_nominal()
    odd = [
        ((row[0], row[1], row[2]), volts + (1.0 if n % 2 else -1.0))
        for n, (row, volts) in enumerate(seen.left)
    ]
    with pytest.raises(CalibrationError, match="motor equation is off by"):
        fit_wheels(replace(seen, left=odd), CONFIG, SIMULATOR)


def test_without_a_battery_reading_nobody_knows_the_volts() -> None:
    port = InterceptingPort(seen=lambda inputs: replace(inputs, battery=None))
    with Robot(port, CONFIG) as robot, pytest.raises(CalibrationError, match="no battery reading"):
        robot.run(excite((0.3,), seconds=0.1))
    assert port.written[-1].duty[:2] == (0.0, 0.0)


def test_levels_that_are_no_duties_are_refused() -> None:
    with pytest.raises(ValueError, match=r"level is 1\.2"):
        excite((0.3, 1.2))


def test_entries_carry_the_battery() -> None:
    left, _ = fit_wheels(seen_on_nominal(), CONFIG, SIMULATOR)
    assert isinstance(left, WheelFit)
    assert isinstance(left.voltages, WheelVoltages)
    assert all(value.battery_voltage == 6.5 for value in left.entries(6.5).values())
