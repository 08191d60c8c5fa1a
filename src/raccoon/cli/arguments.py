"""The parser of the command line: argparse's, extended by suggestions for mistyped words."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from itertools import takewhile
from typing import Any, NoReturn

from raccoon.core.near_names import did_you_mean

_OPTION = re.compile(r"-[^\d.\s]\S*$")
"""What argparse takes for an option: no lone dash, no negative number, nothing with a space."""
_NUMBERS = {int: "whole number", float: "number"}


class Parser(argparse.ArgumentParser):
    """argparse's parser, whose errors are one sentence and suggest the nearest name of a mistyped command,
    choice or option. Parsers of its sub-commands are of this class as well."""

    _words: Sequence[str] = ()

    def _parse_known_args(
        self, arg_strings: list[str], namespace: argparse.Namespace, *more: Any
    ) -> tuple[argparse.Namespace, list[str]]:
        """argparse's, which stops at its first error: with the words kept, `error` also names mistyped
        options."""
        self._words = tuple(arg_strings)
        return super()._parse_known_args(arg_strings, namespace, *more)

    def error(self, message: str) -> NoReturn:
        """End the program with status 2 and this sentence. The usage, up to ten lines, would hide it."""
        self._end([*self._unknown_options(), message])

    def _end(self, said: Sequence[str]) -> NoReturn:
        self.exit(2, f"{self.prog}: {'; '.join(said)}; see {self.prog} --help\n")

    def _unknown_options(self) -> list[str]:
        """A sentence for each option among the words that does not exist. None if a command among them has
        options of its own."""
        options = () if self._subparsers else takewhile(lambda word: word != "--", self._words)
        return [self._refusal(word) for word in options if self._is_unknown(word)]

    def _is_unknown(self, word: str) -> bool:
        """Whether argparse finds no option for a word: in full, abbreviated, or one letter and its value."""
        name = word.partition("=")[0]
        if not _OPTION.match(word) or word[:2] in self._option_string_actions:
            return False
        return not any(known.startswith(name) for known in self._option_string_actions)

    def _refusal(self, word: str) -> str:
        name = word.partition("=")[0]
        return f"there is no option {name}{did_you_mean(name, self._option_string_actions)}"

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
        said = [self._refusal(word) for word in words if word.startswith("-")]
        self._end(said or [f"too many arguments: {' '.join(words)}"])
