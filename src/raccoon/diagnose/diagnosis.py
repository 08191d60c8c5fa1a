"""From a recording to a diagnosis: the searches that are made, and which of their results is used."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.errors import TraceError
from raccoon.core.progress import report
from raccoon.diagnose.drives.disturbances import without_disturbances
from raccoon.diagnose.drives.excitation import is_driven
from raccoon.diagnose.drives.features import Features, without_empty_channels
from raccoon.diagnose.drives.holdout import naming_holdout, with_channels_of
from raccoon.diagnose.drives.log import WHEELS, Log
from raccoon.diagnose.findings.held_out import HeldOut
from raccoon.diagnose.findings.path_dependence import (
    GAPS_REASON,
    is_path_dependent,
    is_too_short,
    not_judged_for_gaps,
    restricted_to_shareable,
    shareable_causes,
)
from raccoon.diagnose.findings.separate_batteries import (
    batteries_may_differ,
    has_separate_batteries,
    with_own_batteries,
    with_resistance_not_judged,
    without_shared_resistance,
)
from raccoon.diagnose.findings.validation import validate_causes
from raccoon.diagnose.habits.habit_search import search_with_habits
from raccoon.diagnose.habits.problems import drive_problem, with_lost_changes
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.hypotheses.coordinates import Cause
from raccoon.diagnose.result import (
    SAME_ROBOT,
    Diagnosis,
    Unexplained,
    Verdict,
)
from raccoon.diagnose.rollout.dead_zone_evidence import without_ruled_out_zones
from raccoon.diagnose.rollout.firmware import Firmware
from raccoon.diagnose.rollout.log_building import build_log
from raccoon.diagnose.search_outcome import SearchOutcome, conclude, stall_faults
from raccoon.diagnose.unknown.friction_change import friction_may_have_changed
from raccoon.diagnose.unknown.probes import FRICTION_OVER_TIME
from raccoon.diagnose.unknown.sensor_probes import UNKNOWN_PREFIX
from raccoon.diagnose.unknown.step_change import change_name
from raccoon.sim.effects.parameters import Parameters

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

MAX_ERROR_OF_SAME_ROBOT = 6.0
"""Error of the better model on the held-out recording, in units of the noise, above which that is probably
another robot's, although the model improves there. Recordings of robots with one robot.toml had 2 to 4.5."""
MIN_CHANGE_STDS = 3.0
"""Size of a step change, in its standard deviations, above which it is reported. Beside the causes that are
found with it nothing may be left of it: of a robot with a rope at one wheel from 15 s on, whose friction was
then named, the same wheel had changed by 0.02 +- 0.02 % of its radius. A wheel that grew by 4 % has 48."""
NOTHING_MOVES = "the commands never change, or no wheel responds to them"


def diagnose(
    columns: Columns,
    robot: RobotConfig,
    *,
    holdout: Columns | None = None,
    more: Sequence[Columns] = (),
    causes: Sequence[Cause] | None = None,
    model: Parameters | None = None,
    firmware: Firmware | None = None,
) -> Diagnosis:
    """Determine what the simulation of `robot` gets wrong in a recording, and why.

    columns: the recording by names of the CSV format, NaN where a sensor had nothing new. robot: ports and
    nominal model; its standard deviations are how far each number may be off without being a cause. holdout:
    another recording of the same robot, for validation. more: further recordings of the same robot in the
    same state, which are fitted with the first. causes: hypotheses to consider, by default the whole
    catalogue of drives; `own` describes how to add your own. model: a simulation to start from, with effects
    that are already known, instead of the nominal one. firmware: the controller's, if it is known; otherwise
    its behaviour is estimated.

    Raises TraceError for a recording that cannot be used: empty, too short, time that does not advance,
    columns in wrong units, no commands, another robot's ports, rows in the opposite order or of two drives;
    HoldoutError if it is the held-out recording that cannot be used, or that lacks a channel of this one.
    """
    from threadpoolctl import threadpool_limits  # type: ignore[import-untyped]

    begin = time.perf_counter()
    log = build_log([columns, *more], robot, firmware)
    # The matrices are small: synchronising threads would cost more than the computation.
    with threadpool_limits(1):
        if not is_driven(log):
            return _not_identifiable(log, begin, _other_motors_question(columns, robot))
        tried = without_ruled_out_zones(drive_causes() if causes is None else causes, log)
        tried = shareable_causes(tried) if log.runs else tried
        other = None
        if holdout is not None:
            with naming_holdout():
                other = with_channels_of(log, build_log([holdout], robot, firmware))
                if not is_driven(other):
                    raise TraceError(f"{NOTHING_MOVES}: it validates nothing; name a recording of a drive")
        return Diagnoser(robot, tried, model, firmware, begin).diagnose(log, other)


@dataclass(frozen=True, slots=True)
class Diagnoser:
    """Diagnoses a log by one search, and by further ones if its outcome requires them. begin: start of the
    diagnosis, s."""

    robot: RobotConfig
    causes: Sequence[Cause]
    model: Parameters | None
    firmware: Firmware | None
    begin: float

    def diagnose(self, log: Log, unseen: Log | None) -> Diagnosis:
        """The diagnosis. If rows are lost and the causes found depend on the path, it is that of the longest
        part without a gap."""
        found, log = self._without_disturbances(log, unseen)
        if log.runs:
            return restricted_to_shareable(found)
        if not (log.lost and is_path_dependent(found)):
            return found
        part = without_empty_channels(log.longest_part())
        if is_too_short(part.seconds) or not is_driven(part):
            return not_judged_for_gaps(found, part.seconds)
        judged = f"only {part.time[0]:.1f} to {part.time[-1]:.1f} s are used, all angles counted from there"
        part = replace(part, notes=(*part.notes, f"{GAPS_REASON}: {judged}"))
        other = None if unseen is None else with_channels_of(part, unseen.longest_part())
        return self._without_disturbances(part, other)[0]

    def _without_disturbances(self, log: Log, unseen: Log | None) -> tuple[Diagnosis, Log]:
        """The diagnosis without momentary disturbances, and the log without them."""
        found = self._with_step_change(log, unseen)
        undisturbed = without_disturbances(log, found.disturbances)
        if undisturbed is log:
            return found.diagnosis, log
        report("searching again without momentary disturbances")
        again = self._with_step_change(undisturbed, unseen).diagnosis
        if is_path_dependent(again) and is_too_short(undisturbed.longest_part().seconds):
            return found.diagnosis, log
        return again, undisturbed

    def _with_step_change(self, log: Log, unseen: Log | None) -> SearchOutcome:
        """The outcome with a step change at one moment if there was one: a gyro zero that jumps is no drift,
        and a wheel that lost its tyre is not eccentric."""
        first = self._with_friction_change(log, unseen)
        if first.change is None:
            return first
        report(f"searching again with a change allowed at {first.change.at:.1f} s")
        again = self._with_friction_change(replace(log, change=first.change), unseen)
        name = change_name(first.change).removeprefix(UNKNOWN_PREFIX)
        sizes = [each.size for each in again.diagnosis.shapes if each.depends_on == name]
        certain = any(each.value > MIN_CHANGE_STDS * each.std for each in sizes)
        return again if certain else first

    def _with_friction_change(self, log: Log, unseen: Log | None) -> SearchOutcome:
        """The outcome, also tested with friction over time if that is possible: a load that was taken."""
        first = self._with_separate_batteries(log, unseen)
        if not friction_may_have_changed(first.diagnosis, first.is_heating):
            return first
        report("asking whether friction changed in the drive")
        again = self.search_once(replace(log, friction_may_change=True), unseen)
        return again if FRICTION_OVER_TIME in again.diagnosis.unexplained.depends_on else first

    def _with_separate_batteries(self, log: Log, unseen: Log | None) -> SearchOutcome:
        """The outcome, also tested with one battery per recording if several recordings may not share one."""
        first = self.search_once(log, unseen)
        if not (log.runs and batteries_may_differ(first.diagnosis)):
            return first
        report("asking whether the recordings share a battery")
        again = replace(self, causes=without_shared_resistance(self.causes)).search_once(
            with_own_batteries(log), unseen
        )
        if not has_separate_batteries(again.diagnosis):
            return first
        return replace(again, diagnosis=with_resistance_not_judged(again.diagnosis))

    def search_once(self, log: Log, unseen: Log | None) -> SearchOutcome:
        """The outcome of one search, validated on the end of the log or on the unseen one."""
        robot, causes, model = self.robot, self.causes, self.model
        search, habits, log = search_with_habits(log, robot, causes, model, self.firmware)
        other = None
        if unseen is not None:
            unseen = with_lost_changes(unseen, robot, causes, habits, model, search.fit.point)
            other = drive_problem(unseen, robot, causes, habits, model)
            fitted = search.problem  # its noise is that of bins of this width
            bins = Features.cached(unseen, fitted.features.width)
            other = replace(other, neutral=fitted.neutral, base=fitted.base, features=bins)
        search, judged = validate_causes(search, other)
        found = conclude(log, search, judged, habits, self.begin)
        if other is None:
            return found
        notes = (*found.diagnosis.notes, *_other_robot_notes(found.diagnosis, judged))
        return replace(found, diagnosis=replace(found.diagnosis, notes=notes))


def _other_robot_notes(found: Diagnosis, judged: HeldOut) -> tuple[str, ...]:
    """Note that the model found does not improve another recording, or leaves a large error on it, or that
    the simulation is wrong there although nothing was found in this one."""
    off = f"is off by {judged.size_after:.2f} times the noise"
    if found.causes and (
        judged.size_after >= judged.size_before or judged.size_after > MAX_ERROR_OF_SAME_ROBOT
    ):
        off = f"the better model {off}, and robot.toml's by {judged.size_before:.2f}"
    elif judged.is_model_wrong and not found.causes and not found.unexplained.depends_on:
        off = f"the simulation {off}, and nothing was found in this one"
    else:
        return ()
    return (f"on the other recording {off}: {SAME_ROBOT}",)


def _other_motors_question(columns: Columns, robot: RobotConfig) -> str:
    """Motors that are no wheels in robot.toml and were driven while the wheels were not, as a question."""
    wheels = [f"motor.{port}.duty" for port in (robot.drive.left, robot.drive.right)]
    duties = {name: each[np.isfinite(each)] for name, each in columns.items() if name.endswith(".duty")}
    changes = [name for name, each in duties.items() if len(each) > 0 and np.ptp(each) > 0.0]
    if not changes or set(changes) & set(wheels):
        return ""
    do = "changes" if len(changes) == 1 else "change"
    return f"; {' and '.join(changes)} {do}: is [drive] in robot.toml this robot's?"


def _not_identifiable(log: Log, begin: float, instead: str) -> Diagnosis:
    note = f"{NOTHING_MOVES}: drive, turn and stop while recording{instead}"
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
        sensor_faults=stall_faults(log),
    )
