"""The parser of the command line: argparse's, extended by suggestions for mistyped words."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any, NoReturn

from raccoon.core.near_names import did_you_mean

_NUMBERS = {int: "whole number", float: "number"}


class Parser(argparse.ArgumentParser):
    """argparse's parser, whose errors are one sentence and suggest the nearest name of a mistyped command,
    choice or option. Parsers of its sub-commands are of this class as well."""

    def error(self, message: str) -> NoReturn:
        """End the program with status 2 and this sentence. The usage, up to ten lines, would hide it."""
        self.exit(2, f"{self.prog}: {message}; see {self.prog} --help\n")

    def _get_value(self, action: argparse.Action, arg_string: str) -> Any:
        try:
            return super()._get_value(action, arg_string)
        except argparse.ArgumentError:
            if action.type not in _NUMBERS:
                raise
            raise argparse.ArgumentError(action, f"{arg_string!r} is not a {_NUMBERS[action.type]}") from None

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is None or value in action.choices:
            return
        allowed = [str(each) for each in action.choices]
        raise argparse.ArgumentError(
            action, f"there is no {value!r}{did_you_mean(value, allowed)}; allowed are {', '.join(allowed)}"
        )

    def refuse(self, words: Sequence[str]) -> NoReturn:
        """End the program with status 2 and an error that names words which no argument takes: the unknown
        options among them, or else all."""
        options = [word.partition("=")[0] for word in words if word.startswith("-")]
        known = self._option_string_actions
        said = [f"there is no option {each}{did_you_mean(each, known)}" for each in options]
        self.error("; ".join(said) or f"too many arguments: {' '.join(words)}")
