"""Refitted values of a cause's parameter in recordings that do not name the cause."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from raccoon.diagnose.result import Diagnosis
from raccoon.sim.effects.parameters import SIDES

ValueWithStd = tuple[float, float]
"""A value and its standard deviation."""


def refitted_values(name: str, results: Mapping[str, Diagnosis]) -> dict[str, ValueWithStd]:
    """First parameter of a cause (id or id@where) by recording, for recordings whose model has it. Within
    robot.toml's standard deviation it is refitted without being named, and then differs from robot.toml's
    value."""
    named = (each for it in results.values() for each in it.causes if each.name == name)
    parameter = next(iter(next(named).parameters))
    found = {recording: _refitted_value(name, parameter, each) for recording, each in results.items()}
    return {recording: each for recording, each in found.items() if each is not None}


def _refitted_value(name: str, parameter: str, diagnosis: Diagnosis) -> ValueWithStd | None:
    """The refitted value in one recording, None if its model has none; for a cause of both sides their
    mean."""
    model = diagnosis.model
    if model is None:
        return None
    id_, _, where = name.partition("@")
    for places in ((where or None,), *([] if where else [SIDES])):
        keys = [(id_, place) for place in places]
        if all(key in model.origins and parameter in model.origins[key].std for key in keys):
            values = [model.effects[key][parameter] for key in keys]
            return float(np.mean(values)), float(np.mean([model.origins[key].std[parameter] for key in keys]))
    return None
