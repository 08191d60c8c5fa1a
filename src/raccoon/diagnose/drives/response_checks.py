"""Checks that wheels and gyro respond to the commands of their rows: lost signs, and mismatched times.

Fits can absorb such errors: late commands became slip and a filter, rounded ones a scale of the readings. So
the simplest wheel model, which follows its command by a low-pass, dry friction and an offset, is tried first,
at every delay, and a family of better models if it does not fit. No cause in the catalogue makes a wheel
respond early, or leaves a fifth of its motion unexplained by the command.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import TraceError
from raccoon.diagnose.drives.log import Channel, Log
from raccoon.diagnose.drives.ramp import estimate_ramp
from raccoon.diagnose.drives.response_models import (
    MIN_READINGS,
    DelayScan,
    Response,
    estimate_response,
    least_residual_power,
)

Array = NDArray[np.float64]

EARLIEST_RESPONSE_S, EARLIEST_GYRO_RESPONSE_S = -0.015, -0.035
"""Delay, s, below which a response is early: of a wheel, and of a gyro, which has no filter that delays it.
If commands are logged one row late, both are still above it."""
MAX_GYRO_LEAD_S = -0.055
"""Delay of the gyro relative to the wheels' filtered readings, s, below which it is early; it led by 0.03 s
at most in 120 drives."""
MAX_UNEXPLAINED = 0.25
"""Unexplained share of a reading's power above which the commands do not explain it: 0.05 at most in 67
drives with each cause in turn, up to twice its usual size."""
MAX_UNEXPLAINED_GYRO, MIN_TURN_DUTY_STD = 0.5, 0.1
"""The same for a gyro, for which it was 0.06 at most; and least standard deviation of the turning duty for
this check."""
DIRECTIONS = ((1.0, "below"), (-1.0, "above"))
MAX_SLOW_RAMP = 5.0
"""Largest slew rate that is an error, duty per second: a current limit may look like a slew limit of 8."""
MAX_UNDRIVEN_RANGE = 0.5
"""Range of an undriven wheel's reading, relative to the other wheel's, above which it must have been
driven."""
DRIVEN_DUTY, TURNING_SHARE, FREQUENT_SHARE = 0.2, 0.3, 0.05
"""Duty that clearly drives a wheel; share of the largest reading that is clearly a turn; and share of the
rows above which something is no chance."""
MIN_SPEED_CORRELATION = 0.67
"""Correlation with the magnitude of the commands above which an unsigned reading is a speed: at least 0.83
for speeds and at most 0.51 for angles on 18 blind drives."""
MIN_TURN_RATE, MIN_SAME_SHARE, MIN_TURNING_ROWS = 0.5, 0.9, 100
"""Turn rate, rad/s, at which the wheels must differ; share of equal readings in such rows above which one
column was written twice (noise makes few equal); and least number of such rows."""


def check_signs(log: Log) -> None:
    """Raise TraceError if a command or a reading has lost its sign, or both wheels have the same column."""
    _check_different_columns(log)
    for index, wheel, command in _measured_wheels(log):
        _check_command_sign(log.duty[:, index], wheel, command)
        _check_word_overflow(wheel)
        _check_reading_sign(log.duty[:, index], wheel, ("its motor was driven", "the wheel"))
    gyro = log.channel("gyro")
    if gyro is not None:
        _check_reading_sign(_turn_command(log), gyro, ("the robot was turned", "the robot"))


def _check_different_columns(log: Log) -> None:
    """Raise TraceError if both wheels have equal readings although their commands differ or the gyro
    turns."""
    left, right, gyro = log.wheel("left"), log.wheel("right"), log.channel("gyro")
    if left is None or right is None:
        return
    differ = np.abs(log.duty[:, 0] - log.duty[:, 1]) > DRIVEN_DUTY
    if gyro is not None:
        differ |= np.abs(gyro.values) > MIN_TURN_RATE
    differ &= np.isfinite(left.values) & (left.values != 0.0)
    same = differ & (left.values == right.values)
    if differ.sum() >= MIN_TURNING_ROWS and same.sum() > MIN_SAME_SHARE * differ.sum():
        raise TraceError(
            f"{left.name} and {right.name} hold the same numbers, also where the robot turns: one column was "
            "written twice, or both are of one motor"
        )


def _check_command_sign(duty: Array, wheel: Channel, command: str) -> None:
    known = np.isfinite(wheel.values)
    if known.sum() < MIN_READINGS:
        return
    duty, reading = duty[known], wheel.values[known]
    least = _surely_turning_size(reading, wheel)
    for way, to in DIRECTIONS:
        turns = way * reading[way * duty > DRIVEN_DUTY]
        if not (way * duty < 0.0).any() and _is_frequent(turns < -least) and _is_frequent(turns > least):
            raise TraceError(
                f"{command} never goes {to} 0, but {wheel.name} turns both ways: it holds how large a "
                "command was, not which way; write it with its sign, from -1 to 1"
            )


def _check_reading_sign(duty: Array, channel: Channel, said: tuple[str, str]) -> None:
    known = np.isfinite(channel.values)
    if known.sum() < MIN_READINGS:
        return
    duty, reading = duty[known], channel.values[known]
    least = _surely_turning_size(reading, channel)
    for way, to in DIRECTIONS:
        against = way * duty < -DRIVEN_DUTY
        both = _is_frequent(way * duty > DRIVEN_DUTY) and _is_frequent(against)
        both = both and bool(np.ptp(reading[against]) > 0.0)  # a constant holds no magnitude either
        if both and not (way * reading < -least).any() and _is_frequent(way * reading[against] > least):
            was_driven, who = said
            raise TraceError(
                f"{channel.name} never goes {to} 0, but {was_driven} both ways: "
                + _describe_unsigned(duty, way * reading, way, who)
            )


def _describe_unsigned(duty: Array, size: Array, way: float, who: str) -> str:
    """Describes a reading that never changes its sign: an offset, an absolute speed or an angle. size: the
    reading with a positive sign."""
    as_signed, as_fast = (float(np.corrcoef(each, size)[0, 1]) for each in (way * duty, np.abs(duty)))
    if as_signed > max(MIN_SPEED_CORRELATION, as_fast):
        return "its zero is off; subtract what it reads at rest"
    if as_fast > MIN_SPEED_CORRELATION:
        return f"it holds how fast {who} turned, not which way; write it with its sign"
    return f"it holds how far {who} had turned, and not how fast it turns"


def _check_word_overflow(wheel: Channel) -> None:
    """Raise TraceError if negative numbers were written as unsigned words, which makes them the largest
    ones."""
    known = wheel.values[np.isfinite(wheel.values)]
    for bits in (16, 32):
        beyond = np.abs(known) > 0.75 * 2.0**bits
        if wheel.unit == "counts" and beyond.mean() > 0.02 and not (np.abs(known) > 2.0**bits).any():
            raise TraceError(
                f"{wheel.name} reaches {float(np.abs(known).max()):g}: numbers below 0 seem to be written as "
                f"words of {bits} bits without a sign; subtract {2**bits} from values above {2 ** (bits - 1)}"
            )


def _surely_turning_size(reading: Array, channel: Channel) -> float:
    """Magnitude of a reading above which something clearly turns, in the reading's unit."""
    return max(TURNING_SHARE * float(np.percentile(np.abs(reading), 99.0)), 5.0 * channel.floor)


def _turn_command(log: Log) -> Array:
    """The turning part of the commands, duty, positive to the left as for a gyro."""
    return np.asarray(0.5 * (log.duty[:, 1] - log.duty[:, 0]), float)


def _is_frequent(flags: NDArray[np.bool_]) -> bool:
    return bool(len(flags)) and float(flags.mean()) > FREQUENT_SHARE


def check_responses(log: Log) -> None:
    """Raise TraceError if a wheel or the gyro responds before its command, or does not follow it at all."""
    for index, wheel, command in _measured_wheels(log):
        _check_undriven_wheel(log, index, wheel, command)
        response = estimate_response(
            log.time, [log.duty[:, index]], wheel, EARLIEST_RESPONSE_S, MAX_UNEXPLAINED
        )
        if response is None:
            continue
        if response.is_early:
            raise TraceError(
                f"{wheel.name} responds {-1000.0 * response.delay:.0f} ms before {command} changes: the "
                "commands are logged late, or behind a ramp or a filter that the motor does not have, or "
                "the two have clocks of their own. Log what is given to the motor, in the row in which it "
                "is given"
            )
        if response.unexplained > MAX_UNEXPLAINED:
            raise TraceError(
                f"{wheel.name} does not follow {command}, which explains "
                f"{response.explained_percent} of it at any delay (95 % on a robot): are they of the same "
                "motor and the same drive, and is it all that was given to the motor?"
            )
    ramp = _find_slow_ramp(log)
    if ramp is not None:
        names = " and ".join(command for _, _, command in _measured_wheels(log))
        raise TraceError(
            f"the wheels follow {names} as if a ramp of about {ramp:g} a second were between them: the "
            "columns hold what was asked for, before something slowed it down. Log what the motors are given"
        )
    _check_gyro(log)


def _check_gyro(log: Log) -> None:
    gyro, turn = log.channel("gyro"), _turn_command(log)
    # While the robot drives straight, its turns come from unequal wheels and not from commands.
    if gyro is None or not float(np.std(turn)) > MIN_TURN_DUTY_STD:
        return
    response = estimate_response(
        log.time, [-log.duty[:, 0], log.duty[:, 1]], gyro, EARLIEST_GYRO_RESPONSE_S, MAX_UNEXPLAINED_GYRO
    )
    if response is None or not (response.is_early or response.unexplained > MAX_UNEXPLAINED_GYRO):
        return
    beside = _response_to_wheels(log, gyro)
    if response.is_early and (beside is None or beside.delay < MAX_GYRO_LEAD_S):
        ahead = response.delay if beside is None else beside.delay
        raise TraceError(
            f"{gyro.name} turns {-1000.0 * ahead:.0f} ms before "
            + (
                "the commands change"
                if beside is None
                else "the wheels do, which respond to the commands in time"
            )
            + ": its rows are shifted in time against those of commands and wheels"
        )
    if response.unexplained > MAX_UNEXPLAINED_GYRO and (
        beside is None or beside.unexplained > MAX_UNEXPLAINED_GYRO
    ):
        raise TraceError(
            f"{gyro.name} does not turn as the commands and the wheels do, which explain "
            f"{response.explained_percent} of it at any delay: is it another axis, an angle, or of another "
            "drive?"
        )


def _response_to_wheels(log: Log, gyro: Channel) -> Response | None:
    """The response of a gyro to the readings of both wheels; None if one of them has too few readings."""
    left, right = log.wheel("left"), log.wheel("right")
    if left is None or right is None:
        return None
    known = np.isfinite(left.values) & np.isfinite(right.values)
    scan = DelayScan.of(log.time, gyro)
    if scan is None or known.sum() < MIN_READINGS:
        return None
    every = np.arange(len(known))
    turn = np.interp(every, every[known], right.values[known] - left.values[known])
    return scan.response(lambda rows: least_residual_power(turn[rows, None], scan.reading), MAX_GYRO_LEAD_S)


def _check_undriven_wheel(log: Log, index: int, wheel: Channel, command: str) -> None:
    """Raise TraceError if a wheel moves although its command is constant and only the other's changes."""
    duty, other = log.duty[:, index], log.duty[:, 1 - index]
    if np.ptp(duty) > 0.0 or not np.ptp(other) > DRIVEN_DUTY:
        return
    beside = log.wheel(("right", "left")[index])
    if beside is None:
        return
    turns, most = _reading_range(wheel), _reading_range(beside)
    if turns > MAX_UNDRIVEN_RANGE * most:
        raise TraceError(
            f"{command} is {float(duty[0]):g} all the time, but {wheel.name} changes by {turns:.3g} "
            f"{wheel.unit}: it is not what was given to this motor"
        )


def _measured_wheels(log: Log) -> Iterator[tuple[int, Channel, str]]:
    """Index in the commands, channel, and name of the command of each measured wheel."""
    for index, side in enumerate(("left", "right")):
        wheel = log.wheel(side)
        if wheel is not None:
            yield index, wheel, f"{wheel.name.rpartition('.')[0]}.duty"


def _reading_range(wheel: Channel) -> float:
    return float(np.ptp(np.nanpercentile(wheel.values, [1.0, 99.0])))


def _find_slow_ramp(log: Log) -> float | None:
    """Slew rate of the first wheel, duty per second, if all wheels are behind a slow slew limit; else None.
    For a drive without one, only the first wheel is evaluated."""
    ramps: list[float | None] = []
    for index, wheel, _ in _measured_wheels(log):
        ramps.append(estimate_ramp(log.time, log.duty[:, index], wheel))
        if ramps[-1] is None or ramps[-1] > MAX_SLOW_RAMP:
            return None
    return ramps[0] if ramps else None
