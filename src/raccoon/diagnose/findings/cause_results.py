"""Causes as results: parameters with uncertainty, rank, probability and rivals."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from raccoon.diagnose.findings.held_out import HeldOut, contributions
from raccoon.diagnose.findings.joint_numbers import describe_joint_numbers
from raccoon.diagnose.findings.uncertainty import FitUncertainty, setting_value
from raccoon.diagnose.fit.problem import Problem
from raccoon.diagnose.hypotheses.cause_catalogue import TURN_SCALE_CAUSES
from raccoon.diagnose.hypotheses.coordinates import FORM_PARAMETERS, WIDTH_FACTOR, Cause
from raccoon.diagnose.hypotheses.form_errors import min_form_error, relative_form_error
from raccoon.diagnose.reports.cause_text import explanation_sentence
from raccoon.diagnose.result import CauseResult, Gain, ParameterResult
from raccoon.diagnose.select.refits import GYRO_LOW_PASS, SHARED_SCALE_CAUSES, delay_same_reading
from raccoon.diagnose.select.rivals import (
    MAX_CLASS_LEAD,
    fault_probability,
    relative_odds,
    rivals_only_beside,
)
from raccoon.diagnose.select.state import Search
from raccoon.sim.effects.effect import Effect
from raccoon.sim.effects.parameters import SIDES

TURN_CLASSES = (frozenset(TURN_SCALE_CAUSES),)
"""Causes of turning that no sensor of the robot distinguishes."""

INDISTINGUISHABLE_CLASSES = (*TURN_CLASSES, frozenset(SHARED_SCALE_CAUSES))
"""Causes that no drive distinguishes: without a measured current, more resistance of both motors is also
equivalent to less inertia and friction together."""
CHIP_FILTER_NOTE = (
    "A gyro whose chip filters at 41 Hz, as the Wombat's firmware sets it, looks the same, and is no fault."
)


def make_cause_results(
    search: Search, judged: HeldOut, uncertainty: FitUncertainty
) -> tuple[CauseResult, ...]:
    """The causes of the final set. Those that matter come first, ordered by the expected change that
    robot.toml's deviations cannot absorb."""
    found = []
    for name, size in contributions(search).items():
        cause = search.problem.causes[name]
        values = fitted_parameters(search, cause, uncertainty)
        gain = Gain(judged.without[name], judged.size_after, judged.share(name))
        rivals = confounded_causes(search, cause)
        likely = cause_probability(search, name, rivals, values)
        values = widen_for_rivals(search, cause, values)
        told = _describe(search.problem, cause, values, rivals) + describe_joint_numbers(
            search, cause, uncertainty
        )
        found.append(
            CauseResult(
                cause.id, cause.where, 0, values, gain, likely, rivals, told, size.change, size.unabsorbed,
                rivals_only_beside(search, name, rivals),
            )
        )  # fmt: skip
    found.sort(key=lambda each: (each.is_negligible, -each.unabsorbed * fault_probability(search, each.name)))
    return tuple(replace(each, rank=rank) for rank, each in enumerate(found, start=1))


def _describe(
    problem: Problem, cause: Cause, values: dict[str, ParameterResult], rivals: tuple[str, ...]
) -> str:
    """The cause in a sentence. A lag is reported as the sum of itself and those lags from which it is not
    distinguished, except those with a base number, which have their own number."""
    if cause.own is not None:
        return cause.own.told({name: each.value for name, each in values.items()})
    said = explanation_sentence(cause.id, cause.where, values)
    tried = [each for each in rivals if each in problem.causes]
    both = [each for each in tried if delay_same_reading(cause.name, each) and not _has_number(problem, each)]
    if both:
        said += f" With {' or '.join(both)} beside it this is the sum of their times."
    return f"{said} {CHIP_FILTER_NOTE}" if GYRO_LOW_PASS in rivals else said


def _has_number(problem: Problem, name: str) -> bool:
    """Whether robot.toml has a number, with a standard deviation, for what a cause changes."""
    return any(problem.neutral[problem.base[each].settings[0]] for each in problem.base_indices_of(name))


def fitted_parameters(
    search: Search, cause: Cause, uncertainty: FitUncertainty
) -> dict[str, ParameterResult]:
    """The effect's parameters at the fit, with standard deviations that include form errors."""
    found = {}
    for each in cause.effect.parameters:
        if each.name == FORM_PARAMETERS.get(cause.id):
            continue
        key = (cause.id, cause.places[0], each.name)
        value = uncertainty.value_of(key)
        nominal = search.problem.neutral[key]
        form = relative_form_error(cause.id) * abs(value - nominal if math.isfinite(nominal) else value)
        least = min_form_error(cause.id, len(search.fit.point.active)) * WIDTH_FACTOR * each.prior_width
        std = math.hypot(uncertainty.std(key), form, least)
        found[each.name] = ParameterResult(value, std, each.unit, float(nominal))
    return found


def widen_for_rivals(
    search: Search, cause: Cause, values: Mapping[str, ParameterResult]
) -> dict[str, ParameterResult]:
    """A cause's numbers, with standard deviations increased by the change of the number if a rival of another
    cause is the true one.

    If K_E of both motors is as assumed, and track and inertia differ instead, friction differs too: in
    proportion to that probability its number is no better known than the difference. (If the cause itself has
    rivals, its number is that in the case that it is present.)
    """
    fitted = search.problem.settings(search.fit.point)
    rivals_of_others = [
        [
            (relative_odds(each), each.settings)
            for each in tried
            if each.lead < MAX_CLASS_LEAD and each.settings is not None
        ]
        for name, tried in search.rivals.items()
        if name != cause.name and name in search.fit.point.active
    ]
    wider = {}
    for name, value in values.items():
        key, square = (cause.id, cause.places[0], name), value.std**2
        for rivals in rivals_of_others:
            total = 1.0 + sum(weight for weight, _ in rivals)
            shifts = (
                (weight, setting_value(settings, key) - setting_value(fitted, key))
                for weight, settings in rivals
            )
            square += sum(weight / total * shift**2 for weight, shift in shifts if math.isfinite(shift))
        wider[name] = replace(value, std=math.sqrt(square))
    return wider


def confounded_causes(search: Search, cause: Cause) -> tuple[str, ...]:
    """Causes that explain this recording equally well in its place, and those that no drive distinguishes
    from one of them."""
    close = [
        each.name for each in search.rivals.get(cause.name, []) if each.lead < MAX_CLASS_LEAD or each.beside
    ]
    close = [
        each for each in close if each not in search.fit.point.active and not _lacks_reading(search, each)
    ]
    asked = frozenset(search.problem.causes)  # without those that a reference decided
    for twins in (each & asked for each in TURN_CLASSES):
        if cause.name in twins:
            close.extend(sorted(twins - {cause.name, *close}))
        elif twins & set(close):
            close.extend(sorted(twins - {*close, *search.fit.point.active}))
    if cause.name == "motor.armature_resistance":
        close.extend(each for each in SHARED_SCALE_CAUSES if each not in (cause.id, *search.fit.point.active))
    return tuple(dict.fromkeys(close))


def _lacks_reading(search: Search, name: str) -> bool:
    """Whether a cause changes only readings of back-EMF that were not recorded. It explains nothing, so it is
    close to any cause that explains little."""
    cause = search.problem.causes.get(name)
    if cause is None or not cause.id.startswith("bemf."):
        return False
    sides = SIDES if cause.where is None else (cause.where,)
    return not any(f"bemf_{side}" in search.problem.features.roles for side in sides)


def cause_probability(
    search: Search, name: str, rivals: tuple[str, ...], values: Mapping[str, ParameterResult]
) -> float:
    """Posterior probability of the cause against dropping it and against its rivals, with equal prior odds.

    No model has exactly the robot's form, so a lead over a rival counts for less than its value, and a lead
    over no cause for no more than the number's distance from 0 in standard deviations: beside a large latency
    a slip of 0.15 +- 0.25 ms led by 19. (A cause with rivals is present even if its own number is uncertain.)
    """
    tried = search.rivals.get(name, [])
    rival_odds = {each.name: relative_odds(each) for each in tried if not each.beside}
    beside = rivals_only_beside(search, name, rivals)
    away = math.inf if rivals else largest_deviation(search.problem.causes[name].effect, values)
    against = math.exp(-min(search.leads.get(name, 50.0), 0.5 * away**2, 700.0))
    against += sum(rival_odds.get(each, 1.0) for each in rivals if each not in beside)
    return 1.0 / (1.0 + against)


def largest_deviation(effect: Effect, values: Mapping[str, ParameterResult]) -> float:
    """Largest deviation of a cause's numbers from the assumed values, in standard deviations, among those
    that determine its size and not its shape."""
    sizes = [each.name for each in effect.parameters if each.neutral is not None]
    relevant = [each for name, each in values.items() if name in (*sizes, effect.parameters[0].name)]
    return max(
        (abs(each.value - each.nominal) / each.std for each in relevant if each.std > 0.0), default=math.inf
    )
