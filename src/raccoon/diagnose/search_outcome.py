"""The outcome of a search: the diagnosis that a team reads, and the reasons for another search."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.battery_loads import load_notes
from raccoon.diagnose.drives.counting import counting_error
from raccoon.diagnose.drives.disturbances import disturbance_note
from raccoon.diagnose.drives.log import Log, StepChange
from raccoon.diagnose.drives.time_column import rows_drift
from raccoon.diagnose.findings.cause_results import make_cause_results
from raccoon.diagnose.findings.deviations import deviation_notes
from raccoon.diagnose.findings.fitted_model import make_fitted_model
from raccoon.diagnose.findings.held_out import HeldOut
from raccoon.diagnose.findings.joint_numbers import unmeasured_robot_notes
from raccoon.diagnose.findings.rejections import effect_visibility, explain_rejections
from raccoon.diagnose.findings.separate_batteries import separate_battery_notes
from raccoon.diagnose.findings.suggestions import suggest_manoeuvres
from raccoon.diagnose.findings.uncertainty import FitUncertainty
from raccoon.diagnose.fit.backlash_scan import active_backlash
from raccoon.diagnose.fit.noise_model import whiteness_p_values
from raccoon.diagnose.habits.notes import habit_notes, with_habit_uncertainty
from raccoon.diagnose.habits.read_times import without_read_times
from raccoon.diagnose.hypotheses.per_recording import BATTERY_RESISTANCE
from raccoon.diagnose.reports.numbers import parameter_text
from raccoon.diagnose.result import (
    MAX_UNEXPLAINED_SHARE,
    STOOD,
    ChannelResult,
    Curve,
    Diagnosis,
    SensorFault,
    Shape,
    Unexplained,
    Verdict,
)
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.diagnose.select.state import Search
from raccoon.diagnose.unknown.bursts import DEPENDS_ON, Bursts, find_bursts
from raccoon.diagnose.unknown.friction_change import is_clearly_heating
from raccoon.diagnose.unknown.one_sided_error import find_one_sided_error
from raccoon.diagnose.unknown.probes import SPEED, find_change
from raccoon.diagnose.unknown.sensor_probes import UNKNOWN_PREFIX
from raccoon.diagnose.unknown.shapes import fit_shapes, is_small_friction
from raccoon.trace.recording import median_step

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class SearchOutcome:
    """The diagnosis from one search, and the reasons for another. disturbances: times (s) of momentary
    disturbances, which are no fault of the robot. change: a step change at some moment. is_heating: whether
    motors certainly get hot, and no friction changed."""

    diagnosis: Diagnosis
    disturbances: tuple[float, ...]
    change: StepChange | None = None
    is_heating: Callable[[], bool] = lambda: False


def stall_faults(log: Log) -> tuple[SensorFault, ...]:
    """The wheels that stood while they were driven, as sensor faults."""
    return tuple(SensorFault(column, STOOD, text) for column, text in log.stalls)


def conclude(log: Log, search: Search, judged: HeldOut, habits: Habits, begin: float) -> SearchOutcome:
    """The outcome of a search, validated on data that it did not fit. begin: start of the diagnosis, s."""
    uncertainty = FitUncertainty.of(search)
    causes = make_cause_results(search, judged, uncertainty)
    causes = with_habit_uncertainty(causes, habits, rows_drift(log.time))
    seen = effect_visibility(search, log)
    causes, rejected = without_read_times(causes, explain_rejections(search, log, seen), habits)
    features, rest = search.problem.features, search.linear.residual
    regimes, play = search.whitener.noise.regimes, active_backlash(search.fit.point)
    bursts = find_bursts(
        features.roles,
        features.measured,
        rest,
        features.time,
        regimes,
        play=bool(play),
        age_std=_age_std(log, habits),
    )
    depends_on, unknown_notes, shapes = _unknown_effects(search, log, bursts)
    left = judged.left if judged.is_model_wrong or depends_on else 0.0  # 0 if it may be chance
    verdict = _verdict(
        not all(each.is_negligible for each in causes), bool(depends_on), left, judged.is_model_wrong
    )
    settings = search.problem.settings(search.fit.point)
    white = search.whitener(search.linear.residual[None])[0].reshape(search.linear.residual.shape)
    diagnosis = Diagnosis(
        verdict,
        _channel_results(log, judged, whiteness_p_values(white)),
        causes,
        rejected,
        Unexplained(left, depends_on),
        suggest_manoeuvres(search, causes, log, seen),
        time.perf_counter() - begin,
        make_fitted_model(search.problem, uncertainty, causes, habits.chain),
        (
            *log.notes,
            *separate_battery_notes(settings, log),
            *load_notes(log, settings[BATTERY_RESISTANCE]),
            *unknown_notes,
            *((disturbance_note(bursts.moments),) if bursts.moments else ()),
            *habit_notes(habits, causes, uncertainty),
            *deviation_notes(search, unknown=bool(depends_on) or verdict is Verdict.UNKNOWN),
            *unmeasured_robot_notes(search),
            *_own_effect_notes(search),
        ),
        sensor_faults=stall_faults(log),
        curves=_held_out_curves(log, judged),
        shapes=shapes,
    )
    change = None if log.runs else find_change(search.problem, search.linear)
    return SearchOutcome(diagnosis, bursts.moments, change, partial(is_clearly_heating, search))


def _age_std(log: Log, habits: Habits) -> float:
    """Standard deviation in s of the time from a command to a gyro's sample, which a row does not tell: the
    sample was taken anywhere in the row, and a controller with its own clock applies the command anywhere in
    a cycle."""
    cycle = habits.chain.cycle if habits.chain.free_running else 0.0
    return math.hypot(median_step(log.time), cycle) / math.sqrt(12.0)


def _unknown_effects(
    search: Search, log: Log, bursts: Bursts
) -> tuple[tuple[str, ...], tuple[str, ...], tuple[Shape, ...]]:
    """Quantities on which the unexplained error depends, notes on those of which no curve is drawn, and the
    curves. Friction over the speed that varies too little to matter is only noted."""
    fitted, coulomb = fit_shapes(search), search.problem.robot.model.friction.coulomb.value
    shapes = tuple(each for each in fitted if not is_small_friction(each, coulomb))
    notes = tuple(_small_friction_note(each, coulomb) for each in fitted if is_small_friction(each, coulomb))
    over = tuple(each.removeprefix(UNKNOWN_PREFIX) for each in search.unknown)
    over = tuple(each for each in over if not (notes and each == SPEED))
    if bursts.told:
        return (*over, DEPENDS_ON), (*notes, *bursts.told), shapes
    features = search.problem.features
    counting = [counting_error(each.values) for each in log.channels]
    residual = search.linear.residual
    alone = find_one_sided_error(features.roles, features.measured, residual, features.event, counting)
    if over or alone is None:
        return over, notes, shapes
    wheel, said = alone
    return (wheel,), (*notes, said), shapes


def _small_friction_note(shape: Shape, coulomb: float) -> str:
    """Note on friction that varies over the speed by too little to matter."""
    share = f"{100.0 * shape.size.value / coulomb:.1f} % of robot.toml's dry friction"
    varies = f"{shape.quantity} varies by {parameter_text(shape.size)} over the speed"
    return f"{varies}, which is {share}: too little to matter"


def _own_effect_notes(search: Search) -> tuple[str, ...]:
    """Notes on named own effects, which a model.toml cannot contain."""
    own = [name for name in search.fit.point.active if search.problem.causes[name].own is not None]
    return tuple(f"{name} is your own Python: a model.toml cannot contain it" for name in own)


def _held_out_curves(log: Log, judged: HeldOut) -> tuple[Curve, ...]:
    """Every channel on the held-out data, for plots."""
    measured, (before, after) = judged.measured, judged.residual
    return tuple(
        Curve(
            each.name,
            each.unit,
            judged.time,
            measured[:, index],
            (measured - before)[:, index],
            (measured - after)[:, index],
        )
        for index, each in enumerate(log.channels)
    )


def _verdict(causes: bool, unknown: bool, left: float, is_far: bool) -> Verdict:
    """causes: whether any that matters was named. left: see `HeldOut.left`, 0 if it may be chance."""
    if unknown:
        return Verdict.PARTLY if causes else Verdict.UNKNOWN
    if not causes:
        return Verdict.UNKNOWN if is_far else Verdict.ADEQUATE
    return Verdict.EXPLAINED if left < MAX_UNEXPLAINED_SHARE else Verdict.PARTLY


def _channel_results(log: Log, judged: HeldOut, p_values: Array) -> tuple[ChannelResult, ...]:
    return tuple(
        ChannelResult(
            each.name,
            each.unit,
            float(judged.before[index]),
            float(judged.after[index]),
            float(judged.floor[index]),
            float(p_values[index]),
        )
        for index, each in enumerate(log.channels)
    )
