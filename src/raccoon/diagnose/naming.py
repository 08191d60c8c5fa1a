"""From coordinates to words: parameters with their uncertainty, rank, rivals, what was rejected and why."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.evidence import Gram
from raccoon.diagnose.forms import form_error
from raccoon.diagnose.gain import HeldOut, contributions
from raccoon.diagnose.hypotheses import Cause, Setting, Settings, places
from raccoon.diagnose.log import Log
from raccoon.diagnose.reports.wording import explanation, manoeuvre_for
from raccoon.diagnose.result import CauseResult, Gain, ParameterResult, Rejected
from raccoon.diagnose.select.outlook import Search, blocks_of
from raccoon.diagnose.select.search import CLOSE
from raccoon.diagnose.select.visible import VISIBLE, shows_from, visibility
from raccoon.sim.effects import effect

Array = NDArray[np.float64]

TWINS = (frozenset({"imu.gyro_scale", "drive.track_width", "drive.wheel_radius"}),)
"""Whole-robot causes that a gyro and wheels without a reference cannot tell apart: turn rate = scale r w /
b."""

SCALE = ("drive.inertia", "friction.coulomb", "friction.viscous")
"""Without a current reading, more resistance of both motors is the same as less of all of these together."""

NEEDS = {
    "gyro": (
        "imu.gyro_bias", "imu.gyro_scale", "imu.gyro_drift", "imu.latency", "drive.track_width",
        "drive.wheel_radius", "drive.wheel_eccentricity", "drive.backlash", "drive.wheel_slip",
    ),
    "battery": ("battery.open_circuit_voltage", "battery.internal_resistance", "battery.discharge"),
}  # fmt: skip
"""Effects that only show in a channel that may be missing."""


def named_causes(search: Search, judged: HeldOut) -> tuple[CauseResult, ...]:
    """The causes of the final set, those first that change most; see `gain.contributions`."""
    covariance = coordinate_covariance(search)
    after = judged.overall(judged.after)
    sizes = contributions(search)
    names = sorted(sizes, key=lambda name: -sizes[name])
    found = []
    for rank, name in enumerate(names, start=1):
        cause = search.problem.causes[name]
        values = parameters(search, cause, covariance)
        gain = Gain(judged.overall(judged.without[name]), after, judged.share(name))
        rivals = confounded(search, cause)
        found.append(
            CauseResult(
                cause.id, cause.where, rank, values, gain, probability(search, name, rivals), rivals,
                explanation(cause.id, cause.where, values),
            )
        )  # fmt: skip
    return tuple(found)


def coordinate_covariance(search: Search) -> Array:
    """Covariance of all coordinates: the curvature's, widened where blocks of time disagree more than it
    says.

    Sandwich estimate H^-1 (sum_b g_b g_b') H^-1 of White (1982) over blocks; with few blocks it is noisy, so
    only its mean ratio to the curvature's variance is used, and only where it is above 1.
    """
    fit = search.fit
    columns = fit.jacobian
    hessian = columns @ columns.T + np.eye(len(columns))
    inverse = np.asarray(np.linalg.inv(hessian), float)
    free = np.flatnonzero(fit.free)
    mean, _, _ = _total(search).solve()
    scores = np.stack([each.projection - each.matrix @ mean for each in blocks_of(fit)])
    spread = inverse[np.ix_(free, free)] @ (scores.T @ scores) @ inverse[np.ix_(free, free)]
    ratio = float(np.mean(np.diag(spread) / np.diag(inverse)[free]))
    return inverse * max(1.0, ratio)


def _total(search: Search) -> Gram:
    blocks = blocks_of(search.fit)
    total = blocks[0]
    for each in blocks[1:]:
        total = total + each
    return total


def parameters(search: Search, cause: Cause, covariance: Array) -> dict[str, ParameterResult]:
    """The effect's parameters at the fit; standard deviations by the chain rule through every coordinate."""
    problem, point = search.problem, search.fit.point
    vector = point.vector()
    here = problem.settings(point)
    moved = []
    for index in range(len(vector)):
        step = np.zeros(len(vector))
        step[index] = 1e-4
        moved.append(problem.settings(point.moved(vector + step)))
    place = places(cause.id, cause.where)[0]
    found = {}
    for each in effect(cause.id).parameters:
        key = (cause.id, place, each.name)
        value = _number(here, key)
        slope = np.array([(_number(other, key) - value) / 1e-4 for other in moved])
        slope = np.where(np.isfinite(slope), slope, 0.0)
        nominal = problem.neutral[key]
        form = form_error(cause.id) * abs(value - nominal if math.isfinite(nominal) else value)
        std = math.sqrt(max(float(slope @ covariance @ slope), 0.0) + form**2)
        found[each.name] = ParameterResult(value, std, each.unit, float(nominal))
    return found


def _number(settings: Settings, key: Setting) -> float:
    """A setting; an inertia with what robot.toml leaves open of it, which is counted apart."""
    value = float(settings[key])
    if key[0] != "drive.inertia":
        return value
    open_ = settings[("inertia", None, "straight")] * settings[("inertia", None, "turn")]
    return value * math.sqrt(open_)


def confounded(search: Search, cause: Cause) -> tuple[str, ...]:
    """Causes that explain this recording as well in its place."""
    close = [each.name for each in search.rivals.get(cause.name, []) if each.lead < CLOSE]
    close = [each for each in close if each not in search.fit.point.active]
    if cause.where is None:
        for twins in TWINS:
            if cause.id in twins:
                close.extend(sorted(twins - {cause.id} - set(close)))
        if cause.id == "motor.armature_resistance":
            close.extend(each for each in SCALE if each not in search.fit.point.active)
    return tuple(dict.fromkeys(close))


def probability(search: Search, name: str, rivals: tuple[str, ...]) -> float:
    """Posterior probability of the cause against dropping it and against its rivals, equal prior odds."""
    leads = {each.name: each.lead for each in search.rivals.get(name, [])}
    against = math.exp(-min(search.gains.get(name, 50.0), 700.0))
    against += sum(math.exp(-max(leads.get(each, 0.0), -50.0)) for each in rivals)
    return 1.0 / (1.0 + against)


def rejections(search: Search, log: Log) -> tuple[Rejected, ...]:
    """Why each other effect of the catalogue is not named; sides are not listed apart."""
    active = {search.problem.causes[name].id for name in search.fit.point.active}
    seen = visibility(search)
    found = []
    for id_ in dict.fromkeys(each.id for each in search.problem.causes.values()):
        if id_ in active:
            continue
        found.append(Rejected(id_, _reason(search, log, id_, seen.get(id_, 0.0))))
    return tuple(found)


def _reason(search: Search, log: Log, id_: str, visible: float) -> str:
    for role, ids in NEEDS.items():
        missing = log.channel(role) is None
        if missing and id_ in ids:
            return f"not identifiable: there is no {role} reading in this recording"
    if visible < VISIBLE:
        return f"not visible in this recording: a usual deviation would not show{shows_from(id_, visible)}"
    for name, reason in search.failed.items():
        if name.partition("@")[0] == id_:
            return f"{reason}{shows_from(id_, visible)}"
    return f"explains nothing that is left{shows_from(id_, visible)}"


def suggestions(search: Search, causes: tuple[CauseResult, ...], log: Log) -> tuple[str, ...]:
    """Manoeuvres that separate what is confounded and show what this recording could not."""
    wanted = [each.id for each in causes if each.confounded_with]
    seen = visibility(search)
    hidden = sorted((power, id_) for id_, power in seen.items() if power < VISIBLE)
    gone = {id_ for role, ids in NEEDS.items() if log.channel(role) is None for id_ in ids}
    wanted.extend(id_ for _, id_ in hidden if id_ not in gone)
    texts = [text for text in map(manoeuvre_for, wanted) if text is not None]
    return tuple(dict.fromkeys(texts))[:3]
