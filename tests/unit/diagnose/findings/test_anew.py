"""When a diagnosis asks for friction that changed within the drive."""

from __future__ import annotations

import pytest

from diagnoses import cause, diagnosis
from raccoon.diagnose.findings.anew import HOT, may_rub_anew
from raccoon.diagnose.select.gates import CROWDED


@pytest.mark.parametrize(("others", "asked"), [(0, True), (CROWDED - 2, True), (CROWDED - 1, False)])
def test_beside_a_crowd_of_causes_no_change_of_friction_is_asked_for(others: int, asked: bool) -> None:
    """Beside twelve, on 36 s, the question took longer than all before it."""
    beside = [cause(f"own.{number}", said="") for number in range(others)]
    assert may_rub_anew(diagnosis(cause(HOT, said=""), *beside), lambda: False) is asked
