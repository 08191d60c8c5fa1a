"""Effects of your own: a suspected effect that is not in the catalogue, as a few lines of Python.

examples/own_causes.py has two. Use them with `raccoon diagnose run.csv --causes own_causes.py`, or with
`diagnose(columns, robot, causes=[*drive_causes(), *map(own_cause, CAUSES)])`. Such an effect competes with
all others and must pass the same gates.
"""

from __future__ import annotations

import re
import runpy
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import ConfigError
from raccoon.core.near_names import did_you_mean_file
from raccoon.diagnose.drives.log import ROLES
from raccoon.robot.opening import no_robot_opened
from raccoon.sim.effects.effect import Effect

Array = NDArray[np.float64]
Values = Mapping[str, float]
"""The effect's parameters by name."""

LIST_NAME = "CAUSES"


@dataclass(frozen=True, slots=True)
class Simulated:
    """A simulated drive. time (n,) s. duty (n, 2) as commanded, left before right, -1 to 1. readings: sensor
    readings without the effect, (n,) each: bemf_left and bemf_right in counts (or speed_left and speed_right
    in rad/s), gyro in rad/s, battery in V; those that were recorded."""

    time: Array
    duty: Array
    readings: Mapping[str, Array]


@dataclass(frozen=True, slots=True)
class OwnEffect(Effect):
    """An effect in Python instead of a term of the plant's equations.

    sentence: text of a report, with the parameters' names in braces; after ": " comes what to do. parameters:
    each with its neutral value, at which the hooks are not called. commands(time, duty, values): returns the
    duty (n, 2) that reaches the motors. readings(drive, values): returns the readings that differ from the
    simulated ones. needs: readings that the hook requires; if one was not recorded, the effect is reported as
    not identifiable. Raises ConfigError for an invalid effect.
    """

    commands: Callable[[Array, Array, Values], Array] | None = None
    readings: Callable[[Simulated, Values], Mapping[str, Array]] | None = None
    needs: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        from raccoon.sim.effects.catalogue import CATALOGUE

        if not re.fullmatch(r"[a-z0-9_]+\.[a-z0-9_]+", self.id):
            raise ConfigError(f"own effect {self.id!r}: write its id as group.name, such as team.motor_hum")
        if self.id in CATALOGUE:
            raise ConfigError(f"own effect {self.id!r}: the catalogue already has this id")
        if self.commands is None and self.readings is None:
            raise ConfigError(f"{self.id}: it has neither commands nor readings, so it changes nothing")
        unknown = [each for each in self.needs if each not in ROLES]
        if unknown:
            raise ConfigError(f"{self.id}: needs {unknown[0]!r}: allowed are {', '.join(ROLES)}")
        if not self.parameters:
            raise ConfigError(f"{self.id}: it has no parameter, so there is nothing to find")
        for each in self.parameters:
            if each.neutral is None or not each.bounds.allows(each.neutral) or not each.prior_width > 0.0:
                wanted = "a neutral value inside its bounds and a prior_width above 0"
                raise ConfigError(f"{self.id}: {each.name}: give it {wanted}")
            if not each.bounds.low < each.bounds.high:
                raise ConfigError(f"{self.id}: {each.name}: its bounds allow {each.bounds.low:g} alone")
        self.told(self.neutral())

    def told(self, values: Values) -> str:
        """The sentence with its numbers. Raises ConfigError if it contains other names."""
        try:
            return self.sentence.format(**values)
        except (KeyError, IndexError, ValueError) as error:
            names = ", ".join(each.name for each in self.parameters)
            raise ConfigError(
                f"{self.id}: sentence {self.sentence!r}: {error}; it may name {names}"
            ) from None

    def neutral(self) -> dict[str, float]:
        """Values of all parameters at which the effect changes nothing."""
        return {each.name: float(each.neutral or 0.0) for each in self.parameters}

    def change_commands(self, time: Array, duty: Array, values: Values) -> Array:
        """The duty (n, 2) that reaches the motors. Raises ConfigError for anything but finite (n, 2)."""
        if self.commands is None:
            return duty
        found = self._call_hook("commands", self.commands, time.copy(), duty.copy(), values)
        return np.clip(self._checked_array("commands", found, duty.shape), -1.0, 1.0)

    def change_readings(self, drive: Simulated, values: Values) -> dict[str, Array]:
        """All readings, changed or not. Raises ConfigError for one that is not recorded or not (n,)."""
        if self.readings is None or not set(self.needs) <= set(drive.readings):
            return dict(drive.readings)
        # A hook that works in place would change the drive of every robot that is simulated later.
        copied = {role: each.copy() for role, each in drive.readings.items()}
        given = Simulated(drive.time.copy(), drive.duty.copy(), copied)
        changed = self._call_hook("readings", self.readings, given, values)
        if not isinstance(changed, Mapping):
            raise ConfigError(f"{self.id}: readings must give the changed readings by name, not {changed!r}")
        for role, each in changed.items():
            if role not in drive.readings:
                allowed = ", ".join(drive.readings)
                raise ConfigError(f"{self.id}: readings gave {role!r}; this recording has {allowed}")
            self._checked_array(f"readings: {role}", each, drive.time.shape)
        return {**drive.readings, **changed}

    def _call_hook(self, name: str, hook: Callable[..., Any], *given: Any) -> Any:
        try:
            return hook(*given)
        except Exception as error:
            drives = [each for each in given if isinstance(error, KeyError) and isinstance(each, Simulated)]
            has = "".join(f"; this recording has {', '.join(each.readings)}" for each in drives)
            raise ConfigError(f"{self.id}: {name}: {type(error).__name__}: {error}{has}") from error

    def _checked_array(self, what: str, found: Array, shape: tuple[int, ...]) -> Array:
        array = np.asarray(found, float)
        finite = np.isfinite(array)
        if array.shape != shape or not finite.all():
            given = array.shape if array.shape != shape else f"{int((~finite).sum())} that are not finite"
            raise ConfigError(f"{self.id}: {what} must give {shape} finite numbers, not {given}")
        return array


def load_own_effects(path: str | Path) -> tuple[OwnEffect, ...]:
    """The effects in a Python file's list `CAUSES`. Raises ConfigError naming the file and the mistake."""
    path = Path(path)
    if not path.is_file():
        raise ConfigError(f"{path}: there is no such file of causes{did_you_mean_file(path)}")
    if path.suffix != ".py":
        raise ConfigError(f"{path}: causes must be in a Python file, whose name ends in .py")
    try:
        with no_robot_opened():  # a robot program given by mistake must not drive
            found = runpy.run_path(str(path)).get(LIST_NAME)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None
    except (Exception, SystemExit) as error:
        raise ConfigError(f"{path}: {type(error).__name__}: {error}") from error
    if not isinstance(found, list | tuple) or not all(isinstance(each, OwnEffect) for each in found):
        raise ConfigError(f"{path}: it must have a list {LIST_NAME} of OwnEffect")
    ids = [each.id for each in found]
    twice = sorted({each for each in ids if ids.count(each) > 1})
    if twice:
        raise ConfigError(f"{path}: {twice[0]} is there twice")
    return tuple(found)
