from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from raccoon.diagnose.findings import validation
from raccoon.diagnose.fit.problem import Point
from raccoon.diagnose.select import unneeded_causes
from raccoon.diagnose.select.gates import gate
from raccoon.diagnose.select.state import Search

PLAY, SLIP, SCALE = "drive.backlash", "drive.wheel_slip", "imu.gyro_scale"
WORTH = {PLAY: 300.0, SLIP: 20.0, SCALE: 20.0}


def asked_again(names: list[str], monkeypatch: pytest.MonkeyPatch, spare: str = "") -> tuple[set[str], int]:
    """What is left of these causes, whose worth is as it was said, but of one that others can do without when
    they are fitted from where base numbers are half as far off; and how many fits it took."""
    fits = []

    def fitted(problem: object, whitener: object, start: Point) -> SimpleNamespace:
        fits.append(start)
        elsewhere = start.base[0] < 1.0 and spare not in start.active
        cost = sum(each for name, each in WORTH.items() if name in names and name not in start.active)
        return SimpleNamespace(point=start, cost=cost - (WORTH[spare] - 7.0 if elsewhere and spare else 0.0))

    def without(search: Any, name: str, why: str, fit: SimpleNamespace) -> SimpleNamespace:
        return SimpleNamespace(**{**vars(search), "fit": SimpleNamespace(point=fit.point)})

    for module, name, stand_in in (
        (unneeded_causes, "fit_point", fitted),
        (unneeded_causes, "refit_current", lambda search: SimpleNamespace(point=search.fit.point, cost=0.0)),
        (unneeded_causes, "nested_lead", lambda _, one, other: other.cost - one.cost),
        (validation, "prune_cause", without),
        (validation, "refit_with_final_noise", lambda search: search),
        (validation, "_causes_without_size", lambda _: []),
    ):
        monkeypatch.setattr(module, name, stand_in)
    point = Point(np.array([1.0]), {name: np.array([1.0]) for name in names})
    search: Any = SimpleNamespace(
        fit=SimpleNamespace(point=point),
        problem=None,
        whitener=None,
        leads=dict(WORTH),
        unknown={},
        rejections={},
    )
    found: Search = validation._drop_unneeded(search)
    return set(found.fit.point.active), len(fits)


def test_a_cause_that_play_s_rough_misfit_asked_for_is_dropped(monkeypatch: pytest.MonkeyPatch) -> None:
    left, _ = asked_again([PLAY, SLIP, SCALE], monkeypatch, spare=SLIP)
    assert left == {PLAY, SCALE}


def test_what_is_worth_its_gate_from_everywhere_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    left, fits = asked_again([PLAY, SLIP, SCALE], monkeypatch)
    assert left == {PLAY, SLIP, SCALE}
    assert fits == 2 + 2 * len(unneeded_causes.START_SCALES)  # play itself is far beyond doubt, and not asked


def test_without_play_nothing_is_asked_again(monkeypatch: pytest.MonkeyPatch) -> None:
    assert asked_again([SLIP, SCALE], monkeypatch, spare=SLIP) == ({SLIP, SCALE}, 0)


def test_where_all_is_clear_nothing_is_asked_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(WORTH, SLIP, gate(SLIP) + unneeded_causes.MAX_DOUBTED_EXCESS + 1.0)
    monkeypatch.setitem(WORTH, SCALE, gate(SCALE) + unneeded_causes.MAX_DOUBTED_EXCESS + 1.0)
    assert asked_again([PLAY, SLIP, SCALE], monkeypatch) == ({PLAY, SLIP, SCALE}, 0)
