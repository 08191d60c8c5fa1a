"""Suggestions for unknown names: of commands, options, keys, sensors, causes and files."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

MIN_LIKENESS = 0.7
"""Least share of common letters, in their order, of similar names; at the usual 0.6, --nonsense resembles
--seed."""
MIN_PART = 3
"""Least number of letters with which a name is also found by a part of it, as drive.backlash by backlash."""


def did_you_mean(name: object, known: Iterable[str]) -> str:
    """The text to add to an unknown name, like ` (did you mean motion?)`; "" if no name is similar."""
    near = nearest_name(name, known)
    return f" (did you mean {near}?)" if near else ""


def nearest_name(name: object, known: Iterable[str]) -> str:
    """The known name most similar to `name`, ignoring case, or else one of the same letters, or else the only
    one that contains it; "" if there is none."""
    from difflib import get_close_matches

    if not isinstance(name, str):
        return ""
    by_letters = {each.lower(): each for each in known}
    given = name.lower()
    near = get_close_matches(given, by_letters, 1, MIN_LIKENESS)
    if not near:  # two exchanged letters of a short name, such as rnu of run
        near = [each for each in by_letters if sorted(each) == sorted(given)]
    if not near and len(given) >= MIN_PART:
        holding = [each for each in by_letters if given in each]
        near = holding if len(holding) == 1 else []
    return by_letters[near[0]] if near else ""


def did_you_mean_file(path: str | Path) -> str:
    """As `did_you_mean` for a missing file, with the other names in its folder. A common ending does not make
    two files similar."""
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
