"""The problems that a reader found in a file, without repetitions."""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Sequence

_LINE = re.compile(r"\bline \d+")
_VALUE = re.compile(r"'[^']*'")


def without_repeats(problems: Sequence[str]) -> list[str]:
    """The first of all problems that differ only in line and value, with the number of the others."""
    alike: dict[str, list[str]] = defaultdict(list)
    for each in problems:
        alike[_VALUE.sub("''", _LINE.sub("line", each))].append(each)
    return [
        each[0]
        if len(each) == 1
        else f"{each[0]}; so {'is' if len(each) == 2 else 'are'} {len(each) - 1} more"
        for each in alike.values()
    ]
