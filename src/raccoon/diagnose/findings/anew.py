"""Whether friction may have changed within a drive: then a curve of it over time is asked for as well."""

from __future__ import annotations

from collections.abc import Callable

from raccoon.diagnose.result import Diagnosis
from raccoon.diagnose.select.gates import CROWDED

HOT = "motor.heating"
WANDERS = 1.9
"""Times the noise that is left of a wheel's unseen readings where friction changed by an eighth or more."""


def may_rub_anew(found: Diagnosis, clearly_hot: Callable[[], bool]) -> bool:
    """Whether a change of friction may be behind what was found: motors that get hot, whose resistance rises
    as the friction of a robot that took a load, or wheels that are far off what nothing explains.

    clearly_hot: asked only where motors get hot and all else is explained, whether it is surely them.

    Asked for always, the curve's fifteen steps are fifteen more ways to be wrong in, for which the noise has
    room: of a deadband's 22.7 beside four causes on 12 s 19.8 were left. Beside a crowd of causes their forms
    are as far off, and the whole search that asks takes as long again.
    """
    if len(found.causes) >= CROWDED:
        return False
    wheels = [each for each in found.channels if each.name.startswith("motor.")]
    if any(each.rmse_after > WANDERS * each.noise_floor for each in wheels):
        return True
    return any(each.id == HOT for each in found.causes) and not clearly_hot()
