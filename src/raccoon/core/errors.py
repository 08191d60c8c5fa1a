"""The error tree. Each error is also the builtin one that people expect.

::

    RaccoonError
    ├── ConfigError        ValueError       a value in a file or an argument is not allowed
    ├── TraceError         ValueError       a recording cannot be read (further)
    │   └── HoldoutError                    ... the held-out one of a diagnosis
    ├── HardwareError      OSError          a device does not answer as it must
    ├── CalibrationError   RuntimeError     the data cannot support the calibration
    ├── MotionTimeout      TimeoutError     a motion did not end in its time
    ├── Stopped            RuntimeError     robot.stop() ended what ran
    └── ReplayDiverged     AssertionError   a replayed program commanded something else

A message names what is wrong, where, the value, and what is allowed.
"""

from typing import Self


class RaccoonError(Exception):
    """Base of this library's own errors. An argument that is not allowed raises a plain ValueError, one of
    the wrong type a TypeError, and use at the wrong time a RuntimeError."""


class ConfigError(RaccoonError, ValueError):
    """A value in a configuration file, or an argument, is not allowed."""


class TraceError(RaccoonError, ValueError):
    """A recording is damaged, not a recording, or of a version this library cannot read."""


class HoldoutError(TraceError):
    """The error is in the held-out recording of a diagnosis."""


class HardwareError(RaccoonError, OSError):
    """A device is missing, belongs to another program or does not behave."""


class CalibrationError(RaccoonError, RuntimeError):
    """The data cannot support the requested calibration."""


class MotionTimeout(RaccoonError, TimeoutError):
    """A motion did not reach its goal in its time; the message says why."""


class Stopped(RaccoonError, RuntimeError):
    """`robot.stop()` ended the motion; the motors are off."""


class ReplayDiverged(RaccoonError, AssertionError):
    """A replayed program gave another command than the recorded one.

    tick: number of the cycle (0 first). field: name of the command that differs.
    """

    def __init__(self, tick: int, field: str, recorded: object, replayed: object) -> None:
        self.tick = tick
        self.field = field
        self.recorded = recorded
        self.replayed = replayed
        super().__init__(f"tick {tick}: {field} was {recorded!r} in the recording and is {replayed!r} now")

    def __reduce__(self) -> tuple[type[Self], tuple[object, ...]]:  # its message alone does not restore it
        return type(self), (self.tick, self.field, self.recorded, self.replayed)
