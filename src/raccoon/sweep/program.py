"""A team's program as text: it reaches workers that do not have its file, and starts afresh each time."""

from __future__ import annotations

import hashlib
import sys
import tokenize
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from traceback import extract_tb
from types import ModuleType
from typing import Any

import raccoon
from raccoon.core.errors import ConfigError
from raccoon.core.near_names import did_you_mean_file
from raccoon.robot.actions.actions import Action
from raccoon.robot.actions.limits import can_take
from raccoon.robot.robot import Robot

Mission = Callable[[Robot], Any]
MODULE = "__program__"
"""Name of the module in which a program runs. No file has it, so what the program imports never is that
module."""


@dataclass(frozen=True, slots=True)
class Program:
    """A program file. folder: from where it may import its own modules."""

    name: str
    text: str
    folder: str

    @classmethod
    def read(cls, path: str | Path) -> Program:
        """Read a program. Raises ConfigError if the file does not exist or is not text."""
        path = Path(path)
        if path.suffix != ".py":
            raise ConfigError(f"{path}: a program is a Python file, whose name ends in .py")
        try:
            with tokenize.open(path) as file:  # in the encoding that Python would read it in
                return cls(path.name, file.read(), str(path.resolve().parent))
        except FileNotFoundError:
            raise ConfigError(f"{path}: there is no such program{did_you_mean_file(path)}") from None
        except (OSError, UnicodeDecodeError, SyntaxError) as error:
            raise ConfigError(f"{path}: not a program that can be read: {error}") from None

    @property
    def digest(self) -> str:
        """A digest of the program's text."""
        return hashlib.sha256(self.text.encode()).hexdigest()

    @property
    def file(self) -> str:
        """Its name in tracebacks."""
        return str(Path(self.folder) / self.name)

    def line_of(self, error: BaseException) -> int | None:
        """The last line of the program that an error passed through; None if there is none."""
        lines = [each.lineno for each in extract_tb(error.__traceback__) if each.filename == self.file]
        return lines[-1] if lines else None

    def run_in(self, module: ModuleType) -> None:
        """Run the program's text in a module, as Python would run its file. Errors of the text are passed
        on."""
        module.__file__ = self.file
        exec(compile(self.text, self.file, "exec", dont_inherit=True), module.__dict__)

    def mission(self) -> Mission:
        """Run the program's text and return its `mission(robot)`, or a function that runs its action
        `mission`.

        The module in which it runs stays the one of its name until the next program, because dataclasses and
        pickle look up there what it defines. Errors of the text are passed on. Raises ConfigError if it
        defines no mission; the library's own `mission`, which `from raccoon import *` imports, does not
        count.
        """
        module = sys.modules[MODULE] = ModuleType(MODULE)
        if self.folder not in sys.path:
            sys.path.insert(0, self.folder)
        self.run_in(module)
        mission = getattr(module, "mission", None)
        if isinstance(mission, Action):
            return lambda robot: robot.run(mission)
        if not callable(mission) or mission is raccoon.mission:
            moved = ": move there what main() does with its robot" if hasattr(module, "main") else ""
            raise ConfigError(
                f"{self.name}: it must define mission(robot), or an action named mission{moved}"
            )
        if not can_take(mission, "robot"):
            raise ConfigError(f"{self.name}: its mission must take the robot: mission(robot)")
        found: Mission = mission
        return found
