"""Whether robot.toml is more wrong about the wheels and the track width than it says."""

from __future__ import annotations

from math import hypot, sqrt

from raccoon.estimate.ekf.filter import covariance_index, variance_index
from raccoon.estimate.ekf.generated import Flat
from raccoon.estimate.ekf.state import State

SURPRISING = 3.0
"""Deviations by robot.toml from which on what it says of its deviations is not believed either."""
MORE = 1.1
"""Times what is in doubt already, before more of it is."""

NOTHING = (0.0, 0.0)


class ScaleDoubt:
    """Asks in every step how far both scales that show in every drive are off what robot.toml has.

    A straight shows that the wheels are unlike (BALANCE), a turn that they turn the robot otherwise than the
    gyro (WHEEL_TURN over GYRO_SCALE). Neither says which number is wrong. Within the deviations of robot.toml
    the filter shares it among them; a calibration that is far beyond its own may have any one wrong, and all
    of it: the way is then off by as much as they are. Which wheel it is turns tell; whether it is both or the
    track, nothing but a tape or something seen.
    """

    __slots__ = ("_balance", "_doubted", "_gyro", "_turn")

    def __init__(self, flat: Flat) -> None:
        """flat: the filter's belief before anything was read."""
        self._balance = SURPRISING * sqrt(flat[variance_index(State.BALANCE)])
        self._gyro = flat[State.GYRO_SCALE]
        shared = flat[covariance_index(State.WHEEL_TURN, State.GYRO_SCALE)] / self._gyro
        of_gyro = flat[variance_index(State.GYRO_SCALE)] / self._gyro**2
        self._turn = SURPRISING * sqrt(flat[variance_index(State.WHEEL_TURN)] - 2.0 * shared + of_gyro)
        self._doubted = NOTHING

    def more(self, flat: Flat) -> tuple[float, float]:
        """Deviations to add to what is not known of WAY, for wheels that are unlike and for turns that are
        otherwise; hardly ever above 0.
        """
        balance = abs(flat[State.BALANCE])
        turn = abs(flat[State.WHEEL_TURN] * self._gyro / flat[State.GYRO_SCALE] - 1.0)
        if balance > self._balance:
            turn = min(turn, abs(turn - balance))  # one wheel that is another turns the robot as much
        before = self._doubted
        more = _more(balance, self._balance, before[0]), _more(turn, self._turn, before[1])
        if more != NOTHING:
            self._doubted = hypot(before[0], more[0]), hypot(before[1], more[1])
        return more


def _more(off: float, allowed: float, doubted: float) -> float:
    return sqrt(off * off - doubted * doubted) if off > max(allowed, MORE * doubted) else 0.0
