"""Whether robot.toml is more wrong about the wheels and the track width than it says."""

from __future__ import annotations

from math import hypot, sqrt

from raccoon.estimate.ekf.filter import covariance_index, variance_index
from raccoon.estimate.ekf.generated import Flat
from raccoon.estimate.ekf.state import State

SURPRISING_STDS = 3.0
"""Deviations by robot.toml from which on what it says of its deviations is not believed either."""
MIN_GROWTH = 1.1
"""Times what is in doubt already, before more of it is."""

NO_DOUBT = (0.0, 0.0)


class ScaleDoubt:
    """Asks in every step how far both scales that show in every drive are off what robot.toml has.

    A straight shows that the wheels are unlike (BALANCE), a turn that they turn the robot otherwise than the
    gyro (WHEEL_TURN over GYRO_SCALE). Neither says which number is wrong. Within the deviations of robot.toml
    the filter shares it among them; a calibration that is far beyond its own may have any one wrong, and all
    of it: the way is then off by as much as they are. Which wheel it is turns tell; whether it is both or the
    track, nothing but a tape or something seen.
    """

    __slots__ = ("_balance_limit", "_doubted", "_gyro_scale", "_turn_limit")

    def __init__(self, flat: Flat) -> None:
        """flat: the filter's belief before anything was read."""
        self._balance_limit = SURPRISING_STDS * sqrt(flat[variance_index(State.BALANCE)])
        self._gyro_scale = flat[State.GYRO_SCALE]
        shared = flat[covariance_index(State.WHEEL_TURN, State.GYRO_SCALE)] / self._gyro_scale
        of_gyro = flat[variance_index(State.GYRO_SCALE)] / self._gyro_scale**2
        self._turn_limit = SURPRISING_STDS * sqrt(
            flat[variance_index(State.WHEEL_TURN)] - 2.0 * shared + of_gyro
        )
        self._doubted = NO_DOUBT

    def added_deviations(self, flat: Flat) -> tuple[float, float]:
        """Deviations to add to what is not known of WAY, for wheels that are unlike and for turns that are
        otherwise; hardly ever above 0.
        """
        balance = abs(flat[State.BALANCE])
        turn = abs(flat[State.WHEEL_TURN] * self._gyro_scale / flat[State.GYRO_SCALE] - 1.0)
        if balance > self._balance_limit:
            turn = min(turn, abs(turn - balance))  # one wheel that is another turns the robot as much
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
