"""Causes in words, for a team: the sentence of a cause, adapted to its recording and robot.toml."""

from __future__ import annotations

from dataclasses import replace

from raccoon.diagnose.reports.cause_sentences import (
    INTO_ROBOT_TOML,
    SENTENCES,
    CauseText,
    Values,
    first_value,
)
from raccoon.diagnose.reports.plain_names import place_name
from raccoon.diagnose.result import CauseResult
from raccoon.sim.effects.parameters import SIDES

ROBOT_TOML_KEYS = {
    "battery.open_circuit_voltage": "open_circuit_voltage",
    "battery.internal_resistance": "internal_resistance",
    "friction.coulomb": "coulomb",
    "friction.viscous": "viscous",
    "bemf.filter_lag": "filter_time_constant",
}
"""Keys in [model.GROUP] of robot.toml for the values of causes that can be written there."""
INTO_MODEL_TOML = "keep it in a model.toml (--save-model), since robot.toml has one number for both wheels"
"""Advice for the value of one side only: in robot.toml it would make the other side's wrong."""


def describe_cause(cause: CauseResult) -> CauseText:
    """A cause of a result in words. An explanation of the recording's own kind (a single axis, a tophat, an
    effect of the team's) already says what to do."""
    own, said = _describe(cause.id, cause.where, cause.parameters), cause.explanation
    if said.startswith(str(own)):
        return replace(own, more=said.removeprefix(str(own)).strip())
    if said.startswith(f"{own.what}: "):  # other advice, as in `with_robot_toml_value`
        return replace(own, todo=said.removeprefix(f"{own.what}: ").removesuffix("."))
    return CauseText(said.removesuffix("."), "")


def with_robot_toml_value(cause: CauseResult, robot_toml_value: float) -> CauseResult:
    """A cause whose value robot.toml already has (`robot_toml_value`): the diagnosis started from an outdated
    model.toml, and nothing is to be done on the robot."""
    group, key = cause.id.partition(".")[0], ROBOT_TOML_KEYS[cause.id]
    todo = (
        f"robot.toml has {key} = {robot_toml_value:.4g} in [model.{group}] already; the model.toml of "
        "--model is out of date (--save-model writes a new one)"
    )
    found = replace(describe_cause(cause), todo=todo)
    return replace(cause, explanation=f"{found} {found.more}".rstrip())


def explanation_sentence(id: str, where: str | None, values: Values) -> str:  # noqa: A002
    """One sentence: what is wrong, its value, what to do."""
    return str(_describe(id, where, values))


def _describe(id: str, where: str | None, values: Values) -> CauseText:  # noqa: A002
    place, maker = place_name(id, where), SENTENCES.get(id)
    if maker is None:
        numbers = ", ".join(f"{name} {each.value:.4g} {each.unit}".strip() for name, each in values.items())
        found = CauseText(f"{id} at {place}: {numbers}", "")
    else:
        found = maker(place, values)
    into = INTO_MODEL_TOML if where in SIDES else INTO_ROBOT_TOML
    if id in ROBOT_TOML_KEYS and where not in SIDES:
        number = first_value(values)
        unit = f" ({number.unit})" if number.unit else ""
        key, group = ROBOT_TOML_KEYS[id], id.partition(".")[0]
        into = f"put {key} = {number.value:.4g}{unit} into [model.{group}] of robot.toml"
    return CauseText(found.what[0].upper() + found.what[1:], found.todo.replace(INTO_ROBOT_TOML, into))
