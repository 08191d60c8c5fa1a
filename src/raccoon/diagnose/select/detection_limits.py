"""The smallest size of each effect that a recording would show: what it means that a cause was not named."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.hypotheses.cause_catalogue import MAX_CURRENT_LIMIT
from raccoon.diagnose.hypotheses.coordinates import WIDTH_FACTOR, Cause, Coordinate, Setting, Settings
from raccoon.diagnose.select.gates import gate
from raccoon.diagnose.select.state import Search
from raccoon.sim.effects.effect import Parameter

Array = NDArray[np.float64]

DETECTION_STDS = 2.33
"""One-sided 99 % quantile of a standard normal: chance lowers the evidence by more in one recording of
100."""
MIN_VISIBLE_EVIDENCE = 20.0
"""Evidence (2 log likelihood) that a deviation of one width must make to be called visible."""
MIN_CURRENT_LIMIT = 0.05
"""A. Below it no wheel moves, so a detection limit there would say nothing."""
MAX_RELATIVE_MISS = 1e-6
"""Largest error of a linear combination of base coordinates, relative to the largest change of each
setting."""
INERTIA: Setting = ("drive.inertia", None, "factor")
INERTIA_SETTINGS: tuple[Setting, ...] = (("inertia", None, "straight"), ("inertia", None, "turn"))
"""The two inertias that the effect multiplies; each is a base coordinate of its own."""


def evidence_per_width(search: Search) -> dict[str, float]:
    """Evidence that one width of each effect would add to the current fit: ||P d||^2 by id.

    d is the whitened response, P projects out all fitted directions. The least is taken over the sides and
    the starting guesses of an effect, so that a promised size does show. Of a cause with two coordinates the
    first counts, whose size is reported. Base coordinates that change the same settings as the cause can
    always take its place at the cost of their priors: columns of causes are secants, so at very little noise
    their curvature would otherwise count as evidence.
    """
    table = search.table
    count = table.base_count + sum(len(each) for each in table.active.values())
    rest = table.gram.take(
        [*range(count), *(i for _, span in table.inactive for i in span)]
    ).eliminate_leading(count)
    found: dict[str, float] = {}
    for group, span in table.inactive:
        if group.name in search.problem.causes:
            cause = search.problem.causes[group.name]
            power = float(rest.matrix[span[0] - count, span[0] - count])
            power = _evidence_beside_base(power, cause, search.problem.base, search.problem.neutral)
            found[group.name] = min(found.get(group.name, power), power)
    least: dict[str, float] = {}
    for name, power in found.items():
        id_ = search.problem.causes[name].id
        least[id_] = min(least.get(id_, power), power)
    return least


def _evidence_beside_base(power: float, cause: Cause, base: Sequence[Coordinate], neutral: Settings) -> float:
    """Evidence of one width, lowered where base coordinates can take the cause's place within their bounds,
    such that the cause is named from the same size on.

    power: evidence of one width from the data alone.
    """
    units = equivalent_base_units(cause, base, neutral)
    if units is None or (paid := float(units @ units)) >= power:
        return power
    ends = [each.high if unit > 0.0 else -each.low for each, unit in zip(base, units, strict=True)]
    far = min(end / abs(unit) for end, unit in zip(ends, units, strict=True) if abs(unit) > MAX_RELATIVE_MISS)
    needed = _detection_score(power, gate(cause.name))
    u = needed / math.sqrt(paid)
    if u > far:  # beyond the bounds only the data counts
        u = far + math.sqrt((needed**2 - paid * far**2) / power)
    return (needed / u) ** 2


def equivalent_base_units(cause: Cause, base: Sequence[Coordinate], neutral: Settings) -> Array | None:
    """Units of the base coordinates, (coordinates,), that together change all settings as one width of the
    cause does: the least-squares (likeliest) ones. None where no combination does."""
    wanted = _setting_changes(cause.coordinates[0], neutral)
    if cause.joint is not None or cause.size > 1 or not all(map(math.isfinite, wanted.values())):
        return None
    moved = [_setting_changes(each, neutral) for each in base]
    keys = list({key: None for each in (wanted, *moved) for key in each})
    matrix = np.array([[each.get(key, 0.0) for key in keys] for each in (wanted, *moved)])
    matrix = matrix / np.abs(matrix).max(axis=0)
    units = np.linalg.lstsq(matrix[1:].T, matrix[0], rcond=None)[0]
    missed = np.abs(units @ matrix[1:] - matrix[0]).max()
    return np.asarray(units, float) if missed < MAX_RELATIVE_MISS else None


def _setting_changes(coordinate: Coordinate, neutral: Settings) -> Settings:
    """Change of each setting for one unit of a coordinate, linearised at the neutral settings."""
    unit = coordinate.value(1.0)
    step = math.log(unit) if coordinate.factor else unit
    keys = INERTIA_SETTINGS if coordinate.settings == (INERTIA,) else coordinate.settings
    return {key: step * ((neutral[key] or coordinate.usual) if coordinate.factor else 1.0) for key in keys}


def describe_detection_limit(cause: Cause, power: float, gate: float) -> str:
    """The size from which a cause would be named, as the end of a reason; empty where no size would."""
    size = format_detection_limit(cause.effect.parameters[0], power, gate, own=cause.own is not None)
    return f"; would show {size}" if size else ""


def format_detection_limit(parameter: Parameter, power: float, gate: float, *, own: bool = False) -> str:
    """The smallest deviation that would be named in 99 of 100 recordings, in words.

    Empty where no deviation within the parameter's bounds would be (a dead band above full duty, say).
    A current limit above MAX_CURRENT_LIMIT acts in moments that were not simulated, so it is not promised.

    parameter: the effect's first. power: evidence of one width. gate: log evidence from which it is named.
    own: whether the effect is a team's own, all of whose parameters are additive whatever their names.
    With s = u sqrt(power), u widths give a log evidence that is normal with mean (s^2 - log(1 + power)) / 2
    and standard deviation s.
    """
    if power <= 0.0:
        return ""
    u = _detection_score(power, gate) / math.sqrt(power)
    width = WIDTH_FACTOR * parameter.prior_width
    if parameter.name == "limit" and not own:
        limit = min(1.0 / u, MAX_CURRENT_LIMIT)
        return f"below about {limit:.2g} {parameter.unit}" if limit >= MIN_CURRENT_LIMIT else ""
    factor = parameter.name == "factor" and not own
    high = parameter.bounds.high
    highest = math.log(high) if factor else high - (parameter.neutral or 0.0)
    if width * u > highest:
        return ""
    size = 100.0 * math.expm1(width * u) if factor else width * u
    unit = " %" if factor else f" {parameter.unit}" if parameter.unit else ""
    return f"from about {float(f'{size:.2g}'):g}{unit} on"


def _detection_score(power: float, gate: float) -> float:
    """s of `format_detection_limit` for a deviation that is named in 99 of 100 recordings: the root of
    (s^2 - log(1 + power)) / 2 - DETECTION_STDS s = gate."""
    return DETECTION_STDS + math.sqrt(DETECTION_STDS**2 + 2.0 * gate + math.log1p(power))
