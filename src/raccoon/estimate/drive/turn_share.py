"""How much of the turn that the wheels read the gyro sees: about 1, unless a number is far off.

A gyro whose full scale is not the one that the firmware promises reads twice or half of every turn, whatever
the robot does. Slip, walls and pushes do not: the share is fitted to steps of turning, and counts only where
it explains them all.
"""

from __future__ import annotations

LEAST_RATE = 0.3
"""rad/s of the wheels below which offsets and noise would count."""
MEMORY = 10.0
"""s of turning that count."""
LEAST_TURN = 3.0
"""rad by the wheels before anything is said."""
LEAST_SHARE, MOST_SHARE = 0.75, 1.35
"""What wheels that scrub, and a track width that nobody measured, may do."""
FITS = 0.03
"""Of the gyro's squares that the share may leave unexplained."""


class TurnShare:
    """Feed it every step in which there is a gyro. value: gyro over wheels; 1 as long as nothing is odd."""

    __slots__ = ("_gyro", "_mixed", "_turned", "_wheels", "value")

    def __init__(self) -> None:
        self._gyro = self._mixed = self._wheels = self._turned = 0.0
        self.value = 1.0

    def update(self, span: float, wheels: float, gyro: float) -> None:
        """A step of `span` s: rad/s of the robot's turn as both wheels and as the gyro read it."""
        if abs(wheels) < LEAST_RATE:
            return
        keep = max(0.0, 1.0 - span / MEMORY)
        self._gyro = keep * self._gyro + span * gyro * gyro
        self._mixed = keep * self._mixed + span * gyro * wheels
        self._wheels = keep * self._wheels + span * wheels * wheels
        self._turned = keep * self._turned + span * abs(wheels)
        if self._turned < LEAST_TURN:
            return
        share = self._mixed / self._wheels
        odd = share > 0.0 and not LEAST_SHARE < share < MOST_SHARE
        fits = self._gyro - share * self._mixed < FITS * self._gyro
        self.value = share if odd and fits else 1.0
