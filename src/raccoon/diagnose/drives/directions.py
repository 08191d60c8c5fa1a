"""Checks of a drive's turning directions: reversed motors, and a gyro that does not match the wheels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.errors import TraceError
from raccoon.diagnose.drives.log import Channel, Log
from raccoon.diagnose.drives.magnitudes import MIN_SAMPLES, wheel_rates, wheel_turn_rate

Array = NDArray[np.float64]

MIN_TURN_RATE, MAX_STILL_SHARE = 0.3, 0.1
"""RMS turn rate by the wheels, rad/s, above which the gyro must show a turn, and least share of it that the
gyro must show. The former is also the least gyro offset, and least rate by each wheel, that are checked."""
TURN_TOLERANCE, FREQUENT_SHARE, CHANCE_SHARE = 0.25, 0.03, 0.01
"""Relative tolerance of the gyro on the turn rate of wheels that run against each other; share of the rows in
which it must match to be an error; and share of rows that counts as chance."""
MAX_ZERO_SCATTER = 0.3
"""Largest scatter of the difference of gyro and wheels, relative to its median, for it to be a zero
offset."""
MAX_WHEEL_CORRELATION = 0.9
"""Correlation of the wheels above which their separate contributions to the turns are not identifiable."""
MIN_CLEAR_SHARE = 0.5
"""Least share of the gyro's power that the wheels must explain, and least magnitude of a wheel's coefficient,
which is 1 for a right wheel and -1 for a reversed one."""
MAX_SHARE = 2.0
"""Largest plausible coefficient."""


def check_motor_directions(log: Log, robot: RobotConfig) -> None:
    """Raise TraceError if one motor and its reading are both reversed: its command and reading agree, but the
    gyro shows the opposite effect on the robot."""
    gyro, wheels, both = log.channel("gyro"), _wheels(log), wheel_rates(log, robot)
    if gyro is None or wheels is None or both is None:
        return
    known = np.isfinite(both).all(axis=1) & np.isfinite(gyro.values)
    if known.sum() < MIN_SAMPLES or float(np.ptp(both[known], axis=0).min()) == 0.0:
        return
    index = _find_reversed_wheel(both[known], gyro.values[known])
    if index is None:
        return
    port = (robot.drive.left, robot.drive.right)[index]
    raise TraceError(
        f"{gyro.name} says that motor {port} turns the other way than its command and "
        f"{wheels[index].name}: {_describe_inversion(robot, port)}, or swap the two wires of its plug and "
        "record again"
    )


def check_wheel_directions(log: Log, robot: RobotConfig) -> None:
    """Raise TraceError if no command and no wheel reading is ever negative, but the gyro shows that the
    wheels ran against each other."""
    gyro, wheels, rates = log.channel("gyro"), _wheels(log), wheel_rates(log, robot)
    if gyro is None or wheels is None or rates is None or float(log.duty.min()) < 0.0:
        return
    both = np.abs(rates)
    known = np.isfinite(both).all(axis=1) & np.isfinite(gyro.values)
    if any((each.values[known] < -5.0 * each.floor).mean() > CHANCE_SHARE for each in wheels):
        return
    turns, most = known & (both.min(axis=1) > MIN_TURN_RATE), both.sum(axis=1)
    against = turns & (np.abs(np.abs(gyro.values) - most) < TURN_TOLERANCE * most)
    straight = turns & (np.abs(gyro.values) < TURN_TOLERANCE * most)
    ways = [(against & (way * gyro.values > 0.0)).sum() for way in (-1.0, 1.0)]
    # If one motor is reversed, the wheels run against each other in one direction only, and all the time.
    several = max(straight.sum(), min(ways)) > MIN_SAMPLES
    if against.sum() > max(FREQUENT_SHARE * known.sum(), MIN_SAMPLES) and several:
        names = ", ".join(each.name for each in wheels)
        raise TraceError(
            f"the commands and {names} never go below 0, but {gyro.name} says that the wheels turned the "
            "robot against each other: they hold how large each was, not which way; write them with their "
            "signs"
        )


def check_gyro_zero(log: Log, robot: RobotConfig) -> None:
    """Raise TraceError if the gyro differs from the wheels by a constant. (The difference is not constant
    when a hand turns the robot.)"""
    gyro, rates = log.channel("gyro"), wheel_rates(log, robot)
    if gyro is None or rates is None:
        return
    off = gyro.values - rates.sum(axis=1)
    off = off[np.isfinite(off)]
    if len(off) < MIN_SAMPLES:
        return
    middle = float(np.median(off))
    if abs(middle) > MIN_TURN_RATE and 1.48 * float(np.median(np.abs(off - middle))) < MAX_ZERO_SCATTER * abs(
        middle
    ):
        raise TraceError(
            f"{gyro.name} says {middle:.2g} rad/s more than the wheels all the time: its zero is off. "
            "Subtract what it reads at rest"
        )


def _find_reversed_wheel(both: Array, rate: Array) -> int | None:
    """Index of the wheel that turns the robot opposite to its reading, None if neither clearly does. both (n,
    2), rate (n,): turn rate by the left and the right wheel, and by the gyro, rad/s."""
    power = max(float(rate @ rate), 1e-300)
    alike = abs(float(np.corrcoef(both[:, 0], both[:, 1])[0, 1])) > MAX_WHEEL_CORRELATION
    if not alike:
        shares: Array = np.asarray(np.linalg.lstsq(both, rate, rcond=None)[0], float)
        left = float(((rate - both @ shares) ** 2).sum()) / power
        clear = (
            left < 1.0 - MIN_CLEAR_SHARE
            and shares.max() > MIN_CLEAR_SHARE
            and shares.min() < -MIN_CLEAR_SHARE
        )
        return int(np.argmin(shares)) if clear else None
    # If both wheels are always proportional, only their sum and difference are identifiable.
    explained = {way: _explained_power(both @ np.array(way), rate) / power for way in SIGNS}
    best = max(explained, key=lambda way: explained[way])
    if explained[best] < MIN_CLEAR_SHARE or explained[AS_WRITTEN] > 0.5 * explained[best]:
        return None
    return best.index(-1.0) if -1.0 in best else None


AS_WRITTEN = (1.0, 1.0)
SIGNS = (AS_WRITTEN, (-1.0, 1.0), (1.0, -1.0))
"""Signs of the left and the right wheel."""


def _explained_power(expected: Array, rate: Array) -> float:
    """Power of the gyro that a turn rate explains with a plausible factor; 0 if the factor is not
    plausible."""
    square = float(expected @ expected)
    factor = float(expected @ rate) / square if square > 0.0 else 0.0
    return factor**2 * square if MIN_CLEAR_SHARE < factor < MAX_SHARE else 0.0


def _describe_inversion(robot: RobotConfig, port: int) -> str:
    """Advice on the key `inverted` of a motor in robot.toml."""
    wanted = "false" if robot.motor(port).inverted else "true"
    return f"write inverted = {wanted} under [motor.{port}] in robot.toml"


def check_gyro_turns(log: Log, robot: RobotConfig) -> None:
    """Raise TraceError if the gyro hardly turns although the wheels turn the robot."""
    gyro, expected = log.channel("gyro"), wheel_turn_rate(log, robot)
    if gyro is None or expected is None:
        return
    both = np.isfinite(expected) & np.isfinite(gyro.values)
    if both.sum() < MIN_SAMPLES:
        return
    wheels, seen = (float(np.sqrt(np.mean(each[both] ** 2))) for each in (expected, gyro.values))
    if wheels <= MIN_TURN_RATE or seen >= MAX_STILL_SHARE * wheels:
        return
    said = f"{gyro.name} hardly turns ({seen:.2g} rad/s) while the wheels turn the robot ({wheels:.2g} rad/s)"
    if _against_each_other(log):
        left, right = (_describe_inversion(robot, port) for port in (robot.drive.left, robot.drive.right))
        raise TraceError(
            f"{said}, which always turn in opposite directions. If it drove straight, one motor turns the "
            f"other way than robot.toml says: {left}, or {right}, whichever turns its wheel backwards at a "
            "positive duty. If it spun on the spot, the gyro's column is another axis, or the wheels were "
            "off the floor"
        )
    raise TraceError(f"{said}: is it another axis, or were the wheels off the floor?")


def _against_each_other(log: Log) -> bool:
    """Whether one wheel always runs backwards when the other runs forwards: a drive of nothing but spins on
    the spot is implausible."""
    wheels = _wheels(log)
    if wheels is None:
        return False
    left, right = (each.values / max(float(np.nanmax(np.abs(each.values))), 1e-300) for each in wheels)
    known = np.isfinite(left + right)
    return float(np.corrcoef(left[known], right[known])[0, 1]) < -MAX_WHEEL_CORRELATION


def _wheels(log: Log) -> tuple[Channel, Channel] | None:
    left, right = log.wheel("left"), log.wheel("right")
    return None if left is None or right is None else (left, right)
