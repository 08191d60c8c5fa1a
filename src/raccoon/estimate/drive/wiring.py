"""Do the wheels turn the robot as they say? A motor that is plugged in the other way round shows in the gyro.

Its reading has the sign of its command, so the wheels alone look sound. With the turn rates a and b that the
right and the left wheel give the robot by what they read, the gyro sees a + b where both are as robot.toml
says, a - b or b - a where one is the other way round, and -a - b where both are or the two are exchanged.
Each of the four is compared with the gyro over the last moments of motion. What was seen to be wrong once
while robot.toml's own fitted is not asked again: plugs do not change while a program runs, and what comes
later is slip. So is, unless it lasts, what comes later in a motion that began as robot.toml says: a robot
that runs into something turns otherwise than its wheels for a moment. (Straight ahead two motors that are
both the other way round look sound as well, until the heading is corrected the wrong way.)
"""

from __future__ import annotations

MEMORY_S = 0.5
"""s of motion that count."""
MIN_MOTION_S = 0.25
"""s of motion before anything is said."""
LASTING_S = 1.0
"""s for which the gyro must say otherwise in a motion that began as robot.toml says."""
REST_S = 0.1
"""s at rest that end a motion."""
MIN_RATE = 0.3
"""rad/s of the robot that the wheels together are worth, below which offsets and noise would decide."""
MAX_FITTING_MISFIT, MIN_FAILING_MISFIT = 0.15, 0.5
"""Misfit, as a share of the squares of a and b, of what the gyro agrees with and of what it does not."""
Signs = tuple[float, float]
AS_CONFIGURED: Signs = (1.0, 1.0)
LEFT_REVERSED: Signs = (-1.0, 1.0)
RIGHT_REVERSED: Signs = (1.0, -1.0)
BOTH_REVERSED: Signs = (-1.0, -1.0)


class Wiring:
    """Judge of the wheels' signs against robot.toml's. Feed it every step in which there is a gyro."""

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
        self._is_confirmed = False  # since this motion began
        self.suspects: tuple[Signs, ...] = ()
        """Signs, left and right, that the gyro agrees with where it does not with robot.toml. More than one
        where the motion does not tell them apart: then the robot may be stuck as well."""

    @property
    def turned(self) -> tuple[str, ...]:
        """Sides that surely turn the other way than robot.toml says."""
        if not self.suspects:
            return ()
        return tuple(
            side
            for index, side in enumerate(("left", "right"))
            if all(signs[index] < 0.0 for signs in self.suspects)
        )

    def update(self, span: float, left: float, right: float, turn_rate: float) -> None:
        """A step of `span` s: rad/s that the left and the right wheel turn the robot by, and the gyro's."""
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
        """The next motion is judged by itself: a robot that was stuck may be free."""
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
        elif as_written < fits:  # others may fit as well, as straight ahead where both are turned
            self._is_confirmed, self._contradicted_seconds = True, 0.0
            kept = {
                signs for signs, misfit in self._misfits.items() if misfit < fails or signs == AS_CONFIGURED
            }
            self._misfits = {signs: misfit for signs, misfit in self._misfits.items() if signs in kept}
            self.suspects = tuple(signs for signs in self.suspects if signs in kept)
