"""Checks whether the nominal values of a robot are plausible."""

from __future__ import annotations

from dataclasses import fields
from functools import lru_cache

from raccoon.core.errors import ConfigError
from raccoon.core.nominal import NominalModel
from raccoon.sim.effects.parameters import SIDES


@lru_cache(maxsize=64)
def check_nominal(model: NominalModel) -> None:
    """Raise ConfigError for a value outside its bounds: values made by a program were not checked by a file's
    reader."""
    for part in fields(model):
        check_section(model, part.name)


def check_section(model: NominalModel, part: str) -> None:
    """`check_nominal` for one section."""
    section = getattr(model, part)
    name = f"motor.{part}" if part in SIDES else part
    for each in fields(section):
        value, bounds = getattr(section, each.name).value, each.metadata["bounds"]
        if not bounds.allows(value):
            raise ConfigError(f"model.{name}.{each.name} is {value}: allowed are {bounds}")
