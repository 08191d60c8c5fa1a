"""From one state of the search to the next."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from raccoon.diagnose.fit.fitted import Fit
from raccoon.diagnose.fit.problem import Point
from raccoon.diagnose.select import moves
from raccoon.diagnose.select.outlook import Search


def test_what_another_set_does_without_is_noted_in_one_order(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of several reasons for one effect a report says the first: it changed with Python's seed of hashes."""
    names = [f"group.cause{number}" for number in range(12)]
    before, after = (
        SimpleNamespace(point=Point(np.zeros(0), {name: np.ones(1) for name in each}))
        for each in (names, names[::4])
    )
    search = cast(Search, SimpleNamespace(fit=before, failed={}, rivals={}))
    monkeypatch.setattr(moves, "moved", lambda search, *_: search)
    assert [*moves.replaced_by(search, cast(Fit, after)).failed] == [
        name for name in names if name not in names[::4]
    ]
