"""The parser of the command line: argparse's, extended by suggestions for mistyped words."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import Any, NoReturn

from raccoon.core.near_names import did_you_mean


class Parser(argparse.ArgumentParser):
    """argparse's parser, whose errors suggest the nearest name of a mistyped command, choice or option.
    Parsers of its sub-commands are of this class as well."""

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is None or value in action.choices:
            return
        allowed = [str(each) for each in action.choices]
        raise argparse.ArgumentError(
            action, f"there is no {value!r}{did_you_mean(value, allowed)}; allowed are {', '.join(allowed)}"
        )

    def refuse(self, words: Sequence[str]) -> NoReturn:
        """End the program with status 2 and an error that names words which no argument takes."""
        said = []
        for word in words:
            options = self._option_string_actions if word.startswith("-") else ()
            said.append(f"{word}{did_you_mean(word.partition('=')[0], options)}")
        self.error(f"unrecognized arguments: {' '.join(said)}")
