"""Reading a table from a TOML file. Lengths in m, x ahead of the usual start pose, y to its left.

name = "practice"
area = { low = [-0.3, -0.6], high = [2.06, 0.57] }       # walls around it, unless walls = false
start_box = { low = [-0.3, -0.6], high = [0.3, 0.3] }

[[line]]                                                  # along points ...
points = [[0.9, -0.6], [0.9, 0.57]]
width = 0.05

[[line]]                                                  # ... or along a circle
arc = { centre = [1.2, 0.0], radius = 0.3, from_deg = 0, to_deg = 180 }

[[wall]]
from = [0.5, 0.2]
to = [0.8, 0.2]

[[object]]
centre = [1.2, 0.3]
radius = 0.05

[[light]]                                                 # 0 is normal light, 1 direct sun
low = [1.0, -0.6]
high = [1.4, 0.57]
ambient = 0.6
begin = 10.0                                              # s, optional
end = 60.0

[[ramp]]                                                  # N m at each wheel that pull along x and y
low = [1.6, -0.2]
high = [2.06, 0.2]
along_x = -0.05
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from raccoon.core.errors import ConfigError
from raccoon.core.files import read_bounded
from raccoon.core.schema import finite_or_none, format_value, refuse_unknown
from raccoon.core.toml_text import parse_toml
from raccoon.sim.world.table import Box, Light, Line, Point, Ramp, Thing, Wall, World, walls_around

ARC_STEPS = 48
"""Straight pieces that a full circle is divided into, at least."""
SAGITTA = 0.0005
"""Largest distance between a straight piece and its arc, m."""
_KEYS = ("name", "area", "walls", "start_box", "line", "wall", "object", "light", "ramp")


def load_world(path: str | Path) -> World:
    """Read a table file. Raises ConfigError, which names file, key and value, and FileNotFoundError."""
    path = Path(path)
    content = read_bounded(path)
    try:
        return parse_world(parse_toml(content))
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None


def parse_world(table: Mapping[str, Any]) -> World:
    """Make a table from the parsed content of a file. Raises ConfigError."""
    refuse_unknown(table, _KEYS, "")
    area = _box(table["area"], "area") if "area" in table else None
    walls = [
        Wall(_point(entry, "from", where), _point(entry, "to", where))
        for where, entry in _entries(table, "wall", ("from", "to"))
    ]
    around = table.get("walls", True)
    if not isinstance(around, bool):
        raise ConfigError(f"walls = {around!r}: allowed are true and false")
    if area is not None and around:
        walls = [*walls_around(area), *walls]
    return World(
        name=str(table.get("name", "table")),
        area=area,
        start_box=_box(table["start_box"], "start_box") if "start_box" in table else None,
        lines=tuple(
            _line(entry, where) for where, entry in _entries(table, "line", ("points", "arc", "width"))
        ),
        walls=tuple(walls),
        objects=tuple(
            Thing(_point(entry, "centre", where), _positive(entry, "radius", where))
            for where, entry in _entries(table, "object", ("centre", "radius"))
        ),
        lights=tuple(
            _light(entry, where)
            for where, entry in _entries(table, "light", ("low", "high", "ambient", "begin", "end"))
        ),
        ramps=tuple(
            Ramp(
                _corners(entry, where),
                _number(entry, "along_x", where, 0.0),
                _number(entry, "along_y", where, 0.0),
            )
            for where, entry in _entries(table, "ramp", ("low", "high", "along_x", "along_y"))
        ),
    )


def _entries(
    table: Mapping[str, Any], key: str, known: tuple[str, ...]
) -> list[tuple[str, Mapping[str, Any]]]:
    entries = table.get(key, [])
    if not (isinstance(entries, list) and all(isinstance(each, Mapping) for each in entries)):
        raise ConfigError(f"{key}: write [[{key}]], one for each")
    named = [(f"{key} number {number}", entry) for number, entry in enumerate(entries, start=1)]
    for where, entry in named:
        refuse_unknown(entry, known, where)
    return named


def _line(entry: Mapping[str, Any], where: str) -> Line:
    if ("points" in entry) == ("arc" in entry):
        raise ConfigError(f"{where}: it needs either points or arc")
    width = _positive(entry, "width", where) if "width" in entry else 0.05
    if "arc" in entry:
        return Line(_arc(entry["arc"], f"{where}.arc"), width)
    if not isinstance(entry["points"], list):
        raise ConfigError(f"{where}.points = {entry['points']!r}: write [[x, y], [x, y]]")
    points = tuple(_as_point(each, f"{where}.points") for each in entry["points"])
    if len(points) < 2 or any(a == b for a, b in itertools.pairwise(points)):
        raise ConfigError(f"{where}.points: it needs two points or more, none of them twice in a row")
    return Line(points, width)


def _arc(entry: object, where: str) -> tuple[Point, ...]:
    if not isinstance(entry, Mapping):
        raise ConfigError(f"{where} = {entry!r}: write {{ centre = [x, y], radius = m }}")
    refuse_unknown(entry, ("centre", "radius", "from_deg", "to_deg"), where)
    x, y = _point(entry, "centre", where)
    radius = _positive(entry, "radius", where)
    first, last = _number(entry, "from_deg", where, 0.0), _number(entry, "to_deg", where, 360.0)
    if not 0.0 < abs(last - first) <= 360.0:
        raise ConfigError(f"{where}: from_deg {first:g} to to_deg {last:g}: allowed is up to one turn")
    begin, end = math.radians(first), math.radians(last)
    piece = 2.0 * math.acos(max(0.0, 1.0 - SAGITTA / radius))
    steps = max(2, math.ceil(abs(end - begin) / min(piece, math.tau / ARC_STEPS)))
    angles = [begin + (end - begin) * step / steps for step in range(steps + 1)]
    return tuple((x + radius * math.cos(angle), y + radius * math.sin(angle)) for angle in angles)


def _light(entry: Mapping[str, Any], where: str) -> Light:
    ambient = _number(entry, "ambient", where)
    if not 0.0 <= ambient <= 2.0:
        raise ConfigError(f"{where}.ambient is {ambient}: allowed are numbers from 0 (normal) to 2 (1: sun)")
    begin, end = _number(entry, "begin", where, 0.0), _number(entry, "end", where, math.inf)
    if not begin < end:
        raise ConfigError(f"{where}: it begins at {begin:g} s and ends at {end:g} s: it would never shine")
    return Light(_corners(entry, where), ambient, begin, end)


def _box(entry: object, where: str) -> Box:
    if not isinstance(entry, Mapping):
        raise ConfigError(f"{where} = {entry!r}: write {{ low = [x, y], high = [x, y] }}")
    refuse_unknown(entry, ("low", "high"), where)
    box = _corners(entry, where)
    if not all(map(math.isfinite, (*box.low, *box.high))):
        raise ConfigError(f"{where}: low {box.low}, high {box.high}: allowed are finite numbers")
    return box


def _corners(entry: Mapping[str, Any], where: str) -> Box:
    low, high = _point(entry, "low", where), _point(entry, "high", where)
    if not (low[0] < high[0] and low[1] < high[1]):
        raise ConfigError(f"{where}: low {low} must be below high {high} in both x and y")
    return Box(low, high)


def _point(entry: Mapping[str, Any], key: str, where: str) -> Point:
    if key not in entry:
        raise ConfigError(f"{where}.{key} is missing: write {key} = [x, y]")
    return _as_point(entry[key], f"{where}.{key}")


def _as_point(value: object, where: str) -> Point:
    if not (isinstance(value, list) and len(value) == 2 and all(map(_is_coordinate, value))):
        raise ConfigError(f"{where} = {format_value(value)}: it must be [x, y] in m")
    return float(value[0]), float(value[1])


def _is_coordinate(value: object) -> bool:
    """Whether a value is a number; infinite ones count, since light and ramps may reach everywhere."""
    return isinstance(value, float) or finite_or_none(value) is not None


def _positive(entry: Mapping[str, Any], key: str, where: str) -> float:
    value = _number(entry, key, where)
    if not value > 0.0:
        raise ConfigError(f"{where}.{key} is {value}: allowed are numbers above 0")
    return value


def _number(entry: Mapping[str, Any], key: str, where: str, default: float | None = None) -> float:
    value = finite_or_none(entry[key]) if key in entry else default
    if value is None:
        raise ConfigError(f"{where}.{key} = {format_value(entry.get(key))}: it must be a finite number")
    return value
