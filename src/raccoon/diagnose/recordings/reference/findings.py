"""Adds what a reference of the pose determined to the diagnosis of the search that started from it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from raccoon.core.config import Measured, RobotConfig
from raccoon.diagnose.findings.fitted_model import cause_origin, rebase_model
from raccoon.diagnose.findings.joint_numbers import BACK_EMF_CONSTANT, GYRO_EXPONENTS
from raccoon.diagnose.hypotheses.base_coordinates import MAX_BASE_STDS
from raccoon.diagnose.recordings.reference.factors import Factor, ReferenceFactors
from raccoon.diagnose.recordings.reference.gyro_rescaling import GYRO_COLUMN, GyroRescaling
from raccoon.diagnose.recordings.reference.search_start import (
    GYRO_SCALE,
    READING_CAUSES,
    TRACK_WIDTH,
    WHEEL_RADIUS,
    SearchStart,
    assumed_factor,
)
from raccoon.diagnose.reports.cause_text import explanation_sentence
from raccoon.diagnose.result import (
    MAX_UNEXPLAINED_SHARE,
    CauseResult,
    Diagnosis,
    Gain,
    ParameterResult,
    Rejected,
    Unexplained,
    Verdict,
)
from raccoon.sim.effects.parameters import SIDES, Parameters

SCALE_CAUSES = ("motor.armature_resistance", "drive.inertia", "friction.coulomb")
"""Causes beside which a K_E that is off by as much as the radius has the same effect as the radius, with
other values of these causes."""
RATIO = "times robot.toml's"
SAID_BY_REFERENCE = "The recorded reference says so."


def with_reference_findings(
    found: Diagnosis, start: SearchStart, model: Parameters | None = None
) -> Diagnosis:
    """The diagnosis of a search from `start`, relative to robot.toml: with causes that the reference
    determined, and the factors that it measured."""
    if start.reference == ReferenceFactors():
        return found
    named = dict(start.significant)
    if WHEEL_RADIUS in start.factors and not any(each.name == WHEEL_RADIUS for each in found.causes):
        named[WHEEL_RADIUS] = abs(start.factors[WHEEL_RADIUS].value - 1.0) / _radius_std(start)
    found = _relative_to_robot(found, start)
    if named and any(each.name == GYRO_COLUMN for each in found.channels):
        found = _with_reference_causes(found, start, named, model)
    elif TRACK_WIDTH in named:
        found = _with_track_cause(found, start, named[TRACK_WIDTH], model)
    others = (each for each in found.rejected if each.id not in named)
    return replace(
        found,
        rejected=(*others, *_rejected(found, start)),
        identified={**found.identified, **_identified(found, start, model)},
    )


def _relative_to_robot(found: Diagnosis, start: SearchStart) -> Diagnosis:
    """The diagnosis with the radius and the model relative to robot.toml's values."""
    factors = {id_: each.value for id_, each in start.factors.items()}
    found = replace(
        found, model=None if found.model is None else rebase_model(found.model, start.configured, factors)
    )
    if WHEEL_RADIUS not in factors:
        return found
    causes = []
    for each in found.causes:
        if each.id == WHEEL_RADIUS and each.where is None:
            number = each.parameters["factor"]
            values = {
                "factor": replace(
                    number, value=factors[WHEEL_RADIUS] * number.value, std=factors[WHEEL_RADIUS] * number.std
                )
            }  # fmt: skip
            text = explanation_sentence(each.id, each.where, values)
            each = replace(each, parameters=values, explanation=text)
            if abs(values["factor"].value - number.nominal) < MAX_BASE_STDS * values["factor"].std:
                continue  # the search undid the reference's factor: another cause is behind it
        causes.append(each)
    return replace(found, causes=tuple(causes))


def _with_reference_causes(
    found: Diagnosis, start: SearchStart, named: Mapping[str, float], model: Parameters | None
) -> Diagnosis:
    """The diagnosis with causes that the reference determined. They only scale the gyro's reading, so the
    errors without one follow from the readings with it."""
    factors = {id_: start.factors[id_] for id_ in named}
    if not found.curves:
        return found
    gyro_factor = math.prod(start.factors[id_].value ** GYRO_EXPONENTS[id_] for id_ in start.factors)
    rescaling = GyroRescaling.of_diagnosis(found)
    size_before, size_after = (
        rescaling.residual_size(1.0 / gyro_factor, before=True),
        rescaling.residual_size(1.0),
    )
    start_size = rescaling.residual_size(1.0, before=True)
    share, scale = _rescale_shares(found.unexplained.share, start_size, size_before, size_after)
    causes = [replace(each, gain=replace(each.gain, share=scale * each.gain.share)) for each in found.causes]
    for id_, factor in factors.items():
        power = GYRO_EXPONENTS[id_]
        without = rescaling.residual_size(factor.value**-power)
        possible = max(size_before, without) ** 2 - 1.0
        gain_share = float(np.clip((without**2 - size_after**2) / max(possible, 1e-6), 0.0, 1.0))
        change = rescaling.reading_change(factor.value**-power)
        prior_range = MAX_BASE_STDS * _prior_std(start.configured)
        unabsorbed = (
            change * max(1.0 - prior_range / abs(factor.value - 1.0), 0.0) / math.sqrt(len(found.channels))
        )
        assumed = assumed_factor(model, id_)
        std = _radius_std(start) if id_ == WHEEL_RADIUS else factor.std
        values = {"factor": ParameterResult(assumed * factor.value, assumed * std, "", assumed)}
        certainty = math.erf(named[id_] / math.sqrt(2.0))
        rivals = _rivals(id_, found)
        text = f"{explanation_sentence(id_, None, values)} {SAID_BY_REFERENCE}"
        probability, gain = certainty / (1.0 + len(rivals)), Gain(without, size_after, gain_share)
        causes.append(CauseResult(id_, None, 0, values, gain, probability, rivals, text, change, unabsorbed))
    causes.sort(key=lambda each: (each.is_negligible, -each.unabsorbed))
    ranked = tuple(replace(each, rank=rank) for rank, each in enumerate(causes, start=1))
    matters = any(not each.is_negligible for each in ranked)
    return replace(
        found,
        causes=ranked,
        verdict=_verdict(found, share) if matters else found.verdict,
        unexplained=Unexplained(share, found.unexplained.depends_on),
        channels=rescaling.rescaled_channels(1.0 / gyro_factor),
        curves=rescaling.rescaled_curves(1.0 / gyro_factor),
        model=_with_origins(found.model, ranked, factors),
    )


def _with_track_cause(
    found: Diagnosis, start: SearchStart, sigmas: float, model: Parameters | None
) -> Diagnosis:
    """The diagnosis with a track width that the reference determines, and without a gyro no reading does."""
    factor, assumed = start.factors[TRACK_WIDTH], assumed_factor(model, TRACK_WIDTH)
    values = {"factor": ParameterResult(assumed * factor.value, assumed * factor.std, "", assumed)}
    normalised = [each.rmse_after / each.noise_floor for each in found.channels if each.noise_floor > 0.0]
    size = float(np.sqrt(np.mean(np.square(normalised)))) if normalised else 1.0
    text = f"{explanation_sentence(TRACK_WIDTH, None, values)} {SAID_BY_REFERENCE}"
    rank, certainty = len(found.causes) + 1, math.erf(sigmas / math.sqrt(2.0))
    cause = CauseResult(TRACK_WIDTH, None, rank, values, Gain(size, size, 0.0), certainty, (), text)
    causes = (*found.causes, cause)
    verdict = _verdict(found, found.unexplained.share)
    return replace(
        found, causes=causes, verdict=verdict, model=_with_origins(found.model, causes, start.factors)
    )


def _rivals(id_: str, found: Diagnosis) -> tuple[str, ...]:
    """Causes that are indistinguishable from one that the reference determined."""
    scaled = any(each.id in SCALE_CAUSES and each.where is None for each in found.causes)
    return (BACK_EMF_CONSTANT,) if id_ == WHEEL_RADIUS and scaled else ()


def _with_origins(
    model: Parameters | None, causes: Sequence[CauseResult], factors: Mapping[str, Factor]
) -> Parameters | None:
    """The model with the origins of the effects that the reference determined."""
    if model is None:
        return None
    for each in causes:
        for key in list(model.effects):
            if each.id in factors and key[0] == each.id:
                model = model.with_origin(*key, cause_origin(each))
    return model


def _verdict(found: Diagnosis, share: float) -> Verdict:
    """The verdict of a diagnosis with a further cause that is not negligible."""
    if found.verdict is Verdict.ADEQUATE:
        return Verdict.EXPLAINED
    if found.unexplained.depends_on or share >= MAX_UNEXPLAINED_SHARE:
        return Verdict.PARTLY
    return Verdict.EXPLAINED


def _rescale_shares(share: float, original: float, before: float, after: float) -> tuple[float, float]:
    """The unexplained share, and the factor on all causes' shares, when the error before any cause grows from
    `original` to `before` by the factors of the reference. after: error with all causes."""
    reachable = 1.0 if share > 0.99 else (after**2 - share * original**2) / (1.0 - share)
    reachable = min(max(reachable, 1.0), after**2)
    possible, possible_before = max(before**2 - reachable, 1e-6), max(original**2 - reachable, 1e-6)
    remaining = 0.0 if share == 0.0 else float(np.clip((after**2 - reachable) / possible, 0.0, 1.0))
    return remaining, min(possible_before / possible, 1.0)


def _prior_std(robot: RobotConfig) -> float:
    """Combined relative standard deviation of gyro scale, track width and radius in robot.toml."""
    model = robot.model
    numbers = (model.imu.gyro_scale, model.drive.track_width, model.drive.wheel_radius)
    return math.hypot(*(each.std / each.value for each in numbers))


def _radius_std(start: SearchStart) -> float:
    """Standard deviation of the radius factor by the reference, including that of K_E in robot.toml."""
    factor, motors = start.factors[WHEEL_RADIUS], (start.configured.model.left, start.configured.model.right)
    reading = max(each.back_emf_constant.std / each.back_emf_constant.value for each in motors)
    return math.hypot(factor.std, factor.value * reading)


def _rejected(found: Diagnosis, start: SearchStart) -> list[Rejected]:
    """Causes that the reference determined not to be present, with their factor as the reason."""
    named = {each.id for each in found.causes}
    reasons = []
    for id_ in start.decided:
        if id_ in named:
            continue
        factor = start.reference.gyro if id_ == GYRO_SCALE else start.reference.track
        if factor is None:
            continue
        number = f"{factor.value:.4f} +- {factor.std:.2g} {RATIO}"
        reasons.append(Rejected(id_, f"by the reference it is {number}"))
    return reasons


def _identified(found: Diagnosis, start: SearchStart, model: Parameters | None) -> dict[str, ParameterResult]:
    """The factors by the reference. Those of the wheels' radii use the counts per turn of the causes and the
    model; if such a cause may be a radius as well, the radius over K_E is given instead."""
    reference, motors = start.reference, (start.configured.model.left, start.configured.model.right)
    factors = {"gyro scale": reference.gyro, "track width": reference.track}
    is_radius_known = all(_is_told_from_radius(found.causes, side) for side in SIDES)
    length = "radius" if is_radius_known else "radius over K_E"
    sides = []
    for side, factor, motor in zip(SIDES, (reference.left, reference.right), motors, strict=True):
        if factor is None:
            continue
        if is_radius_known:
            reading = _reading_factor(found.causes, side, motor.back_emf_constant, model)
            std = math.hypot(factor.std / factor.value, reading.std)
            factor = Factor(factor.value * reading.value, std * factor.value * reading.value)
        sides.append(factor)
    if len(sides) == len(SIDES):
        left, right = sides
        ratio = reference.wheel_ratio
        if ratio is not None and abs(ratio.value - 1.0) > MAX_BASE_STDS * ratio.std:
            factors |= {f"left wheel's {length}": left, f"right wheel's {length}": right}
        else:
            mean = 0.5 * (left.value + right.value)
            factors[f"wheel {length}"] = Factor(mean, 0.5 * (left.std + right.std))
    return {
        f"{name} by the reference": ParameterResult(each.value, each.std, RATIO, math.nan)
        for name, each in factors.items()
        if each is not None
    }


def _reading_causes(causes: Sequence[CauseResult], side: str) -> list[CauseResult]:
    """The named causes that change a wheel's counts per turn."""
    return [each for each in causes if each.id in READING_CAUSES and each.where in (None, side)]


def _is_told_from_radius(causes: Sequence[CauseResult], side: str) -> bool:
    """Whether no named cause of a wheel's counts per turn may be its radius instead."""
    rivals = (rival for each in _reading_causes(causes, side) for rival in each.confounded_with)
    return not any(rival.partition("@")[0] == WHEEL_RADIUS for rival in rivals)


def _reading_factor(
    causes: Sequence[CauseResult], side: str, k_e: Measured, model: Parameters | None
) -> Factor:
    """Factor on a wheel's counts per turn relative to robot.toml by the causes, and by the model for effects
    that are not named. Its std is relative, and that of robot.toml's K_E if no cause gives K_E."""
    named = _reading_causes(causes, side)
    factors = [each.parameters["factor"] for each in named]
    values, stds = [each.value for each in factors], [each.std / each.value for each in factors]
    ids = {each.id for each in named}
    if BACK_EMF_CONSTANT not in ids:
        stds.append(k_e.std / k_e.value)
    if model is not None:
        values += [model.value(id_, "factor", side) for id_ in READING_CAUSES if id_ not in ids]
    return Factor(math.prod(values), math.hypot(*stds))
