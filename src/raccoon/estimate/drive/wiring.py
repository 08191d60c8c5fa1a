"""Check of the wheels' signs against the gyro, which shows a motor that is plugged in reversed.

A reversed motor reads with the sign of its command, so the wheels alone look right. Let a and b be the turn
rates that the readings of the right and left wheel give. The gyro reads a + b if both are as in robot.toml, a
- b or b - a if one is reversed, and -a - b if both are, or the two are exchanged. Each of the four is
compared with the gyro over the last moments of motion. A hypothesis that was refuted while that of robot.toml
fitted is not tested again: plugs do not change while a program runs, and what comes later is slip. A
contradiction later in a motion that began as in robot.toml is slip, too, unless it lasts: a robot that runs
into something turns otherwise than its wheels for a moment. (Straight ahead, two reversed motors look right
as well, until the heading is corrected the wrong way.)
"""

from __future__ import annotations

MEMORY_S = 0.5
"""s, time constant of the memory, of time in motion."""
MIN_MOTION_S = 0.25
"""s of motion that a result needs."""
LASTING_S = 1.0
"""s for which the gyro must contradict robot.toml in a motion that began in agreement."""
REST_S = 0.1
"""s at rest that end a motion."""
MIN_RATE = 0.3
"""rad/s of the robot by both wheels (root of the sum of squares) below which offsets and noise would
decide."""
MAX_FITTING_MISFIT, MIN_FAILING_MISFIT = 0.15, 0.5
"""Misfits, as shares of the sum of squares of a and b: the upper bound for a hypothesis that fits, and the
lower bound for one that is refuted."""
Signs = tuple[float, float]
AS_CONFIGURED: Signs = (1.0, 1.0)
LEFT_REVERSED: Signs = (-1.0, 1.0)
RIGHT_REVERSED: Signs = (1.0, -1.0)
BOTH_REVERSED: Signs = (-1.0, -1.0)


class Wiring:
    """Compares the wheels' signs with robot.toml's. Call `update` in every step with a gyro reading."""

    __slots__ = (
        "_contradicted_seconds",
        "_is_confirmed",
        "_misfits",
        "_motion_seconds",
        "_rest_seconds",
        "_turn_square",
        "suspects",
    )

    def __init__(self) -> None:
        self._misfits = dict.fromkeys((AS_CONFIGURED, LEFT_REVERSED, RIGHT_REVERSED, BOTH_REVERSED), 0.0)
        self._turn_square = self._motion_seconds = self._contradicted_seconds = self._rest_seconds = 0.0
        self._is_confirmed = False  # in this motion
        self.suspects: tuple[Signs, ...] = ()
        """Signs (left, right) that agree with the gyro while robot.toml's do not. More than one if the motion
        does not distinguish them; then the robot may also be stuck."""

    @property
    def turned(self) -> tuple[str, ...]:
        """Sides that certainly turn opposite to robot.toml."""
        if not self.suspects:
            return ()
        return tuple(
            side
            for index, side in enumerate(("left", "right"))
            if all(signs[index] < 0.0 for signs in self.suspects)
        )

    def update(self, span: float, left: float, right: float, turn_rate: float) -> None:
        """Take a step of `span` s with the robot's turn rates by the left wheel, the right wheel and the
        gyro, rad/s."""
        misfits = self._misfits
        if len(misfits) == 1:
            return
        if left * left + right * right < MIN_RATE * MIN_RATE:
            self._rest_seconds += span
            if self._rest_seconds >= REST_S and self._motion_seconds > 0.0:
                self._start_motion()
            return
        self._rest_seconds = 0.0
        keep = max(0.0, 1.0 - span / MEMORY_S)
        self._motion_seconds += span
        self._turn_square = keep * self._turn_square + span * (left * left + right * right)
        for signs in misfits:
            off = turn_rate - signs[0] * left - signs[1] * right
            misfits[signs] = keep * misfits[signs] + span * off * off
        if self._motion_seconds >= MIN_MOTION_S:
            self._judge(span)

    def _start_motion(self) -> None:
        """Start the next motion, which is judged by itself: a robot that was stuck may be free."""
        self._misfits = dict.fromkeys(self._misfits, 0.0)
        self._turn_square = self._motion_seconds = self._contradicted_seconds = 0.0
        self._is_confirmed = False
        if not self.turned:
            self.suspects = ()

    def _judge(self, span: float) -> None:
        fits, fails = MAX_FITTING_MISFIT * self._turn_square, MIN_FAILING_MISFIT * self._turn_square
        as_written = self._misfits[AS_CONFIGURED]
        if as_written > fails:
            found = tuple(signs for signs, misfit in self._misfits.items() if misfit < fits)
            self._contradicted_seconds = self._contradicted_seconds + span if found else 0.0
            if not self._is_confirmed or self._contradicted_seconds > LASTING_S:
                self.suspects = found or self.suspects
        elif as_written < fits:  # others may fit, too: straight ahead, both reversed
            self._is_confirmed, self._contradicted_seconds = True, 0.0
            kept = {
                signs for signs, misfit in self._misfits.items() if misfit < fails or signs == AS_CONFIGURED
            }
            self._misfits = {signs: misfit for signs, misfit in self._misfits.items() if signs in kept}
            self.suspects = tuple(signs for signs in self.suspects if signs in kept)
