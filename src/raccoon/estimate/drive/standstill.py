"""Does the robot stand still? Then velocity and turn rate are known to be 0, and every reading is an offset.

Standing still needs all of it for a while: no duty on either wheel, wheels that read no more than their
offset explains, and a gyro that reads no more than its bias explains.
"""

from __future__ import annotations

HOLD_TIME_S = 0.3
"""s; longer than a robot coasts and the back-EMF filter forgets."""
WHEEL_MARGIN = 0.05
"""rad/s above what the uncertain offset explains (4 sigma)."""
GYRO_MARGIN = 0.015
"""rad/s above what the uncertain bias explains (4 sigma)."""
CREEP_TIME_S, MAX_CREEP_CHANGE = 0.5, 0.03
"""s for which wheels that nothing drives keep a speed, and rad/s by which it changes at the most: none rolls
on like that."""
LARGEST_OFFSET, LARGEST_BIAS = 0.35, 0.1
"""rad/s that a wheel (115 counts) and the gyro read at the most on a robot that stands: the data sheets of
such gyros allow 5 degrees a second (0.087)."""
MAX_TURN_CHANGE = 0.01
"""rad/s by which the gyro changes meanwhile at the most: no hand turns a robot as evenly."""
OTHER_BIAS_MARGIN = 0.003
"""rad/s above what the uncertain bias explains (4 sigma), of its mean in that time: it is another bias."""


def does_offset_explain(speed: float, sigma: float) -> bool:
    """Whether an offset with this deviation explains a wheel's speed beyond it, rad/s."""
    return abs(speed) <= WHEEL_MARGIN + 4.0 * sigma


def does_bias_explain(rate: float, sigma: float) -> bool:
    """Whether a bias with this deviation explains a turn rate beyond it, rad/s."""
    return abs(rate) <= GYRO_MARGIN + 4.0 * sigma


class StandstillDetector:
    """Detector with memory: feed it every cycle."""

    __slots__ = ("_quiet_seconds",)

    def __init__(self) -> None:
        self._quiet_seconds = 0.0

    def restart(self) -> None:
        """Forget the time at rest, after a gap in the readings."""
        self._quiet_seconds = 0.0

    def update(
        self, dt: float, driven: bool, wheel: tuple[float, float], gyro: tuple[float, float] | None
    ) -> bool:
        """Take one cycle; whether it stands.

        driven: a drive motor has duty. wheel: (largest speed beyond the offset, sigma of that offset), rad/s.
        gyro: (rate beyond the bias, sigma of that bias), rad/s, None where there is no gyro.
        """
        quiet = not driven and does_offset_explain(*wheel)
        if gyro is not None and not does_bias_explain(*gyro):
            quiet = False
        self._quiet_seconds = self._quiet_seconds + dt if quiet else 0.0
        return self._quiet_seconds >= HOLD_TIME_S


class CreepDetector:
    """Detects that wheels and gyro of a robot that nothing drives seem to creep on at one speed: that is an
    offset or a bias, whatever robot.toml says, of another controller or learnt from a robot that was pushed.

    mean_rate: rad/s by the gyro in the creep that was found last.
    """

    __slots__ = ("_rate", "_seconds", "_speeds", "_turned", "mean_rate")

    def __init__(self) -> None:
        self._seconds = self._rate = self._turned = self.mean_rate = 0.0
        self._speeds = (0.0, 0.0)

    def update(self, dt: float, driven: bool, left: float, right: float, rate: float | None) -> bool:
        """Take a step of dt s: rad/s of the wheels and of the gyro as they are read, None where it is not.

        True where both have kept their speed for long; then it begins anew.
        """
        kept = max(abs(left - self._speeds[0]), abs(right - self._speeds[1])) < MAX_CREEP_CHANGE
        slow = max(left, right, -left, -right) < LARGEST_OFFSET
        if driven or rate is None:
            self._seconds = self._turned = 0.0
            return False
        even = abs(rate - self._rate) < MAX_TURN_CHANGE and abs(rate) < LARGEST_BIAS
        if not (kept and slow and even):
            self._seconds, self._speeds, self._rate, self._turned = 0.0, (left, right), rate, 0.0
            return False
        self._seconds += dt
        self._turned += dt * rate
        found = self._seconds > CREEP_TIME_S
        if found:
            self.mean_rate = self._turned / self._seconds
            self._seconds = self._turned = 0.0
        return found
