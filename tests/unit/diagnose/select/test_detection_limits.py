"""From which size on a cause would show, beside what robot.toml leaves open."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from raccoon.core.config import RobotConfig
from raccoon.diagnose.fit.evidence import Gram
from raccoon.diagnose.fit.linear_model import GramTable
from raccoon.diagnose.hypotheses.coordinates import (
    Cause,
    Coordinate,
    additive_coordinate,
    multiplicative_coordinate,
    neutral_settings,
)
from raccoon.diagnose.select.detection_limits import equivalent_base_units, evidence_per_width

K_E, COULOMB, INERTIA = "motor.back_emf_constant", "friction.coulomb", "drive.inertia"
BASE = (
    *(multiplicative_coordinate(K_E, side, 0.01) for side in ("left", "right")),
    additive_coordinate(COULOMB, None, "torque", 0.01),
    *(additive_coordinate(COULOMB, side, "torque", 0.005) for side in ("left", "right")),
    Coordinate("straight", (("inertia", None, "straight"),), lambda u: float(np.exp(0.05 * u)), True),
    Coordinate("turn", (("inertia", None, "turn"),), lambda u: float(np.exp(0.025 * u)), True),
)
NEUTRAL = neutral_settings(RobotConfig())


def cause(id_: str, where: str | None, made: Coordinate) -> Cause:
    return Cause(id_, where, (made,), (((1.0,),),))


@pytest.mark.parametrize(
    ("each", "cost"),
    [
        (cause(K_E, "left", multiplicative_coordinate(K_E, "left", 0.08)), 8.0**2),
        (cause(K_E, None, multiplicative_coordinate(K_E, None, 0.08)), 2.0 * 8.0**2),
        # Both have a variance of 0.01² + 0.005²/2; one, with the other known, 0.45 of 0.01².
        (cause(COULOMB, None, additive_coordinate(COULOMB, None, "torque", 0.08)), 0.08**2 / 1.125e-4),
        (cause(COULOMB, "left", additive_coordinate(COULOMB, "left", "torque", 0.08)), 0.08**2 / 0.45e-4),
        (cause(INERTIA, None, multiplicative_coordinate(INERTIA, None, 0.2)), 4.0**2 + 8.0**2),
        (cause("motor.heating", None, additive_coordinate("motor.heating", None, "gain", 0.1)), np.inf),
        (
            cause(
                "motor.current_limit",
                None,
                multiplicative_coordinate("motor.current_limit", None, 0.1, parameter="limit"),
            ),
            np.inf,
        ),
    ],
    ids=lambda it: it.name if isinstance(it, Cause) else "",
)
def test_what_robot_toml_leaves_open_can_be_in_place_of_a_cause(each: Cause, cost: float) -> None:
    units = equivalent_base_units(each, BASE, NEUTRAL)
    assert (np.inf if units is None else float(units @ units)) == pytest.approx(cost)
    assert equivalent_base_units(replace(each, coordinates=each.coordinates * 2), BASE, NEUTRAL) is None


def test_no_recording_shows_more_of_a_cause_than_that_costs() -> None:
    """A K_E was said to show from 0.7 % on in one without noise, where one that was 1 % off was refitted.

    One that is open up to 3.5 % has 24.5 of 2.33 + (2.33² + 2 · 8 + log 1e5)^½ squared there, 65.1, and the
    rest 2 % of a width later.
    """
    bent = cause(K_E, None, multiplicative_coordinate(K_E, None, 0.08))
    bounded = [replace(each, low=-3.5, high=3.5) for each in BASE]
    gram = Gram(np.diag([1.0] * len(BASE) + [1e5]), np.zeros(len(BASE) + 1))
    table = GramTable(gram, len(BASE), {}, ((cast(Any, SimpleNamespace(name=K_E)), [len(BASE)]),))
    for base, seen in ((BASE, 128.0), (bounded, 65.1 / (3.5 / 8.0 + (40.6 / 1e5) ** 0.5) ** 2), ((), 1e5)):
        problem = SimpleNamespace(causes={K_E: bent}, base=base, neutral=NEUTRAL)
        search: Any = SimpleNamespace(problem=problem, table=table)
        assert evidence_per_width(search) == {K_E: pytest.approx(seen, rel=0.005)}
