"""Whether robot.toml is more wrong about the wheels and the track width than it says."""

from __future__ import annotations

from math import sqrt

from raccoon.estimate.ekf.filter import variance_index
from raccoon.estimate.ekf.generated import Flat
from raccoon.estimate.ekf.state import State

SURPRISING = 3.0
"""Deviations by robot.toml from which on what it says of its deviations is not believed either."""
MORE = 1.1
"""Times what is in doubt already, before more of it is."""


class ScaleDoubt:
    """Asks in every step how far both scales that show in every drive are off what robot.toml has.

    A straight shows that the wheels are unlike (BALANCE), a turn that they turn the robot otherwise
    (WHEEL_TURN). Neither says which number is wrong. Within the deviations of robot.toml the filter shares
    it among them; a calibration that is far beyond its own may have any one wrong, and all of it: the way is
    then off by as much as they are.
    """

    __slots__ = ("_balance", "_doubted", "_turn")

    def __init__(self, flat: Flat) -> None:
        """flat: the filter's belief before anything was read."""
        self._balance = SURPRISING * sqrt(flat[variance_index(State.BALANCE)])
        self._turn = SURPRISING * sqrt(flat[variance_index(State.WHEEL_TURN)])
        self._doubted = 0.0

    def more(self, flat: Flat) -> float:
        """Deviation to add to what is not known of WAY; hardly ever above 0."""
        balance, turn = abs(flat[State.BALANCE]), abs(flat[State.WHEEL_TURN] - 1.0)
        off = max(balance if balance > self._balance else 0.0, turn if turn > self._turn else 0.0)
        if off <= MORE * self._doubted:
            return 0.0
        before, self._doubted = self._doubted, off
        return sqrt(off * off - before * before)
