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

MEMORY = 0.5
"""s of motion that count."""
LEAST = 0.25
"""s of motion before anything is said."""
LASTS = 1.0
"""s for which the gyro must say otherwise in a motion that began as robot.toml says."""
REST = 0.1
"""s at rest that end a motion."""
LEAST_RATE = 0.3
"""rad/s of the robot that the wheels together are worth, below which offsets and noise would decide."""
FITS, FAILS = 0.15, 0.5
"""Misfit, as a share of the squares of a and b, of what the gyro agrees with and of what it does not."""
Signs = tuple[float, float]
AS_WRITTEN: Signs = (1.0, 1.0)
LEFT_TURNED: Signs = (-1.0, 1.0)
RIGHT_TURNED: Signs = (1.0, -1.0)
BOTH_TURNED: Signs = (-1.0, -1.0)


class Wiring:
    """Judge of the wheels' signs against robot.toml's. Feed it every step in which there is a gyro."""

    __slots__ = ("_against", "_misfits", "_rest", "_seconds", "_sound", "_squares", "suspects")

    def __init__(self) -> None:
        self._misfits = dict.fromkeys((AS_WRITTEN, LEFT_TURNED, RIGHT_TURNED, BOTH_TURNED), 0.0)
        self._squares = self._seconds = self._against = self._rest = 0.0
        self._sound = False  # since this motion began
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
        if left * left + right * right < LEAST_RATE * LEAST_RATE:
            self._rest += span
            if self._rest >= REST and self._seconds > 0.0:
                self._begin()
            return
        self._rest = 0.0
        keep = max(0.0, 1.0 - span / MEMORY)
        self._seconds += span
        self._squares = keep * self._squares + span * (left * left + right * right)
        for signs in misfits:
            off = turn_rate - signs[0] * left - signs[1] * right
            misfits[signs] = keep * misfits[signs] + span * off * off
        if self._seconds >= LEAST:
            self._judge(span)

    def _begin(self) -> None:
        """The next motion is judged by itself: a robot that was stuck may be free."""
        self._misfits = dict.fromkeys(self._misfits, 0.0)
        self._squares = self._seconds = self._against = 0.0
        self._sound = False
        if not self.turned:
            self.suspects = ()

    def _judge(self, span: float) -> None:
        fits, fails = FITS * self._squares, FAILS * self._squares
        as_written = self._misfits[AS_WRITTEN]
        if as_written > fails:
            found = tuple(signs for signs, misfit in self._misfits.items() if misfit < fits)
            self._against = self._against + span if found else 0.0
            if not self._sound or self._against > LASTS:
                self.suspects = found or self.suspects
        elif as_written < fits:  # others may fit as well, as straight ahead where both are turned
            self._sound, self._against = True, 0.0
            kept = {signs for signs, misfit in self._misfits.items() if misfit < fails or signs == AS_WRITTEN}
            self._misfits = {signs: misfit for signs, misfit in self._misfits.items() if signs in kept}
            self.suspects = tuple(signs for signs in self.suspects if signs in kept)
