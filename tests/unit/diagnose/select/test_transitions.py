"""From one state of the search to the next."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from raccoon.diagnose.fit.fit_result import Fit
from raccoon.diagnose.fit.problem import Point
from raccoon.diagnose.select import transitions
from raccoon.diagnose.select.replacements import replace_by_better_sets
from raccoon.diagnose.select.state import Search


def test_what_another_set_does_without_is_noted_in_one_order(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of several reasons for one effect a report says the first: it changed with Python's seed of hashes."""
    names = [f"group.cause{number}" for number in range(12)]
    before, after = (
        SimpleNamespace(point=Point(np.zeros(0), {name: np.ones(1) for name in each}))
        for each in (names, names[::4])
    )
    search = cast(Search, SimpleNamespace(fit=before, rejections={}, rivals={}))
    monkeypatch.setattr(transitions, "move_search", lambda search, *_: search)
    assert [*transitions.replace_set(search, cast(Fit, after)).rejections] == [
        name for name in names if name not in names[::4]
    ]


@pytest.mark.parametrize(("names", "asked"), [(["a"], 1), (["b"], 2), (["b", "c"], 3)])
def test_sets_are_not_compared_again_for_the_same_set_that_fits_better(
    names: list[str], asked: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a robot with one friction that was done three times, for a quarter of the whole diagnosis."""
    left = [SimpleNamespace(point=SimpleNamespace(active={each: None})) for each in names]
    found = [*left, left[-1] if asked < 3 else None]
    count = iter(range(9))

    def better_set(_: Search) -> object:
        return found[min(next(count), len(found) - 1)]

    def replaced_by(_: Search, fit: object) -> Search:
        return cast(Search, SimpleNamespace(fit=fit))

    monkeypatch.setattr("raccoon.diagnose.select.replacements.find_better_set", better_set)
    monkeypatch.setattr("raccoon.diagnose.select.replacements.replace_set", replaced_by)
    monkeypatch.setattr("raccoon.diagnose.select.replacements.may_miss_causes", lambda _: True)
    start = SimpleNamespace(fit=SimpleNamespace(point=SimpleNamespace(active={"a": None})))
    search, changed = replace_by_better_sets(cast(Search, start))
    assert changed
    assert list(search.fit.point.active) == names[-1:]
    assert next(count) == asked
