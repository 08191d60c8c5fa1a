"""The error tree. Each error is also the builtin that people would guess.

::

    RaccoonError
    ├── ConfigError        ValueError       a value in a file or an argument is not allowed
    ├── TraceError         ValueError       a recording cannot be read (further)
    │   └── HoldoutError                    ... the one that a diagnosis is to be judged on
    ├── HardwareError      OSError          a device does not answer as it must
    ├── CalibrationError   RuntimeError     the data cannot support the calibration
    ├── MotionTimeout      TimeoutError     a motion did not end in its time
    ├── Stopped            RuntimeError     robot.stop() ended what ran
    └── ReplayDiverged     AssertionError   a replayed program commanded something else

A message says what, where, the value, and what is allowed.
"""

from typing import Self


class RaccoonError(Exception):
    """What this library raises under names of its own. An argument that is not allowed is a plain ValueError,
    one of the wrong kind a TypeError, and use at the wrong time a RuntimeError."""


class ConfigError(RaccoonError, ValueError):
    """A value in a configuration file, or an argument, is not allowed."""


class TraceError(RaccoonError, ValueError):
    """A recording is damaged, not a recording, or of a version this library cannot read."""


class HoldoutError(TraceError):
    """What is wrong is wrong with the recording that a diagnosis is to be judged on."""


class HardwareError(RaccoonError, OSError):
    """A device is missing, belongs to another program or does not behave."""


class CalibrationError(RaccoonError, RuntimeError):
    """The data cannot support the calibration that was asked for."""


class MotionTimeout(RaccoonError, TimeoutError):
    """A motion did not reach its goal in its time; the message says why."""


class Stopped(RaccoonError, RuntimeError):
    """`robot.stop()` ended what the robot did; the motors are off."""


class ReplayDiverged(RaccoonError, AssertionError):
    """A replayed program commanded something else than the recorded one.

    tick: number of the cycle (0 first). field: name of the command that differs.
    """

    def __init__(self, tick: int, field: str, recorded: object, replayed: object) -> None:
        self.tick = tick
        self.field = field
        self.recorded = recorded
        self.replayed = replayed
        super().__init__(f"tick {tick}: {field} was {recorded!r} in the recording and is {replayed!r} now")

    def __reduce__(self) -> tuple[type[Self], tuple[object, ...]]:  # its words alone do not make it again
        return type(self), (self.tick, self.field, self.recorded, self.replayed)
