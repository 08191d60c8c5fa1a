"""Turn by the gyro as a share of the turn by the wheels: about 1 unless a scale is far off.

A gyro whose full scale is not what the firmware states reads twice or half of every turn, always. Slip, walls
and pushes do not: the share is fitted to steps of turning, and is used only if it explains all of them.
"""

from __future__ import annotations

MIN_RATE = 0.3
"""rad/s of turn by the wheels below which offsets and noise matter too much."""
MEMORY_S = 10.0
"""s, time constant of the memory, of turning time."""
MIN_TURN = 3.0
"""rad of turn by the wheels that a result needs."""
MIN_SHARE, MAX_SHARE = 0.75, 1.35
"""Bounds of a plausible share: wheels that scrub, and a track width that nobody measured, stay within."""
MAX_MISFIT = 0.03
"""Largest part of the gyro's sum of squares that the share may leave unexplained."""


class TurnShare:
    """Call `update` in every step with a gyro reading. value: gyro over wheels if that is implausible;
    otherwise 1."""

    __slots__ = ("_gyro_square", "_gyro_times_wheels", "_turned_angle", "_wheels_square", "value")

    def __init__(self) -> None:
        self._gyro_square = self._gyro_times_wheels = self._wheels_square = self._turned_angle = 0.0
        self.value = 1.0

    def update(self, span: float, wheels: float, gyro: float) -> None:
        """Take a step of `span` s with the robot's turn rates by the wheels and by the gyro, rad/s."""
        if abs(wheels) < MIN_RATE:
            return
        keep = max(0.0, 1.0 - span / MEMORY_S)
        self._gyro_square = keep * self._gyro_square + span * gyro * gyro
        self._gyro_times_wheels = keep * self._gyro_times_wheels + span * gyro * wheels
        self._wheels_square = keep * self._wheels_square + span * wheels * wheels
        self._turned_angle = keep * self._turned_angle + span * abs(wheels)
        if self._turned_angle < MIN_TURN:
            return
        share = self._gyro_times_wheels / self._wheels_square
        odd = share > 0.0 and not MIN_SHARE < share < MAX_SHARE
        fits = self._gyro_square - share * self._gyro_times_wheels < MAX_MISFIT * self._gyro_square
        self.value = share if odd and fits else 1.0
