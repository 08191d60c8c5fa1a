"""From a recording to a diagnosis: the whole way in one place."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.answers import check_answers, check_signs
from raccoon.diagnose.drives.held import of_free_driving, with_free_driving
from raccoon.diagnose.drives.loads import loads_told, with_loads
from raccoon.diagnose.drives.log import WHEELS, Log, log_from_columns
from raccoon.diagnose.drives.order import check_order
from raccoon.diagnose.drives.quality import check_units, driven_freely, moves
from raccoon.diagnose.drives.standing import with_what_turned
from raccoon.diagnose.drives.stops import with_stops
from raccoon.diagnose.drives.unseen import said_of_holdout, with_channels_of
from raccoon.diagnose.findings.bent import bent_notes
from raccoon.diagnose.findings.extend import extended
from raccoon.diagnose.findings.gain import HeldOut
from raccoon.diagnose.findings.known_together import unmeasured_note
from raccoon.diagnose.findings.naming import named_causes, rejections, suggestions
from raccoon.diagnose.findings.proving import proven
from raccoon.diagnose.findings.spread import Spread
from raccoon.diagnose.fit.noise import whiteness
from raccoon.diagnose.fit.scan import play_of
from raccoon.diagnose.habits.controller import drive_problem, with_lost_changes
from raccoon.diagnose.habits.notes import notes_of
from raccoon.diagnose.habits.searching import searched
from raccoon.diagnose.hypotheses.candidates import drive_causes
from raccoon.diagnose.hypotheses.coordinates import Cause
from raccoon.diagnose.result import (
    LARGE_REST,
    STOOD,
    ChannelResult,
    Curve,
    Diagnosis,
    Rejected,
    SensorFault,
    Unexplained,
    Verdict,
)
from raccoon.diagnose.rollout.firmware import Firmware
from raccoon.diagnose.rollout.silence import asked_for
from raccoon.diagnose.rollout.variants import Habits
from raccoon.diagnose.select.outlook import Search
from raccoon.diagnose.unknown.bursts import DEPENDS_ON, bursting
from raccoon.diagnose.unknown.probes import PREFIX
from raccoon.diagnose.unknown.shapes import shapes_of
from raccoon.sim.effects.parameters import Parameters

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

LONG_PART = 12.0
"""S without a gap in which causes can be told apart."""
OVER_WAYS = ("drive.wheel_eccentricity", "drive.slope")
UNKNOWN_OVER_WAYS = ("wheel angle", "position", "heading")
"""Effects, and what unknown ones may depend on, that need the wheels' angles or the robot's place. With a gap
of 1 s in 40 an eccentric wheel became another K_E, track width and inertia beside itself."""
RESISTANCE = ("battery.internal_resistance", None, "resistance")
STRANGE = 6.0
"""Times the noise that a better model is off by on the recording of another robot, although it helps there.
Robots of one robot.toml were off by 2 to 4.5."""
SAME_ROBOT = "is it the same robot, with the same battery and load?"
ADDS_UP = "the gaps lose where the wheels and the robot point, on which something here depends"


def diagnose(
    columns: Columns,
    robot: RobotConfig,
    *,
    holdout: Columns | None = None,
    causes: Sequence[Cause] | None = None,
    model: Parameters | None = None,
    firmware: Firmware | None = None,
) -> Diagnosis:
    """Say what the simulation of `robot` gets wrong in a recording, and why.

    columns: the recording by names of the CSV format, NaN where a sensor had nothing new. robot: ports and
    nominal model; its standard deviations are how far each number may be off without being a cause. holdout:
    another recording of the same robot to judge on. causes: hypotheses to consider, by default the whole
    catalogue of drives; `own` says how to add your own. model: a simulation to start from, with effects that
    are already known, instead of the nominal one. firmware: of the controller, where that is known; what it
    does is found out otherwise.

    Raises TraceError for a recording that cannot be used: empty, too short, time that does not advance,
    columns in wrong units, no commands, another robot's ports, rows in the opposite order or of two drives;
    HoldoutError where it is the other recording that cannot be used, or lacks a channel of this one.
    """
    from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

    begin = time.perf_counter()
    log = _log(columns, robot, firmware)
    with threadpool_limits(
        1
    ):  # the matrices are small: threads that wait for each other cost more than they do
        if not moves(log):
            return _nothing_to_see(log, begin)
        tried = asked_for(drive_causes() if causes is None else causes, log)

        def judged(part: Log, other: Log | None) -> Diagnosis:
            return _searched(part, other, robot, tried, model, firmware, begin)

        other = None
        if holdout is not None:
            with said_of_holdout():
                other = with_channels_of(log, _log(holdout, robot, firmware))
        found = judged(log, other)
        if not (log.lost and _adds_up(found)):
            return found
        part, unseen = log.longest_part(), None if other is None else other.longest_part()
        if part.seconds < LONG_PART or not moves(part):
            return _lost_count(found, part.seconds)
        told = (
            f"{ADDS_UP}: only {part.time[0]:.1f} to {part.time[-1]:.1f} s are judged, all angles from there"
        )
        return judged(replace(part, notes=(*log.notes, told)), unseen)


def _log(columns: Columns, robot: RobotConfig, firmware: Firmware | None) -> Log:
    log = log_from_columns(columns, robot)
    check_signs(log)
    check_units(driven_freely(log, robot), robot, native=firmware is not None and firmware.units)
    log = with_free_driving(log, robot)
    free = with_stops(of_free_driving(with_what_turned(log, robot)))
    check_order(free)
    check_answers(free)
    if firmware is not None:
        free = of_free_driving(firmware.understood(log, columns, robot))
        if firmware.chain.battery_held:  # such a reading is low without a load
            return free
    return with_loads(free, columns, robot)


def _searched(
    log: Log,
    unseen: Log | None,
    robot: RobotConfig,
    causes: Sequence[Cause],
    model: Parameters | None,
    firmware: Firmware | None,
    begin: float,
) -> Diagnosis:
    search, habits, log = searched(log, robot, causes, model, firmware)
    other = None
    if unseen is not None:
        unseen = with_lost_changes(unseen, robot, causes, habits, model, search.fit.point)
        other = drive_problem(unseen, robot, causes, habits, model)
        other = replace(other, neutral=search.problem.neutral)
    search, judged = proven(search, other)
    found = _diagnosis(log, search, judged, habits, begin)
    if other is None:
        return found
    return replace(found, notes=(*found.notes, *_not_the_same(found, judged)))


def _adds_up(found: Diagnosis) -> bool:
    """Whether what was found depends on the angle of a wheel or on where the robot is: both add up all that
    was driven, also in a gap."""
    named = any(each.id in OVER_WAYS for each in found.causes)
    return named or any(each.startswith(UNKNOWN_OVER_WAYS) for each in found.unexplained.depends_on)


def _lost_count(found: Diagnosis, seconds: float) -> Diagnosis:
    """A diagnosis without causes, where each may be what a gap made of another."""
    reason = f"not judged: {ADDS_UP}, and the longest part without one has {seconds:.1f} s of {LONG_PART:g} s"
    return replace(
        found,
        verdict=Verdict.NOT_IDENTIFIABLE,
        causes=(),
        rejected=(*found.rejected, *(Rejected(each.name, reason) for each in found.causes)),
        unexplained=replace(found.unexplained, depends_on=()),
        model=None,
        notes=(*found.notes, reason),
        shapes=(),
    )


def _not_the_same(found: Diagnosis, judged: HeldOut) -> tuple[str, ...]:
    """That another recording is no better for what was found in this one, or far off with it, or without
    that anything was."""
    off = f"is off by {judged.size_after:.2f} times the noise"
    if found.causes and (judged.size_after >= judged.size_before or judged.size_after > STRANGE):
        off = f"the better model {off}, and robot.toml's by {judged.size_before:.2f}"
    elif judged.is_far and not found.causes and not found.unexplained.depends_on:
        off = f"the simulation {off}, and nothing was found in this one"
    else:
        return ()
    return (f"on the other recording {off}: {SAME_ROBOT}",)


def _nothing_to_see(log: Log, begin: float) -> Diagnosis:
    note = "the commands never change, or no wheel answers them: drive, turn and stop while recording"
    if not any(each.role in WHEELS for each in log.channels):
        names = " and ".join(name for name in log.missing if name.endswith(".bemf"))
        note = f"no wheel is measured: record the back-EMF of both motors ({names})"
    return Diagnosis(
        Verdict.NOT_IDENTIFIABLE,
        (),
        (),
        (),
        Unexplained(0.0),
        (note,),
        time.perf_counter() - begin,
        None,
        (*log.notes, note),
        sensor_faults=_faults(log),
    )


def _faults(log: Log) -> tuple[SensorFault, ...]:
    return tuple(SensorFault(column, STOOD, text) for column, text in log.stood)


def _diagnosis(log: Log, search: Search, judged: HeldOut, habits: Habits, begin: float) -> Diagnosis:
    spread = Spread.of(search)
    causes = named_causes(search, judged, spread)
    depends_on = tuple(each.removeprefix(PREFIX) for each in search.unknown)
    features, rest = search.problem.features, search.linear.residual
    regimes, play = search.whitener.noise.regimes, play_of(search.fit.point)
    bursts = bursting(features.roles, features.measured, rest, regimes, play=bool(play))
    depends_on += (DEPENDS_ON,) if bursts else ()
    left = judged.left if judged.is_far or depends_on else 0.0  # what chance makes is no part of it
    verdict = _verdict(not all(each.little for each in causes), bool(depends_on), left, judged.is_far)
    resistance = search.problem.settings(search.fit.point)[RESISTANCE]
    white = search.whitener(search.linear.residual[None])[0].reshape(search.linear.residual.shape)
    return Diagnosis(
        verdict,
        _channels(log, judged, whiteness(white)),
        causes,
        rejections(search, log),
        Unexplained(left, depends_on),
        suggestions(search, causes, log),
        time.perf_counter() - begin,
        extended(search.problem, spread, causes, habits.chain),
        (
            *log.notes,
            *loads_told(log, resistance),
            *bursts,
            *notes_of(habits, causes, spread),
            *bent_notes(search, unknown=bool(depends_on) or verdict is Verdict.UNKNOWN),
            *unmeasured_note(search),
            *_not_in_model(search),
        ),
        sensor_faults=_faults(log),
        curves=_curves(log, judged),
        shapes=shapes_of(search),
    )


def _not_in_model(search: Search) -> tuple[str, ...]:
    """What the simulator cannot be told in a model.toml."""
    own = [name for name in search.fit.point.active if search.problem.causes[name].own is not None]
    return tuple(f"{name} is Python of yours: a model.toml does not hold it" for name in own)


def _curves(log: Log, judged: HeldOut) -> tuple[Curve, ...]:
    """Every channel on data that was not fitted, for pictures."""
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
    """causes: whether any that matters was named. left: as `HeldOut` has it, of what is beyond chance."""
    if unknown:
        return Verdict.PARTLY if causes else Verdict.UNKNOWN
    if not causes:
        return Verdict.UNKNOWN if is_far else Verdict.ADEQUATE
    return Verdict.EXPLAINED if left < LARGE_REST else Verdict.PARTLY


def _channels(log: Log, judged: HeldOut, p_values: Array) -> tuple[ChannelResult, ...]:
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
