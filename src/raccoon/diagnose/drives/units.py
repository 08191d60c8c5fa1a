"""Checks of a drive's columns: units, signs, and wheels that are exchanged."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.errors import TraceError
from raccoon.core.readings import BEMF_VOLTS_PER_COUNT
from raccoon.diagnose.drives.directions import (
    check_gyro_turns,
    check_motor_directions,
    check_wheel_directions,
)
from raccoon.diagnose.drives.log import Channel, Log, arrange_columns
from raccoon.diagnose.drives.magnitudes import (
    DEGREES_PER_RADIAN,
    MAX_FACTOR,
    MIN_SAMPLES,
    SPEED_UNITS,
    USUAL_BEMF_SHARE,
    check_magnitudes,
    nearest_unit,
    slope,
    steady_duty,
    volts_per_unit,
    wheel_turn_rate,
)
from raccoon.diagnose.drives.obstructions import find_held_spans, without_held_readings
from raccoon.diagnose.drives.response_checks import check_signs
from raccoon.diagnose.drives.stalls import DRIVEN_SHARE, SIDES, find_stalls
from raccoon.diagnose.drives.time_column import MAX_STEP_S
from raccoon.trace.recording import duty_unit_hint, median_step

Array = NDArray[np.float64]

DEGREES_FACTOR_RANGE = (0.5 * DEGREES_PER_RADIAN, 2.0 * DEGREES_PER_RADIAN)
"""Factor by which a gyro in degrees is too large, on a robot whose other numbers are right within a factor of
2."""
BEST_PERCENTILE = 75.0
"""Percentile of a wheel's reading over its command that stands for free turning."""
MIN_BEMF_SHARE = 0.2
"""Back-EMF, as a share of its command's voltage, that every freely turning motor reaches."""
MAX_SWAPPED_ERROR_RATIO = 0.5
"""Largest error of a wheel from the other wheel's command, relative to that from its own, that shows swapped
columns."""
MIN_CORRELATION = 0.8
"""Least correlation of a wheel with the steady command that it follows."""
MAX_COMMAND_CORRELATION = 0.9
"""Correlation of the two commands above which it cannot be told which one a wheel follows."""
MIN_CORRELATION_LEAD = 0.5
"""Least lead of the other wheel's command in correlation that shows swapped columns."""


def describe_wrong_units(columns: Mapping[str, Array], robot: RobotConfig, *, native: bool = False) -> str:
    """The error of `check_units` for a recording's columns, which may be too slow or too short for a
    diagnosis; "" where there is none, or no command to compare with."""
    commands = [columns.get(f"motor.{port}.duty") for port in (robot.drive.left, robot.drive.right)]
    if any(each is None or not np.isfinite(each).any() for each in commands):
        return ""
    try:
        log = arrange_columns(columns, robot)
        check_signs(log)
        check_wheel_directions(log, robot)
        check_units(only_free_driving(log, robot), robot, native=native)
    except TraceError as error:
        return str(error)
    return ""


def only_free_driving(
    log: Log, robot: RobotConfig, held: tuple[tuple[float, float], ...] | None = None
) -> Log:
    """The part of a log from which units can be judged: free driving, without stalled wheels.

    The whole log is returned where a wheel always reads less than any motor gives (which looks like a wall
    and is another unit), and where the time is implausible (in microseconds it would be months). held: the
    result of `find_held_spans`, where it is known.
    """
    advances = len(log.time) > 1 and bool((np.diff(log.time) > 0.0).all())
    timed = advances and median_step(log.time) <= MAX_STEP_S
    if not timed or any(_always_small(log, robot, index) for index in (0, 1)):
        return log
    known = find_held_spans(log, robot) if held is None else held
    stood = ((each.start, each.end) for each in find_stalls(log, robot))
    return without_held_readings(replace(log, held=(*known, *stood)))


def _always_small(log: Log, robot: RobotConfig, index: int) -> bool:
    """Whether a driven wheel reads less than any motor gives even at BEST_PERCENTILE: a wheel that is stalled
    half of the time is not in another unit."""
    wheel, motor = log.wheel(SIDES[index]), getattr(robot.model, SIDES[index])
    if wheel is None:
        return False
    asked = (np.abs(log.duty[:, index]) > DRIVEN_SHARE) & np.isfinite(wheel.values)
    if asked.sum() < MIN_SAMPLES:
        return False
    full = robot.model.battery.open_circuit_voltage.value
    shares = volts_per_unit(wheel, motor) * wheel.values[asked] / (full * log.duty[asked, index])
    return bool(np.percentile(np.abs(shares), BEST_PERCENTILE) < USUAL_BEMF_SHARE / MAX_FACTOR)


def check_units(log: Log, robot: RobotConfig, *, native: bool = False) -> None:
    """Raise TraceError where the size or sign of a channel contradicts its name. log: free driving.

    native: whether the recording names its firmware, and with it all units. Then only what the robot or its
    robot.toml can have wrong is checked, such as signs.
    """
    largest = float(np.abs(log.duty).max())
    if largest > 1.0 + 1e-6:
        raise TraceError(f"duty reaches {largest:g}: allowed is -1..1; {duty_unit_hint(largest)}")
    if not native:
        _check_battery(log)
    _check_plugs(log)
    check_wheel_signs(log, robot)
    if not native:
        _check_counts(log, robot)
    _check_gyro(log, robot, native)
    if not native:
        check_magnitudes(log, robot)
    check_motor_directions(log, robot)
    check_gyro_turns(log, robot)


def _check_battery(log: Log) -> None:
    battery = log.channel("battery")
    if battery is None:
        return
    known = battery.values[np.isfinite(battery.values)]
    if not len(known):
        return
    middle = float(np.median(known))
    if middle > 100.0:
        guess = "counts" if middle < 2500.0 else "counts or millivolts" if middle < 4096.0 else "millivolts"
        raise TraceError(f"{battery.name} is around {middle:g} V: it looks like {guess}, not volts")
    if not 1.0 < middle < 30.0:
        raise TraceError(f"{battery.name} is around {middle:g} V: allowed are 1 to 30 V")


def check_wheel_signs(log: Log, robot: RobotConfig) -> None:
    """Raise TraceError where a wheel's reading has the opposite sign of its command."""
    for _, channel, factor in _wheels_over_commands(log, robot):
        if factor < -0.2:
            raise TraceError(
                f"{channel.name} has the opposite sign of its command (robot.toml's inverted flips both): "
                "write one of the two with the other sign, or check the wires by which the motor is read"
            )


def _check_counts(log: Log, robot: RobotConfig) -> None:
    """Raise TraceError where a back-EMF is far too small for its command."""
    for side, channel, factor in _wheels_over_commands(log, robot):
        if channel.unit == "counts" and MIN_BEMF_SHARE / 1e4 < factor < MIN_BEMF_SHARE:
            unit = nearest_unit(factor / USUAL_BEMF_SHARE, _bemf_units(robot, side))
            guess = f"it looks like {unit}, not counts" if unit else "is it in counts?"
            raise TraceError(f"{channel.name} is {USUAL_BEMF_SHARE / factor:.0f} times too small: {guess}")


def _wheels_over_commands(log: Log, robot: RobotConfig) -> Iterator[tuple[str, Channel, float]]:
    """Side, reading, and slope of the reading over its command in the reading's unit, of each wheel that
    shows a slope."""
    voltage = robot.model.battery.open_circuit_voltage.value
    for index, side in enumerate(("left", "right")):
        channel = log.wheel(side)
        if channel is None:
            continue
        volts = BEMF_VOLTS_PER_COUNT if channel.unit == "counts" else 1.0
        factor = slope(steady_duty(log.duty[:, index]) * voltage / volts, channel.values)
        if factor is not None:
            yield side, channel, factor


def _bemf_units(robot: RobotConfig, side: str) -> Mapping[str, float]:
    """Size of each unit's numbers relative to counts."""
    motor = robot.model.left if side == "left" else robot.model.right
    a_count = BEMF_VOLTS_PER_COUNT / motor.back_emf_constant.value
    speeds = {"radians a second": a_count, "metres a second": a_count * robot.model.drive.wheel_radius.value}
    return {
        "volts": BEMF_VOLTS_PER_COUNT,
        **speeds,
        "turns a minute": a_count * SPEED_UNITS["turns a minute"],
    }


def _check_plugs(log: Log) -> None:
    """Raise TraceError where each wheel follows the other's command: two columns of the log are swapped."""
    wheels = [log.wheel(side) for side in ("left", "right")]
    held = np.column_stack([steady_duty(log.duty[:, 0]), steady_duty(log.duty[:, 1])])
    crossed = []
    for index, wheel in enumerate(wheels):
        if wheel is None:
            return
        known = np.isfinite(held).all(axis=1) & np.isfinite(wheel.values)
        duty, reading = held[known], wheel.values[known]
        if known.sum() < 50 or float(np.ptp(duty, axis=0).min()) == 0.0 or float(np.ptp(reading)) == 0.0:
            return
        if abs(float(np.corrcoef(duty[:, 0], duty[:, 1])[0, 1])) > MAX_COMMAND_CORRELATION:
            return
        own, other = (float(np.corrcoef(duty[:, each], reading)[0, 1]) for each in (index, 1 - index))
        # In a mostly straight drive a wheel also follows the other's command, with the turns as its error.
        off_own, off_other = 1.0 - own * abs(own), 1.0 - other * abs(other)
        nearer = own < other - MIN_CORRELATION_LEAD or off_other < MAX_SWAPPED_ERROR_RATIO**2 * off_own
        crossed.append(other > MIN_CORRELATION and nearer)
    if all(crossed):
        left, right = (each.name for each in wheels if each is not None)
        raise TraceError(
            f"{left} follows the command of {right} and vice versa: the columns of the two commands are "
            "swapped, or those of the readings"
        )


def _check_gyro(log: Log, robot: RobotConfig, native: bool) -> None:
    gyro, expected = log.channel("gyro"), wheel_turn_rate(log, robot)
    if gyro is None or expected is None:
        return
    factor = slope(expected, gyro.values)
    if factor is None:
        return
    if factor > 20.0 and not native:
        least, most = DEGREES_FACTOR_RANGE
        guess = "degrees" if factor <= most else "the sensor's own counts, milliradians or millidegrees"
        guess += "" if factor >= least else " or the sensor's own counts"
        raise TraceError(
            f"{gyro.name} is {factor:.0f} times what the wheels say: it looks like {guess}, not radians"
        )
    if factor < -0.2:
        raise TraceError(
            f"{gyro.name} turns against the wheels: left and right are swapped, the gyro's axis points down, "
            "or both motors turn the other way than robot.toml's inverted says"
        )
