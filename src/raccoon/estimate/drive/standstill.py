"""Does the robot stand still? Then velocity and turn rate are known to be 0, and every reading is an offset.

Standing still needs all of it for a while: no duty on either wheel, wheels that read no more than their
offset explains, and a gyro that reads no more than its bias explains.
"""

from __future__ import annotations

HOLD_TIME = 0.3
"""s; longer than a robot coasts and the back-EMF filter forgets."""
WHEEL_MARGIN = 0.05
"""rad/s above what the uncertain offset explains (4 sigma)."""
GYRO_MARGIN = 0.015
"""rad/s above what the uncertain bias explains (4 sigma)."""


class Standstill:
    """Detector with memory: feed it every cycle.

    still: the verdict. seconds: how long it has held.
    """

    __slots__ = ("_quiet", "seconds", "still")

    def __init__(self) -> None:
        self._quiet = 0.0
        self.still = False
        self.seconds = 0.0

    def interrupt(self) -> None:
        """Nobody looked for a while: it has to stand anew."""
        self._quiet = self.seconds = 0.0
        self.still = False

    def update(
        self, dt: float, driven: bool, wheel: tuple[float, float], gyro: tuple[float, float] | None
    ) -> bool:
        """Take one cycle.

        driven: a drive motor has duty. wheel: (largest speed beyond the offset, sigma of that offset), rad/s.
        gyro: (rate beyond the bias, sigma of that bias), rad/s, None where there is no gyro.
        """
        quiet = not driven and abs(wheel[0]) <= WHEEL_MARGIN + 4.0 * wheel[1]
        if gyro is not None and abs(gyro[0]) > GYRO_MARGIN + 4.0 * gyro[1]:
            quiet = False
        self._quiet = self._quiet + dt if quiet else 0.0
        self.still = self._quiet >= HOLD_TIME
        self.seconds = self.seconds + dt if self.still else 0.0
        return self.still
