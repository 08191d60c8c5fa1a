"""A short excitation that identifies each wheel's voltages, for the tuner and for static compensation.

Both wheels drive straight ahead and back at several duties. The motor equation in volts
(raccoon.control.voltage_fit) gives each wheel's friction, V per rad/s and V per rad/s2, and from them the
gains of its speed loop with their margins.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from raccoon.control.feedforward import WheelModel, wheel_models
from raccoon.control.pid import PidGains
from raccoon.control.tuning import Margins, margins, speed_loop_gains
from raccoon.control.voltage_fit import Vector3, WheelVoltages, Windows, fit_voltages
from raccoon.control.wheel_watch import READING_JITTER_S
from raccoon.core.config import Measured, RobotConfig
from raccoon.core.errors import CalibrationError
from raccoon.core.readings import Device
from raccoon.estimate.drive.wheel_track import SPEED_SMOOTHING_S
from raccoon.robot.actions.actions import Action, Steps
from raccoon.robot.motions.pacing import check_wiring
from raccoon.robot.parts.drive import dead_time

if TYPE_CHECKING:
    from raccoon.robot.robot import Robot

DUTY_LEVELS = (0.30, 0.55, 0.80)
LEVEL_TIME_S = 0.45
REST_TIME_S = 0.4
WORST_RESIDUAL = 0.25
"""V; largest residual of a window for which the motor equation still counts as a model of the wheel."""
WORST_SHARE = 0.2
"""Relative standard deviation above which a voltage is not supported by the data."""
MAX_WAY_ERROR_SHARE = 0.005
"""Relative error by which the odometry may overestimate one wheel's way after such a drive: robots as
`raccoon sweep` draws them differ that much in their factors from their simulation."""
MIN_PHASE, MIN_GAIN_DB = math.radians(45.0), 6.0

Rows = list[tuple[Vector3, float]]
Sample = tuple[float, float, float, float]
"""Mean voltage (V) since the previous sample, speeds of left and right at its end (rad/s), s since the
previous sample; 0 s where a duty begins."""


@dataclass(frozen=True, slots=True)
class Excitation:
    """Measured data: rows of the motor equation for the left and the right wheel, and the battery's mean
    voltage (V)."""

    left: Rows
    right: Rows
    battery: float


def excite(levels: Sequence[float] = DUTY_LEVELS, seconds: float = LEVEL_TIME_S) -> Action[Excitation]:
    """Drive straight ahead at each duty of `levels` for `seconds` s, and back again. The robot moves about
    0.2 m ahead and returns.

    Raises MotionTimeout if the gyro shows for half a second that a motor is plugged in the other way round,
    since its load is then not that of a drive.
    """
    for level in levels:
        if not 0.0 < level <= 1.0:
            raise ValueError(f"level is {level}: allowed are duties above 0 up to 1")

    def steps(robot: Robot) -> Steps[Excitation]:
        samples: list[Sample] = []
        batteries: list[float] = []
        miswired = 0.0
        try:
            for sign in (1.0, -1.0):
                for level in (*levels, *reversed(levels[:-1])):
                    miswired = yield from _drive_level(
                        robot, sign * level, seconds, samples, batteries, miswired
                    )
                yield from _wait_for_rest(robot)
        finally:
            robot.drive.stop()
            robot.replan()
        if not batteries:
            raise CalibrationError("there is no battery reading, so the motors' voltage is unknown")
        left, right = _motor_rows(samples, dead_time(robot.config))
        return Excitation(left, right, sum(batteries) / len(batteries))

    return Action("excite the wheels", steps)


def _drive_level(
    robot: Robot,
    duty: float,
    seconds: float,
    samples: list[Sample],
    batteries: list[float],
    miswired: float,
) -> Steps[float]:
    """Drive at one duty for a time. miswired, and the result: see `check_wiring`."""
    begin, before = robot.time, 0.0
    while robot.time - begin < seconds:
        miswired = check_wiring(robot, miswired, "the drive of the calibration")
        battery = robot.battery_voltage
        if battery is not None:
            here, first = robot.estimate, robot.time <= begin
            samples.append((before, here.left_speed, here.right_speed, 0.0 if first else robot.dt))
            batteries.append(battery)
        before = 0.0 if battery is None else duty * battery
        robot.drive.duties(duty, duty)
        yield
    return miswired


def _motor_rows(samples: Sequence[Sample], delay: float) -> tuple[Rows, Rows]:
    """Rows of both wheels for voltages that act `delay` s late. A neglected delay looks like inertia: 8 ms
    add a quarter of the usual one, and the gains would follow."""
    import numpy as np

    windows = (Windows(), Windows())
    found: tuple[Rows, Rows] = ([], [])
    ends = np.cumsum([dt for *_, dt in samples])
    given = np.concatenate([[0.0], np.cumsum([volts * dt for volts, *_, dt in samples])])
    sum_until = np.interp(ends - delay, np.concatenate([[0.0], ends]), given)
    smoothed = 0.0
    for number, (_, left, right, dt) in enumerate(samples):
        if dt <= 0.0:
            windows = (Windows(), Windows())
            continue
        volts = float(sum_until[number] - sum_until[number - 1]) / dt
        # The speeds are smoothed; so is the voltage, to be of the same moment.
        smoothed += dt / (SPEED_SMOOTHING_S + dt) * (volts - smoothed)
        for window, rows, speed in zip(windows, found, (left, right), strict=True):
            row = window.add(smoothed, speed, dt)
            if row is not None:
                rows.append(row)
    return found


def _wait_for_rest(robot: Robot) -> Steps[None]:
    begin = robot.time
    while robot.time - begin < REST_TIME_S:
        yield


@dataclass(frozen=True, slots=True)
class WheelFit:
    """One wheel as identified, with the gains of its speed loop and their margins."""

    side: str
    port: int
    voltages: WheelVoltages
    model: WheelModel
    gains: PidGains
    margins: Margins

    def entries(self, battery: float) -> dict[str, Measured]:
        """The values by their keys in robot.toml."""
        found = self.voltages
        pairs = (
            ("static_voltage", max(found.static, 0.0), found.static_std),
            ("speed_voltage", found.speed, found.speed_std),
            ("acceleration_voltage", found.acceleration, found.acceleration_std),
        )
        return {
            f"motor.{self.port}.{key}": Measured(value, std, battery_voltage=battery)
            for key, value, std in pairs
        }


def fit_wheels(seen: Excitation, config: RobotConfig, device: Device) -> tuple[WheelFit, WheelFit]:
    """Fit the left and the right wheel. Raises CalibrationError if the data cannot support the gains, saying
    why."""
    models, late = wheel_models(config, device), dead_time(config)
    return (
        _fit_wheel("left", config.drive.left, seen.left, models[0], late),
        _fit_wheel("right", config.drive.right, seen.right, models[1], late),
    )


def _fit_wheel(side: str, port: int, rows: Rows, model: WheelModel, late: float) -> WheelFit:
    where = f"the {side} wheel (motor port {port})"
    try:
        found = fit_voltages(rows)
    except ValueError as error:
        raise CalibrationError(f"{where}: {error}; is it plugged in and free to turn?") from error
    if found.residual > WORST_RESIDUAL:
        raise CalibrationError(
            f"{where}: the motor equation is off by {found.residual:.2f} V (allowed: {WORST_RESIDUAL} V): "
            "does it slip, rub or bump?"
        )
    for name in ("speed", "acceleration"):
        value, std = getattr(found, name), getattr(found, f"{name}_std")
        if not value > 0.0 or std > WORST_SHARE * value:
            raise CalibrationError(
                f"{where}: {name}_voltage comes out as {value:.3g} +- {std:.2g}: too uncertain to use"
            )
    # What is read a moment later than it is taken to be looks like as much inertia, in every window alike.
    found = replace(
        found, acceleration_std=math.hypot(found.acceleration_std, READING_JITTER_S * found.speed)
    )
    fitted = model.with_voltages(max(found.static, 0.0), found.speed, found.acceleration)
    gains = speed_loop_gains(fitted, SPEED_SMOOTHING_S, late)
    reached = margins(gains, fitted, SPEED_SMOOTHING_S, late)
    if reached.phase < MIN_PHASE or reached.gain_db < MIN_GAIN_DB:
        raise CalibrationError(
            f"{where}: the gains would have margins of {math.degrees(reached.phase):.0f} deg and "
            f"{reached.gain_db:.1f} dB: at least 45 deg and 6 dB are needed"
        )
    return WheelFit(side, port, found, fitted, gains, reached)


def power_factors(fits: tuple[WheelFit, WheelFit], battery: float) -> dict[str, Measured]:
    """Static compensation k by its key in robot.toml: the faster motor gets less, so that both turn alike.

    At full power on `battery` V a wheel turns at w = (U - S) / V. With the slower wheel's w the other one
    needs k = (V w + S) / U. The standard deviation treats the voltages' errors as independent.
    """
    slowest = min((battery - fit.voltages.static) / fit.voltages.speed for fit in fits)
    factors = {}
    for fit in fits:
        found = fit.voltages
        value = min(1.0, (found.speed * slowest + found.static) / battery)
        std = math.hypot(found.speed_std * slowest / battery, found.static_std / battery, MAX_WAY_ERROR_SHARE)
        factors[f"motor.{fit.port}.power_factor"] = Measured(value, std, battery_voltage=battery)
    return factors
