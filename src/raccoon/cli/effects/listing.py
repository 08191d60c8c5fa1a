"""The catalogue of effects as text and as JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from itertools import groupby

from raccoon.core.errors import ConfigError
from raccoon.core.near_names import did_you_mean
from raccoon.sim.effects.effect import Effect, Parameter, Place, all_effects

PLACE_TEXTS = {Place.ROBOT: "", Place.SIDE: "@left @right", Place.TOPHAT: "@port"}


def select_effects(name: str | None) -> list[Effect]:
    """The effects of an id or a group; all effects without a name. Raises ConfigError for an unknown name."""
    entries = [each for each in all_effects() if name in (None, each.id, each.group)]
    if not entries:
        groups = list(dict.fromkeys(each.group for each in all_effects()))
        meant = did_you_mean(name, [*groups, *(each.id for each in all_effects())])
        raise ConfigError(
            f"effect {name!r}: there is no such id or group{meant}; groups are {', '.join(groups)}"
        )
    return entries


def table_text(entries: Sequence[Effect]) -> str:
    """Text of all entries, one effect after the other, by group."""
    lines: list[str] = []
    for group, members in groupby(entries, key=lambda each: each.group):
        lines += ["", group]
        for entry in members:
            lines.append(f"  {entry.id:30} {PLACE_TEXTS[entry.place]}".rstrip())
            lines.append(f"      {entry.sentence}")
            lines += [f"      {parameter_text(each)}" for each in entry.parameters]
    return "\n".join(lines[1:])


def parameter_text(parameter: Parameter) -> str:
    """A parameter's name, unit, neutral value, bounds and prior width, as text."""
    unit = f" {parameter.unit}" if parameter.unit else ""
    return (
        f"{parameter.name}{unit}: neutral {neutral_text(parameter)}, {parameter.bounds}, "
        f"usually off by {parameter.prior_width:g}"
    )


def neutral_text(parameter: Parameter) -> str:
    """A parameter's neutral value, or its substitute, as text."""
    if parameter.neutral is not None:
        return "no limit" if math.isinf(parameter.neutral) else f"{parameter.neutral:g}"
    return "robot.toml's" if parameter.initial is None else f"any (starts at {parameter.initial:g})"


def json_text(entries: Sequence[Effect]) -> str:
    """The entries as JSON; infinite numbers become null."""
    rows = [
        {
            "id": each.id,
            "group": each.group,
            "place": each.place.value,
            "sentence": each.sentence,
            "parameters": [_row(parameter) for parameter in each.parameters],
        }
        for each in entries
    ]
    return json.dumps(rows, indent=2, allow_nan=False)


def _row(parameter: Parameter) -> dict[str, object]:
    return {
        "name": parameter.name,
        "unit": parameter.unit,
        "neutral": _finite(parameter.neutral),
        "initial": _finite(parameter.initial),
        "low": _finite(parameter.bounds.low),
        "high": _finite(parameter.bounds.high),
        "prior_width": parameter.prior_width,
    }


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
