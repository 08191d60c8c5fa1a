"""Plausible sizes of readings: wheels compared with their commands and the battery, the gyro with the wheels.
A reading that is off by more than a robot.toml can be is in another unit."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import MotorModel, RobotConfig
from raccoon.core.errors import TraceError
from raccoon.core.readings import BEMF_VOLTS_PER_COUNT
from raccoon.diagnose.drives.log import Channel, Log

Array = NDArray[np.float64]

USUAL_BEMF_SHARE = 0.85
"""Back-EMF of a motor that turns freely, as a share of its command's voltage."""
MAX_BEMF_SHARE = 1.3
"""Share that no motor exceeds, even with a reading's scale that is a quarter too large."""
MAX_FACTOR = 3.0
"""Factor that no error of a robot.toml explains: another unit, or another robot."""
MIN_SMALL_FACTOR = 2.0
"""Factor by which both wheels must be small to believe the gyro that they are."""
UNIT_FACTOR = 1.4
"""Factor within which a unit is recognised."""
MIN_SAMPLES = 50
"""Least number of samples for a comparison."""
DEGREES_PER_RADIAN = 180.0 / math.pi
SPEED_UNITS: Mapping[str, float] = {
    "degrees a second": DEGREES_PER_RADIAN,
    "turns a minute": 60.0 / math.tau,
    "turns a second": 1.0 / math.tau,
}
GYRO_UNITS = {name: SPEED_UNITS[name] for name in ("turns a second", "turns a minute")}
"""Degrees and a sensor's raw counts are recognised by `units`."""
BEMF_UNITS: Mapping[str, float] = {"millivolts": 1000.0 * BEMF_VOLTS_PER_COUNT}
"""Size of each unit's numbers relative to counts."""


def check_magnitudes(log: Log, robot: RobotConfig) -> None:
    """Raise TraceError where a reading is implausibly large or small."""
    shares = {side: bemf_share(log, robot, side) for side in ("left", "right")}
    _check_supply(log, robot, shares)
    radius = robot.model.drive.wheel_radius.value
    for side, share in shares.items():
        wheel = log.wheel(side)
        if wheel is None or share is None or wheel.unit == "counts":
            continue
        lengths = {"metres a second": radius, "millimetres a second": 1000.0 * radius}
        _check_factor(wheel.name, share / USUAL_BEMF_SHARE, {**SPEED_UNITS, **lengths}, "its command")
    _check_gyro(log, robot, list(shares.values()))


def _check_gyro(log: Log, robot: RobotConfig, shares: Sequence[float | None]) -> None:
    gyro, expected = log.channel("gyro"), wheel_turn_rate(log, robot)
    if gyro is None or expected is None:
        return
    factor = slope(expected, gyro.values)
    if factor is None or factor <= 0.0:
        return
    if (
        factor > MAX_FACTOR
        and None not in shares
        and max(each or 0.0 for each in shares) < USUAL_BEMF_SHARE / MIN_SMALL_FACTOR
    ):
        names = " and ".join(
            each.name for each in (log.wheel("left"), log.wheel("right")) if each is not None
        )
        raise TraceError(
            f"{names} are {factor:.3g} times too small for what {gyro.name} says, and small for their "
            "commands: are they in counts of 12 bits?"
        )
    _check_factor(gyro.name, factor, GYRO_UNITS, "the wheels")


def _check_supply(log: Log, robot: RobotConfig, shares: Mapping[str, float | None]) -> None:
    """Raise TraceError where a back-EMF is larger than the voltage that drives the motor: the battery's
    reading, or robot.toml's voltage where there is none."""
    battery = log.channel("battery")
    nominal = robot.model.battery.open_circuit_voltage.value
    known = np.zeros(0) if battery is None else battery.values[np.isfinite(battery.values)]
    seen = float(np.median(known)) if len(known) else nominal
    for side, share in shares.items():
        wheel = log.wheel(side)
        if (
            wheel is None
            or share is None
            or wheel.unit != "counts"
            or share * nominal / seen <= MAX_BEMF_SHARE
        ):
            continue
        if share <= MAX_BEMF_SHARE:
            cell = (
                ": it looks like one cell's"
                if abs(math.log(2.0 * seen / nominal)) < math.log(UNIT_FACTOR)
                else ""
            )
            raise TraceError(
                f"battery.voltage is around {seen:.3g} V, but {wheel.name} shows that about {nominal:.3g} V "
                f"drive the motors{cell}"
            )
        unit = nearest_unit(share / USUAL_BEMF_SHARE, BEMF_UNITS)
        raise TraceError(
            f"{wheel.name} is {share * nominal / seen:.2g} times the voltage that drives the motor: none "
            "reaches that; "
            + (f"it looks like {unit}, not counts" if unit else "is it in counts, and is full power 1?")
        )


def _check_factor(name: str, factor: float, units: Mapping[str, float], than: str) -> None:
    """Raise TraceError where a reading is more than `MAX_FACTOR` times as large, or as small, as expected."""
    if 1.0 / MAX_FACTOR < factor < MAX_FACTOR:
        return
    unit = nearest_unit(factor, units)
    guess = f"it looks like {unit}, not rad/s" if unit else "is it in rad/s, and robot.toml this robot's?"
    raise TraceError(f"{name} is {factor:.3g} times what is expected from {than}: {guess}")


def nearest_unit(factor: float, units: Mapping[str, float]) -> str | None:
    """The units whose factors are within UNIT_FACTOR of this one, nearest first; None where there are
    none."""
    away = {name: abs(math.log(each / factor)) for name, each in units.items()}
    near = sorted((name for name in away if away[name] < math.log(UNIT_FACTOR)), key=lambda name: away[name])
    return " or ".join(near) or None


def bemf_share(log: Log, robot: RobotConfig, side: str) -> float | None:
    """Back-EMF over the voltage of the command where that is steady; None where they are not correlated."""
    wheel = log.wheel(side)
    if wheel is None:
        return None
    index, motor = (0, robot.model.left) if side == "left" else (1, robot.model.right)
    voltage = robot.model.battery.open_circuit_voltage.value
    return slope(steady_duty(log.duty[:, index]) * voltage, volts_per_unit(wheel, motor) * wheel.values)


def volts_per_unit(wheel: Channel, motor: MotorModel) -> float:
    """V of back-EMF for one unit of a wheel's reading."""
    return BEMF_VOLTS_PER_COUNT if wheel.unit == "counts" else motor.back_emf_constant.value


def full_voltage(log: Log, robot: RobotConfig) -> float:
    """V of the battery: the median of its readings, or robot.toml's voltage where there are none."""
    battery = log.channel("battery")
    if battery is not None and np.isfinite(battery.values).any():
        return float(np.nanmedian(battery.values))
    return robot.model.battery.open_circuit_voltage.value


def wheel_rates(log: Log, robot: RobotConfig) -> Array | None:
    """Contributions of the left and the right wheel's reading to the turn rate, rad/s, (n, 2); None where one
    is missing."""
    left, right = log.wheel("left"), log.wheel("right")
    if left is None or right is None:
        return None
    model = robot.model
    per_track = model.drive.wheel_radius.value / model.drive.track_width.value
    by_left, by_right = (
        per_track / motor.back_emf_constant.value * volts_per_unit(wheel, motor) * wheel.values
        for wheel, motor in ((left, model.left), (right, model.right))
    )
    return np.column_stack([-by_left, by_right])


def wheel_turn_rate(log: Log, robot: RobotConfig) -> Array | None:
    """The turn rate by the wheels, rad/s, NaN where the commands do not turn the robot; None without both."""
    rates = wheel_rates(log, robot)
    return None if rates is None else np.where(is_turning(log.duty), rates.sum(axis=1), np.nan)


def is_turning(duty: Array) -> NDArray[np.bool_]:
    """Where the commands turn the robot: on a straight line unequal motors and scales make the wheels
    differ."""
    apart: NDArray[np.bool_] = np.abs(duty[:, 1] - duty[:, 0]) > 0.5 * np.abs(duty).max(axis=1)
    return apart


def steady_duty(duty: Array) -> Array:
    """The command, NaN where it changed within the last 40 samples."""
    return np.where(np.arange(len(duty)) - last_change(duty) >= 40, duty, np.nan)


def last_change(duty: Array) -> NDArray[np.intp]:
    """For each row, the row at which its command last changed."""
    changed = np.abs(np.diff(duty, prepend=duty[0])) > 1e-9
    return np.maximum.accumulate(np.where(changed, np.arange(len(duty)), 0))


def slope(x: Array, y: Array) -> float | None:
    """Least-squares slope through 0 over rows where both are known; None where they do not vary or are not
    correlated."""
    both = np.isfinite(x) & np.isfinite(y)
    x, y = x[both], y[both]
    if len(x) < MIN_SAMPLES or 0.0 in (float(np.ptp(x)), float(np.ptp(y))):
        return None
    if float(np.corrcoef(x, y)[0, 1]) ** 2 < 0.3 or not math.isfinite(float(x @ x)):
        return None
    return float(x @ y / (x @ x))
