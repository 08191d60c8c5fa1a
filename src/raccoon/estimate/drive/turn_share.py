"""How much of the turn that the wheels read the gyro sees: about 1, unless a number is far off.

A gyro whose full scale is not the one that the firmware promises reads twice or half of every turn, whatever
the robot does. Slip, walls and pushes do not: the share is fitted to steps of turning, and counts only where
it explains them all.
"""

from __future__ import annotations

MIN_RATE = 0.3
"""rad/s of the wheels below which offsets and noise would count."""
MEMORY_S = 10.0
"""s of turning that count."""
MIN_TURN = 3.0
"""rad by the wheels before anything is said."""
MIN_SHARE, MAX_SHARE = 0.75, 1.35
"""What wheels that scrub, and a track width that nobody measured, may do."""
MAX_MISFIT = 0.03
"""Of the gyro's squares that the share may leave unexplained."""


class TurnShare:
    """Feed it every step in which there is a gyro. value: gyro over wheels; 1 as long as nothing is odd."""

    __slots__ = ("_gyro_square", "_gyro_times_wheels", "_turned_angle", "_wheels_square", "value")

    def __init__(self) -> None:
        self._gyro_square = self._gyro_times_wheels = self._wheels_square = self._turned_angle = 0.0
        self.value = 1.0

    def update(self, span: float, wheels: float, gyro: float) -> None:
        """A step of `span` s: rad/s of the robot's turn as both wheels and as the gyro read it."""
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
