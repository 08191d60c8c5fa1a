"""Which of the names that there are was meant by one that there is not: of commands, options, keys, sensors,
causes and files alike."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

MIN_LIKENESS = 0.7
"""Share of letters in common, in their order, from which on names are alike; at 0.6, as is usual, --nonsense
is like --seed."""
MIN_PART = 3
"""Letters from which on a name is also found by a part of it, as drive.backlash by backlash."""


def did_you_mean(name: object, known: Iterable[str]) -> str:
    """What to put behind the mention of an unknown name, as ` (did you mean motion?)`; "" where none is like
    it."""
    near = nearest_name(name, known)
    return f" (did you mean {near}?)" if near else ""


def nearest_name(name: object, known: Iterable[str]) -> str:
    """The known name that is most like `name`, capital letters aside, or else the only one that it is a part
    of; "" where there is none."""
    from difflib import get_close_matches

    if not isinstance(name, str):
        return ""
    by_letters = {each.lower(): each for each in known}
    given = name.lower()
    near = get_close_matches(given, by_letters, 1, MIN_LIKENESS)
    if not near and len(given) >= MIN_PART:
        holding = [each for each in by_letters if given in each]
        near = holding if len(holding) == 1 else []
    return by_letters[near[0]] if near else ""


def did_you_mean_file(path: str | Path) -> str:
    """As `did_you_mean`, of a file that is not there, by the other names in its folder. What the endings have
    in common makes no two files alike."""
    path = Path(path)
    try:
        names = sorted(each.name for each in path.parent.iterdir())
    except OSError:
        names = []
    stem = nearest_name(_stem(path.name), map(_stem, names))
    alike = [each for each in names if stem and _stem(each) == stem]
    near = nearest_name(path.name, alike) or "".join(alike[:1])
    return f" (did you mean {path.with_name(near)}?)" if near and near != path.name else ""


def _stem(name: str) -> str:
    return name.partition(".")[0]
