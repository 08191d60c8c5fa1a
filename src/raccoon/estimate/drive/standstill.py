"""Detection of standstill. Then velocity and turn rate are known to be 0, and every reading is an offset.

The robot stands if all of this holds for a while: no duty on either wheel, wheels that read no more than
their offsets explain, and a gyro that reads no more than its bias explains.
"""

from __future__ import annotations

HOLD_TIME_S = 0.3
"""s for which all conditions must hold; longer than the robot coasts and the back-EMF filter settles."""
WHEEL_MARGIN = 0.05
"""rad/s beyond what the uncertain offset explains (4 sigma)."""
GYRO_MARGIN = 0.015
"""rad/s beyond what the uncertain bias explains (4 sigma)."""
CREEP_TIME_S, MAX_CREEP_CHANGE = 0.5, 0.03
"""s for which wheels without power must keep a speed, and rad/s by which it may change, to count as creep: no
wheel rolls on like that."""
LARGEST_OFFSET, LARGEST_BIAS = 0.35, 0.1
"""rad/s, bounds on the readings of a wheel (115 counts) and of the gyro of a robot at rest: the data sheets
of such gyros allow 5 degrees a second (0.087 rad/s)."""
MAX_TURN_CHANGE = 0.01
"""rad/s, bound on the change of the gyro's reading meanwhile: no hand turns a robot as evenly."""
OTHER_BIAS_MARGIN = 0.003
"""rad/s beyond what the uncertain bias explains (4 sigma), of the gyro's mean in that time, above which the
bias has changed."""


def does_offset_explain(speed: float, sigma: float) -> bool:
    """Whether an offset with standard deviation `sigma` explains a wheel's speed beyond it (rad/s)."""
    return abs(speed) <= WHEEL_MARGIN + 4.0 * sigma


def does_bias_explain(rate: float, sigma: float) -> bool:
    """Whether a bias with standard deviation `sigma` explains a turn rate beyond it (rad/s)."""
    return abs(rate) <= GYRO_MARGIN + 4.0 * sigma


class StandstillDetector:
    """Detector of standstill, with memory: feed it every cycle."""

    __slots__ = ("_quiet_seconds",)

    def __init__(self) -> None:
        self._quiet_seconds = 0.0

    def restart(self) -> None:
        """Start the time at rest again, after a gap in the readings."""
        self._quiet_seconds = 0.0

    def update(
        self, dt: float, driven: bool, wheel: tuple[float, float], gyro: tuple[float, float] | None
    ) -> bool:
        """Take one cycle of dt s; True if the robot stands.

        driven: a drive motor has duty. wheel: (largest speed beyond the offset, sigma of that offset), rad/s.
        gyro: (rate beyond the bias, sigma of that bias), rad/s; None without a gyro.
        """
        quiet = not driven and does_offset_explain(*wheel)
        if gyro is not None and not does_bias_explain(*gyro):
            quiet = False
        self._quiet_seconds = self._quiet_seconds + dt if quiet else 0.0
        return self._quiet_seconds >= HOLD_TIME_S


class CreepDetector:
    """Detects wheels and a gyro that read a constant slow motion of a robot without power. That is an offset
    or a bias, whatever robot.toml holds: of another controller, or learnt while the robot was pushed.

    known_left, known_right: rad/s, offsets of robot.toml, already taken off the readings; perhaps wrongly.
    mean_rate: rad/s by the gyro during the last creep. may_rest: whether all are as slow as in a robot at
    rest. is_even: whether they also keep their speed.
    """

    __slots__ = (
        "_known_offsets",
        "_rate",
        "_seconds",
        "_speeds",
        "_turned",
        "is_even",
        "may_rest",
        "mean_rate",
    )

    def __init__(self, known_left: float = 0.0, known_right: float = 0.0) -> None:
        self._seconds = self._rate = self._turned = self.mean_rate = 0.0
        self.may_rest = self.is_even = False
        self._speeds, self._known_offsets = (0.0, 0.0), (known_left, known_right)

    def update(self, dt: float, driven: bool, left: float, right: float, rate: float | None) -> bool:
        """Take a step of dt s with the readings of wheels and gyro, rad/s (rate: None without a gyro).

        True if all have kept their speed for CREEP_TIME_S; then the time starts again.
        """
        kept = max(abs(left - self._speeds[0]), abs(right - self._speeds[1])) < MAX_CREEP_CHANGE
        known_left, known_right = self._known_offsets
        slow = _may_be_offset(left, known_left) and _may_be_offset(right, known_right)
        self.may_rest = not driven and rate is not None and slow and abs(rate) < LARGEST_BIAS
        self.is_even = False
        if driven or rate is None:
            self._seconds = self._turned = 0.0
            return False
        self.is_even = self.may_rest and kept and abs(rate - self._rate) < MAX_TURN_CHANGE
        if not self.is_even:
            self._seconds, self._speeds, self._rate, self._turned = 0.0, (left, right), rate, 0.0
            return False
        self._seconds += dt
        self._turned += dt * rate
        found = self._seconds > CREEP_TIME_S
        if found:
            self.mean_rate = self._turned / self._seconds
            self._seconds = self._turned = 0.0
        return found


def _may_be_offset(speed: float, known: float) -> bool:
    """Whether a resting wheel may read this speed beyond its known offset (rad/s), which may be wrong."""
    return abs(speed) < LARGEST_OFFSET or abs(speed + known) < LARGEST_OFFSET
