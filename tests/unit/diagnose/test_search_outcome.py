"""What of a search's result is reported as unknown."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from raccoon.core.config import RobotConfig
from raccoon.diagnose import search_outcome
from raccoon.diagnose.result import Shape
from raccoon.diagnose.unknown.bursts import Bursts

ROBOT = RobotConfig()


@pytest.mark.parametrize(
    ("depends_on", "share", "matters"),
    [("speed", 0.028, False), ("speed", 0.06, True), ("position x", 0.028, True)],
)
def test_friction_that_hardly_varies_over_the_speed_is_only_noted(
    monkeypatch: pytest.MonkeyPatch, depends_on: str, share: float, matters: bool
) -> None:
    """A reading's offset was hidden and named, of a robot whose friction gives in another way before it
    slides: it varied by 2.8 %, and the verdict was `partly`."""
    values = np.linspace(0.0, share * ROBOT.model.friction.coulomb.value, 48)
    curve = Shape(depends_on, "friction of each wheel", "N m", values, "", values, np.full(48, 0.0005))
    monkeypatch.setattr(search_outcome, "fit_shapes", lambda _: (curve,))
    monkeypatch.setattr(search_outcome, "find_one_sided_error", lambda *_: None)
    features = SimpleNamespace(roles=(), measured=None, event=1)
    search = SimpleNamespace(
        problem=SimpleNamespace(robot=ROBOT, features=features),
        unknown={f"unknown: {depends_on}": 20.0},
        linear=SimpleNamespace(residual=None),
    )
    over, notes, shapes = search_outcome._unknown_effects(
        cast(Any, search), cast(Any, SimpleNamespace(channels=())), Bursts()
    )
    assert (over, shapes) == (((depends_on,), (curve,)) if matters else ((), ()))
    assert ["2.8 % of robot.toml's dry friction: too little to matter" in each for each in notes] == (
        [] if matters else [True]
    )
