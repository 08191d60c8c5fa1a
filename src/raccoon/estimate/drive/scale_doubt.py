"""Detection of wheel scales and a track width that are more wrong than robot.toml's standard deviations
allow."""

from __future__ import annotations

from math import hypot, sqrt

from raccoon.estimate.ekf.filter import covariance_index, variance_index
from raccoon.estimate.ekf.generated import Flat
from raccoon.estimate.ekf.state import State

SURPRISING_STDS = 3.0
"""Threshold, in standard deviations of robot.toml, above which its standard deviations are distrusted as
well."""
MIN_GROWTH = 1.1
"""Factor by which an error must exceed the uncertainty added so far before more is added."""

NO_DOUBT = (0.0, 0.0)


class ScaleDoubt:
    """Compares, in every step, the two scales that every drive shows with robot.toml.

    Driving straight shows unequal wheels (BALANCE); a turn shows the turn of the wheels against the gyro's
    (WHEEL_TURN over GYRO_SCALE). Neither shows which number of robot.toml is wrong. Within its standard
    deviations the filter divides the error among them. If the error is far beyond these, any single number
    may hold all of it, and distances may be wrong by as much. Turns show which wheel it is; whether it is
    both wheels or the track width, only a tape or an observation shows.
    """

    __slots__ = ("_balance_limit", "_doubted", "_gyro_scale", "_turn_limit")

    def __init__(self, flat: Flat) -> None:
        """flat: the filter's state and covariance before any reading."""
        self._balance_limit = SURPRISING_STDS * sqrt(flat[variance_index(State.BALANCE)])
        self._gyro_scale = flat[State.GYRO_SCALE]
        shared = flat[covariance_index(State.WHEEL_TURN, State.GYRO_SCALE)] / self._gyro_scale
        of_gyro = flat[variance_index(State.GYRO_SCALE)] / self._gyro_scale**2
        self._turn_limit = SURPRISING_STDS * sqrt(
            flat[variance_index(State.WHEEL_TURN)] - 2.0 * shared + of_gyro
        )
        self._doubted = NO_DOUBT

    def added_deviations(self, flat: Flat) -> tuple[float, float]:
        """Relative standard deviations to add to WAY: for unequal wheels, and for wrong turns; almost always
        0."""
        balance = abs(flat[State.BALANCE])
        turn = abs(flat[State.WHEEL_TURN] * self._gyro_scale / flat[State.GYRO_SCALE] - 1.0)
        if balance > self._balance_limit:
            turn = min(turn, abs(turn - balance))  # a single wrong wheel turns the robot by the same share
        doubted = self._doubted
        added = (
            _added_deviation(balance, self._balance_limit, doubted[0]),
            _added_deviation(turn, self._turn_limit, doubted[1]),
        )
        if added != NO_DOUBT:
            self._doubted = hypot(doubted[0], added[0]), hypot(doubted[1], added[1])
        return added


def _added_deviation(error: float, allowed: float, doubted: float) -> float:
    return sqrt(error * error - doubted * doubted) if error > max(allowed, MIN_GROWTH * doubted) else 0.0
