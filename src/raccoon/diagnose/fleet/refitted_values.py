"""The value of a cause's number in recordings that do not name the cause: as it was refitted there."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from raccoon.diagnose.result import Diagnosis
from raccoon.sim.effects.parameters import SIDES

ValueWithStd = tuple[float, float]
"""A value and its standard deviation."""


def refitted_values(name: str, results: Mapping[str, Diagnosis]) -> dict[str, ValueWithStd]:
    """The first number of a cause, id or id@where, by recording: of those whose model has it. Inside
    robot.toml's deviations it is fitted silently, and is not what robot.toml says."""
    named = (each for it in results.values() for each in it.causes if each.name == name)
    parameter = next(iter(next(named).parameters))
    found = {recording: _refitted_value(name, parameter, each) for recording, each in results.items()}
    return {recording: each for recording, each in found.items() if each is not None}


def _refitted_value(name: str, parameter: str, diagnosis: Diagnosis) -> ValueWithStd | None:
    """Of a cause of both sides the mean of them."""
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
