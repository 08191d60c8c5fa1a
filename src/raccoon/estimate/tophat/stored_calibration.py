"""One stored calibration of a tophat, and the checks when it is read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, dataclass, fields
from typing import Any

from raccoon.core.errors import ConfigError
from raccoon.core.schema import Bounds, finite_or_none, format_value, refuse_unknown
from raccoon.estimate.tophat.calibration import Surface, TophatCalibration, Verdict
from raccoon.estimate.tophat.flicker import FLICKER_HZ
from raccoon.model.reflectance import FULL_SCALE, GENERATIONS

COUNTS_BOUNDS = Bounds(0.0, FULL_SCALE)
SPREAD_BOUNDS = Bounds(positive=True, high=FULL_SCALE)
SHARE_BOUNDS = Bounds(0.0, 1.0)
FROM_ZERO_BOUNDS = Bounds(0.0)
VOLTAGE_BOUNDS = Bounds(0.0, 30.0)


@dataclass(frozen=True, slots=True)
class StoredCalibration:
    """One calibration with its origin.

    set_name: the floor or table that it is for. time: ISO 8601, given by the caller. ambient: light level (0
    normal, 1 direct sun). battery_voltage: V. generation: "old" or "new". None: unknown.
    """

    sensor: str
    set_name: str
    time: str
    calibration: TophatCalibration
    robot: str = ""
    ambient: float | None = None
    battery_voltage: float | None = None
    generation: str | None = None


def parse_entry(table: object, where: str) -> StoredCalibration:
    """An entry of the file, with every value checked. where: its place in the file, for messages.

    Raises ConfigError naming the entry, its sensor, the key, the value and what is allowed.
    """
    values = _check_table(StoredCalibration, table, where)
    sensor = _check_text(values["sensor"], f"{where}.sensor")
    here = f"{where} (sensor {sensor})"
    generation = values.get("generation")
    if generation is not None and generation not in GENERATIONS:
        raise ConfigError(f"{here}.generation = {format_value(generation)}: allowed are null, old and new")
    return StoredCalibration(
        sensor,
        _check_text(values["set_name"], f"{here}.set_name"),
        _check_text(values["time"], f"{here}.time"),
        _parse_calibration(values["calibration"], f"{here}.calibration"),
        _check_text(values.get("robot", ""), f"{here}.robot"),
        _optional_number(values.get("ambient"), FROM_ZERO_BOUNDS, f"{here}.ambient"),
        _optional_number(values.get("battery_voltage"), VOLTAGE_BOUNDS, f"{here}.battery_voltage"),
        generation,
    )


def _parse_calibration(table: object, where: str) -> TophatCalibration:
    values = _check_table(TophatCalibration, table, where)
    verdict = values["verdict"]
    if verdict not in tuple(Verdict):
        raise ConfigError(f"{where}.verdict = {format_value(verdict)}: allowed is {' | '.join(Verdict)}")
    flickers = values.get("flickers", 0)
    if isinstance(flickers, bool):  # files written before lamps of 120 Hz were supported
        flickers = 100 if flickers else 0
    if flickers not in (0, *FLICKER_HZ):
        raise ConfigError(
            f"{where}.flickers = {format_value(flickers)}: allowed are 0, 100, 120 and 250 (Hz)"
        )
    threshold, low, high = (
        _optional_number(values.get(key), COUNTS_BOUNDS, f"{where}.{key}")
        for key in ("threshold", "low", "high")
    )
    found = TophatCalibration(
        Verdict(verdict),
        _check_text(values["reason"], f"{where}.reason"),
        _parse_surface(values.get("white"), f"{where}.white"),
        _parse_surface(values.get("black"), f"{where}.black"),
        threshold,
        low,
        high,
        separation=_check_number(values.get("separation", 0.0), FROM_ZERO_BOUNDS, f"{where}.separation"),
        share_black=_check_number(values.get("share_black", 0.0), SHARE_BOUNDS, f"{where}.share_black"),
        error_rate=_optional_number(values.get("error_rate"), SHARE_BOUNDS, f"{where}.error_rate"),
        flickers=flickers,
    )
    _check_order(found, where)
    return found


def _check_order(found: TophatCalibration, where: str) -> None:
    """Raise ConfigError if the levels of a calibration with a threshold are missing or not in order."""
    if not found.verdict.usable and found.threshold is None:
        return
    levels = {
        "white.mean": None if found.white is None else found.white.mean,
        "low": found.low,
        "threshold": found.threshold,
        "high": found.high,
        "black.mean": None if found.black is None else found.black.mean,
    }
    missing = [key for key, value in levels.items() if value is None]
    if missing:
        raise ConfigError(f"{where}.{missing[0].partition('.')[0]}: it is missing, the verdict needs it")
    ordered = [value for value in levels.values() if value is not None]
    if ordered != sorted(ordered) or ordered[0] == ordered[-1]:
        said = ", ".join(f"{key} = {value:g}" for key, value in zip(levels, ordered, strict=True))
        raise ConfigError(f"{where}: {said}: they must rise in this order")


def _parse_surface(table: object, where: str) -> Surface | None:
    if table is None:
        return None
    values = _check_table(Surface, table, where)
    count = values["count"]
    if isinstance(count, bool) or not isinstance(count, int) or count < 0:
        raise ConfigError(f"{where}.count = {format_value(count)}: allowed are whole numbers from 0")
    mean = _check_number(values["mean"], COUNTS_BOUNDS, f"{where}.mean")
    return Surface(mean, _check_number(values["sd"], SPREAD_BOUNDS, f"{where}.sd"), count)


def _check_table(kind: type[Any], table: object, where: str) -> Mapping[str, Any]:
    """The table, if it has no key that `kind` has not, and all required ones."""
    if not isinstance(table, Mapping):
        raise ConfigError(f"{where} = {format_value(table)}: it must be a table")
    refuse_unknown(table, tuple(each.name for each in fields(kind)), where)
    for each in fields(kind):
        if each.default is MISSING and each.name not in table:
            raise ConfigError(f"{where}.{each.name}: it is missing")
    return table


def _check_text(value: object, where: str) -> str:
    if not isinstance(value, str):
        raise ConfigError(f"{where} = {format_value(value)}: it must be a text")
    return value


def _check_number(value: object, bounds: Bounds, where: str) -> float:
    found = finite_or_none(value)
    if found is None or not bounds.allows(found):
        raise ConfigError(f"{where} = {format_value(value)}: allowed are {bounds}")
    return found


def _optional_number(value: object, bounds: Bounds, where: str) -> float | None:
    return None if value is None else _check_number(value, bounds, where)
