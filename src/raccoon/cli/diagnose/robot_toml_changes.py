"""Notes for recordings of one robot that were compared with different contents of robot.toml."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from itertools import pairwise

from raccoon.cli.diagnose.job import Answer
from raccoon.core.config import Measured, RobotConfig

COMPARED_SECTIONS = ("drive", "motors", "tophats", "model")
"""Sections of robot.toml that a diagnosis uses."""


def with_robot_toml_notes(answers: Mapping[str, Answer], called: Mapping[str, str]) -> dict[str, Answer]:
    """The answers, in their order, with a note where robot.toml changed between two recordings of a robot: a
    motor that was calibrated in between seems to have been replaced. called: each recording's robot."""
    from raccoon.diagnose.reports.fleet_text import shorten_names

    told: dict[str, list[str]] = {}
    for robot in dict.fromkeys(called.values()):
        own = [name for name in answers if called[name] == robot]
        for before, name in pairwise(own):
            changed = _changed_keys(answers[before].config, answers[name].config)
            if changed:
                told.setdefault(robot, []).append(f"from {name} on ({shorten_names(changed)})")
    found = dict(answers)
    for name, each in answers.items():
        if called[name] in told:
            note = (
                f"robot.toml changed {shorten_names(told[called[name]])}: each recording is compared with "
                "its own, so a change in the results may come from that file; --robot robot.toml compares "
                "all recordings with one"
            )
            diagnosis = replace(each.diagnosis, notes=(note, *each.diagnosis.notes))
            found[name] = replace(each, diagnosis=diagnosis)
    return found


def _changed_keys(one: RobotConfig, other: RobotConfig) -> list[str]:
    """The keys that differ between two robot.toml, among those that a diagnosis uses."""
    first, second = (
        {key: it for name in COMPARED_SECTIONS for key, it in _flatten(name, getattr(robot, name))}
        for robot in (one, other)
    )
    return [key for key in {**first, **second} if first.get(key) != second.get(key)]


def _flatten(name: str, value: object) -> Iterator[tuple[str, object]]:
    """Each value below a section, by its key; a value and its standard deviation count as one."""
    if is_dataclass(value) and not isinstance(value, Measured):
        for each in fields(value):
            yield from _flatten(f"{name}.{each.name}", getattr(value, each.name))
    elif isinstance(value, Mapping):
        for key, each in value.items():
            yield from _flatten(f"{name}.{key}", each)
    else:
        yield name, value
