"""What a reference of the pose decided, told with what the search from there found."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from raccoon.core.config import Measured, RobotConfig
from raccoon.diagnose.findings.extend import named_origin, rebased
from raccoon.diagnose.findings.known_together import K_E, TURN_READS
from raccoon.diagnose.hypotheses.base_coordinates import INSIDE
from raccoon.diagnose.recordings.reference.compared import Factor, Reference
from raccoon.diagnose.recordings.reference.rescaled import GYRO_COLUMN, Rescaled
from raccoon.diagnose.recordings.reference.start import GYRO, RADIUS, READING, TRACK, Start, assumed
from raccoon.diagnose.reports.wording import explanation
from raccoon.diagnose.result import (
    LARGE_REST,
    CauseResult,
    Diagnosis,
    Gain,
    ParameterResult,
    Rejected,
    Unexplained,
    Verdict,
)
from raccoon.sim.effects.parameters import SIDES, Parameters

SCALE = ("motor.armature_resistance", "drive.inertia", "friction.coulomb")
"""Where these are wrong as well, a K_E that is off by as much as the radius does the same, beside others of
them."""
RATIO = "times robot.toml's"
SAYS_SO = "The recorded reference says so."


def with_reference(found: Diagnosis, start: Start, model: Parameters | None = None) -> Diagnosis:
    """The diagnosis of a search from there, told from where robot.toml is: with what the reference decided as
    causes, and what it measured."""
    if start.reference == Reference():
        return found
    told = dict(start.clear)
    if RADIUS in start.shifts and not any(each.name == RADIUS for each in found.causes):
        told[RADIUS] = abs(start.shifts[RADIUS].value - 1.0) / _radius_std(start)
    found = _from_robot(found, start)
    if told and any(each.name == GYRO_COLUMN for each in found.channels):
        found = _with_causes(found, start, told, model)
    elif TRACK in told:
        found = _with_track(found, start, told[TRACK], model)
    others = (each for each in found.rejected if each.id not in told)
    return replace(
        found,
        rejected=(*others, *_rejected(found, start)),
        identified={**found.identified, **_identified(found, start, model)},
    )


def _from_robot(found: Diagnosis, start: Start) -> Diagnosis:
    """What the search says of the radius, and the model, counted from robot.toml's number."""
    by = {id_: each.value for id_, each in start.shifts.items()}
    found = replace(found, model=None if found.model is None else rebased(found.model, start.given, by))
    if RADIUS not in by:
        return found
    causes = []
    for each in found.causes:
        if each.id == RADIUS and each.where is None:
            number = each.parameters["factor"]
            values = {
                "factor": replace(
                    number, value=by[RADIUS] * number.value, std=by[RADIUS] * number.std
                )
            }  # fmt: skip
            told = explanation(each.id, each.where, values)
            each = replace(each, parameters=values, explanation=told)
            if abs(values["factor"].value - number.nominal) < INSIDE * values["factor"].std:
                continue  # the search took back what the reference seemed to say: something else was wrong
        causes.append(each)
    return replace(found, causes=tuple(causes))


def _with_causes(
    found: Diagnosis, start: Start, told: Mapping[str, float], model: Parameters | None
) -> Diagnosis:
    """With causes that the reference decided. They scale the gyro's reading and nothing else, so what is
    wrong without one is known from the readings with it."""
    factors = {id_: start.shifts[id_] for id_ in told}
    if not found.curves:
        return found
    whole = math.prod(start.shifts[id_].value ** TURN_READS[id_] for id_ in start.shifts)
    judged = Rescaled.of(found)
    size_before, size_after = judged.size(1.0 / whole, before=True), judged.size(1.0)
    start_size = judged.size(1.0, before=True)
    share, scale = _rest(found.unexplained.share, start_size, size_before, size_after)
    causes = [replace(each, gain=replace(each.gain, share=scale * each.gain.share)) for each in found.causes]
    for id_, factor in factors.items():
        power = TURN_READS[id_]
        without = judged.size(factor.value**-power)
        possible = max(size_before, without) ** 2 - 1.0
        gained = float(np.clip((without**2 - size_after**2) / max(possible, 1e-6), 0.0, 1.0))
        change = judged.change(factor.value**-power)
        open_ = INSIDE * _open(start.given)
        beyond = change * max(1.0 - open_ / abs(factor.value - 1.0), 0.0) / math.sqrt(len(found.channels))
        has = assumed(model, id_)
        std = _radius_std(start) if id_ == RADIUS else factor.std
        values = {"factor": ParameterResult(has * factor.value, has * std, "", has)}
        sure = math.erf(told[id_] / math.sqrt(2.0))
        alike = _alike(id_, found)
        causes.append(
            CauseResult(
                id_, None, 0, values, Gain(without, size_after, gained), sure / (1.0 + len(alike)), alike,
                f"{explanation(id_, None, values)} {SAYS_SO}", change, beyond,
            )
        )  # fmt: skip
    causes.sort(key=lambda each: (each.little, -each.unabsorbed))
    ranked = tuple(replace(each, rank=rank) for rank, each in enumerate(causes, start=1))
    matters = any(not each.little for each in ranked)
    return replace(
        found,
        causes=ranked,
        verdict=_verdict(found, share) if matters else found.verdict,
        unexplained=Unexplained(share, found.unexplained.depends_on),
        channels=judged.channels(1.0 / whole),
        curves=judged.curves_from(1.0 / whole),
        model=_with_origins(found.model, ranked, factors),
    )


def _with_track(found: Diagnosis, start: Start, away: float, model: Parameters | None) -> Diagnosis:
    """With a track width that no reading shows where there is no gyro, but the reference does."""
    factor, has = start.shifts[TRACK], assumed(model, TRACK)
    values = {"factor": ParameterResult(has * factor.value, has * factor.std, "", has)}
    rest = [each.rmse_after / each.noise_floor for each in found.channels if each.noise_floor > 0.0]
    size = float(np.sqrt(np.mean(np.square(rest)))) if rest else 1.0
    told = f"{explanation(TRACK, None, values)} {SAYS_SO}"
    rank, sure = len(found.causes) + 1, math.erf(away / math.sqrt(2.0))
    cause = CauseResult(TRACK, None, rank, values, Gain(size, size, 0.0), sure, (), told)
    causes = (*found.causes, cause)
    verdict = _verdict(found, found.unexplained.share)
    return replace(
        found, causes=causes, verdict=verdict, model=_with_origins(found.model, causes, start.shifts)
    )


def _alike(id_: str, found: Diagnosis) -> tuple[str, ...]:
    """What stays to be told from a cause that the reference gave."""
    scaled = any(each.id in SCALE and each.where is None for each in found.causes)
    return (K_E,) if id_ == RADIUS and scaled else ()


def _with_origins(
    model: Parameters | None, causes: Sequence[CauseResult], told: Mapping[str, Factor]
) -> Parameters | None:
    """A model that says of what the reference decided where it is from."""
    if model is None:
        return None
    for each in causes:
        for key in list(model.effects):
            if each.id in told and key[0] == each.id:
                model = model.with_origin(*key, named_origin(each))
    return model


def _verdict(found: Diagnosis, share: float) -> Verdict:
    """Of a diagnosis with something more that matters."""
    if found.verdict is Verdict.ADEQUATE:
        return Verdict.EXPLAINED
    if found.unexplained.depends_on or share >= LARGE_REST:
        return Verdict.PARTLY
    return Verdict.EXPLAINED


def _rest(share: float, start: float, before: float, after: float) -> tuple[float, float]:
    """The share that is left, and by how much all shares are smaller, of an error that was larger before."""
    foreseen = 1.0 if share > 0.99 else (after**2 - share * start**2) / (1.0 - share)
    foreseen = min(max(foreseen, 1.0), after**2)
    possible, was = max(before**2 - foreseen, 1e-6), max(start**2 - foreseen, 1e-6)
    left = 0.0 if share == 0.0 else float(np.clip((after**2 - foreseen) / possible, 0.0, 1.0))
    return left, min(was / possible, 1.0)


def _open(robot: RobotConfig) -> float:
    """How far robot.toml leaves the three open together, relative."""
    model = robot.model
    numbers = (model.imu.gyro_scale, model.drive.track_width, model.drive.wheel_radius)
    return math.hypot(*(each.std / each.value for each in numbers))


def _radius_std(start: Start) -> float:
    """Of a radius that the reference gave: with what robot.toml leaves open of the wheels' readings."""
    factor, motors = start.shifts[RADIUS], (start.given.model.left, start.given.model.right)
    reading = max(each.back_emf_constant.std / each.back_emf_constant.value for each in motors)
    return math.hypot(factor.std, factor.value * reading)


def _rejected(found: Diagnosis, start: Start) -> list[Rejected]:
    """Why what the reference decided is no cause."""
    named = {each.id for each in found.causes}
    reasons = []
    for id_ in start.decided:
        if id_ in named:
            continue
        factor = start.reference.gyro if id_ == GYRO else start.reference.track
        if factor is None:
            continue
        number = f"{factor.value:.4f} +- {factor.std:.2g} {RATIO}"
        reasons.append(Rejected(id_, f"by the reference it is {number}"))
    return reasons


def _identified(found: Diagnosis, start: Start, model: Parameters | None) -> dict[str, ParameterResult]:
    """What the reference says of each: of the wheels with their readings as the causes and the model that was
    asked about have them, or over those where a cause may be a radius as well."""
    reference, motors = start.reference, (start.given.model.left, start.given.model.right)
    factors = {"gyro scale": reference.gyro, "track width": reference.track}
    known = all(_is_reading(found.causes, side) for side in SIDES)
    length = "radius" if known else "radius over K_E"
    sides = []
    for side, factor, motor in zip(SIDES, (reference.left, reference.right), motors, strict=True):
        if factor is None:
            continue
        if known:
            reading = _reading(found.causes, side, motor.back_emf_constant, model)
            std = math.hypot(factor.std / factor.value, reading.std)
            factor = Factor(factor.value * reading.value, std * factor.value * reading.value)
        sides.append(factor)
    if len(sides) == len(SIDES):
        left, right = sides
        uneven = reference.uneven
        if uneven is not None and abs(uneven.value - 1.0) > INSIDE * uneven.std:
            factors |= {f"left wheel's {length}": left, f"right wheel's {length}": right}
        else:
            mean = 0.5 * (left.value + right.value)
            factors[f"wheel {length}"] = Factor(mean, 0.5 * (left.std + right.std))
    return {
        f"{name} by the reference": ParameterResult(each.value, each.std, RATIO, math.nan)
        for name, each in factors.items()
        if each is not None
    }


def _of_reading(causes: Sequence[CauseResult], side: str) -> list[CauseResult]:
    """The causes that were named which make a wheel's counts other than assumed."""
    return [each for each in causes if each.id in READING and each.where in (None, side)]


def _is_reading(causes: Sequence[CauseResult], side: str) -> bool:
    """Whether no such cause may be the wheel's radius as well."""
    rivals = (rival for each in _of_reading(causes, side) for rival in each.confounded_with)
    return not any(rival.partition("@")[0] == RADIUS for rival in rivals)


def _reading(causes: Sequence[CauseResult], side: str, k_e: Measured, model: Parameters | None) -> Factor:
    """By what the causes, and the model where none is named, make a wheel's counts larger than robot.toml's.
    Its std is relative, and of robot.toml's K_E where no cause gives another."""
    named = _of_reading(causes, side)
    factors = [each.parameters["factor"] for each in named]
    values, stds = [each.value for each in factors], [each.std / each.value for each in factors]
    ids = {each.id for each in named}
    if K_E not in ids:
        stds.append(k_e.std / k_e.value)
    if model is not None:
        values += [model.value(id_, "factor", side) for id_ in READING if id_ not in ids]
    return Factor(math.prod(values), math.hypot(*stds))
