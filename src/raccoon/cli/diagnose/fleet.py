"""`raccoon diagnose` for several recordings: pooled geometry, or a fleet side by side."""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from raccoon.cli.crew import open_crew
from raccoon.cli.diagnose.job import Answer, Job, diagnose_or_reason, make_job, resolve_robot
from raccoon.cli.wrapping import print_wrapped

if TYPE_CHECKING:
    from raccoon.core.config import RobotConfig
    from raccoon.diagnose.fleet.common_model import CrossCheck
    from raccoon.diagnose.fleet.summary import Fleet
    from raccoon.diagnose.result import Diagnosis
    from raccoon.trace.recording import Column

    Columns = Mapping[str, Column]


INTERRUPTED = 130
"""Exit status after Ctrl-C."""


def _diagnose_number(jobs: Sequence[Job], number: int) -> Answer | str:
    return diagnose_or_reason(jobs[number])


def _lost_worker_reason(jobs: Sequence[Job], number: int) -> Answer | str:
    return f"{jobs[number].path}: its worker died"


def diagnose_pooled_geometry(args: argparse.Namespace, paths: Sequence[Path]) -> Diagnosis | None:
    """One diagnosis of several runs if all are geometry recordings of one robot; None if they are not, or if
    fewer than two are usable. Runs that cannot be used are left out, and the notes name them.

    Raises ConfigError for a bad `--robot`, TraceError for a bad `--holdout`.
    """
    from raccoon.cli.diagnose.files import short_names
    from raccoon.core.config import load_robot
    from raccoon.core.errors import RaccoonError, TraceError
    from raccoon.diagnose.recordings.diagnosis import NO_CAUSES
    from raccoon.diagnose.recordings.drive import NO_MODEL
    from raccoon.diagnose.recordings.geometry.diagnosis import diagnose_geometry, prepare_run
    from raccoon.diagnose.recordings.kind import Kind, kind_of
    from raccoon.trace.loading import load_run

    if args.truth_free:
        return None
    if args.robot is not None:
        load_robot(args.robot)  # an error in it concerns all recordings
    runs, robots, files, notes = [], [], set(), []
    seen: dict[str, str] = {}
    for path, name in zip(paths, short_names(paths), strict=True):
        try:
            each = load_run(path)
            own, file, _ = resolve_robot(each, args.robot)
            kind = kind_of(each.recording.columns, own)
            if kind is Kind.GEOMETRY:
                prepare_run(each.recording.columns, own, each.recording.device)
                before = seen.setdefault(each.recording.fingerprint(), name)
                if before != name:
                    raise TraceError(DUPLICATE_REASON.format(before))
        except (RaccoonError, OSError) as error:
            notes.append(f"{name} is left out: {str(error).removeprefix(f'{path}: ')}")
            continue
        if kind is not Kind.GEOMETRY:
            return None
        runs.append(each)
        robots.append(own)
        files.add(file)
    if len(files) > 1 or len(runs) < 2:  # several robots have no common track width
        return None
    robot = robots[0]
    if any((each.drive, each.motors) != (robot.drive, robot.motors) for each in robots):
        return None  # their ticks differ
    columns = [each.recording.columns for each in runs]
    others = [_load_geometry_holdout(path, columns, robot) for path in args.holdout]
    found = diagnose_geometry(columns, robot, holdout=others, device=runs[0].recording.device)
    unused = ((args.model, NO_MODEL), (args.causes, NO_CAUSES))
    notes += [note for given, note in unused if given is not None]
    return replace(found, notes=(*notes, *found.notes))


def _load_geometry_holdout(path: Path, fitted: Sequence[Columns], robot: RobotConfig) -> Columns:
    """Load a held-out recording for pooled runs. Raises TraceError if it is of another kind or cannot be
    used."""
    from raccoon.core.errors import CalibrationError, TraceError
    from raccoon.diagnose.recordings.geometry.diagnosis import prepare_run
    from raccoon.diagnose.recordings.holdout_check import check_holdout
    from raccoon.diagnose.recordings.kind import Kind, kind_of
    from raccoon.trace.loading import load_run

    other = load_run(path).recording
    try:
        for each in fitted:
            check_holdout(each, other.columns, Kind.GEOMETRY, kind_of(other.columns, robot))
        prepare_run(other.columns, robot, other.device)
    except (CalibrationError, TraceError) as error:
        raise TraceError(f"--holdout {path}: {error}") from None
    return other.columns


def run_fleet(args: argparse.Namespace, paths: Sequence[Path]) -> int:
    """Diagnose several recordings and print a line for each, then what they have in common and what changed
    between them.

    Returns exit status 0, 2 if there is no diagnosis at all, or INTERRUPTED.
    """
    from raccoon.cli.diagnose.common_model import make_common_model, save_common_model
    from raccoon.cli.diagnose.files import robot_names, short_names
    from raccoon.cli.diagnose.robot_toml_changes import with_robot_toml_notes
    from raccoon.diagnose.fleet.summary import fleet_of
    from raccoon.diagnose.reports.fleet_text import fleet_report

    jobs = {name: make_job(args, path) for name, path in zip(short_names(paths), paths, strict=True)}
    work = JobRunner(args)
    found = dict(zip(jobs, work(list(jobs.values())), strict=True))
    said = {name: (each.robot, each.file) for name, each in found.items() if isinstance(each, Answer)}
    called = dict(zip(said, robot_names([*said.values()]), strict=True))
    found = _without_other_robots(_without_duplicates(found, called), called)
    answers = {name: each for name, each in found.items() if isinstance(each, Answer)}
    if args.model is None:
        answers = with_robot_toml_notes(answers, called)
    failed = {
        name: each.removeprefix(f"{path}: ")
        for (name, each), path in zip(found.items(), paths, strict=True)
        if isinstance(each, str)
    }
    if work.stopped and not answers:
        raise KeyboardInterrupt
    fleet = fleet_of({name: each.diagnosis for name, each in answers.items()}, called)
    common = None
    if args.save_model is not None and answers:
        common = make_common_model(fleet, jobs, work)
    seen = {} if common is None else common.foreseen
    try:  # files first, as for one recording
        if answers:
            _save(args, fleet, seen, failed)
        if common is not None and common.model is not None:
            save_common_model(args.save_model, common.model, fleet)
    finally:
        for name, reason in failed.items():
            print(f"{name}: no diagnosis: {reason}")
        if answers:
            print_wrapped(fleet_report(fleet, seen))
    if common is not None and common.model is None:
        print(f"{args.save_model}: not written: {common.reason}")
    if work.stopped:
        return INTERRUPTED
    return 0 if answers else 2


DUPLICATE_REASON = "its samples are those of {}, and are used once"


def _without_duplicates(
    found: Mapping[str, Answer | str], called: Mapping[str, str]
) -> dict[str, Answer | str]:
    """The answers, in which the later of two identical recordings of a robot (a copy, or another format) is
    replaced by the reason why it is left out: it would make the results seem more certain than they are.

    called: each recording's robot. A trace contains its robot; a CSV made from it takes the one from a
    robot.toml beside it. If only the files name the robots, as in a fleet from elsewhere, the same samples
    are of one robot.
    """
    once: dict[str, Answer | str] = {}
    first: dict[tuple[str, str], str] = {}
    for name, each in found.items():
        before = name
        if isinstance(each, Answer):
            whose = [called[name], *([""] if each.file is None else [])]
            before = next((first[one, each.samples] for one in whose if (one, each.samples) in first), name)
            first |= {(one, each.samples): before for one in whose}
        once[name] = each if before == name else DUPLICATE_REASON.format(before)
    return once


def _without_other_robots(
    found: Mapping[str, Answer | str], called: Mapping[str, str]
) -> dict[str, Answer | str]:
    """The answers, in which recordings of another robot are replaced by the reason why they are left out:
    they would hide what changed, and would be part of the common model. called: each recording's robot."""
    from raccoon.diagnose.fleet.other_robots import recordings_of_others

    results = {name: each.diagnosis for name, each in found.items() if isinstance(each, Answer)}
    others = recordings_of_others(results, called)
    return {
        name: f"{others[name]}: diagnose it with that robot's robot.toml" if name in others else each
        for name, each in found.items()
    }


def _save(
    args: argparse.Namespace, fleet: Fleet, seen: Mapping[str, CrossCheck], failed: Mapping[str, str]
) -> None:
    from raccoon.core.files import write_atomically

    if args.json is not None:
        table = {**fleet.to_dict(), "failed": failed}
        if seen:
            table["foreseen"] = {name: asdict(each) for name, each in seen.items()}
        write_atomically(args.json, json.dumps(_finite(table), indent=1, allow_nan=False) + "\n")
    if args.html is not None:
        from raccoon.diagnose.reports.html_fleet import save_fleet_html

        save_fleet_html(fleet, args.html, failed, seen)


class JobRunner:
    """Diagnoses jobs, on several workers if requested. stopped: whether Ctrl-C ended the work; the recordings
    finished by then are still reported."""

    def __init__(self, args: argparse.Namespace) -> None:
        self._args = args
        self.stopped = False

    def __call__(self, jobs: list[Job]) -> list[Answer | str]:
        """The answers, or the reasons why there is none, in the order of the jobs."""
        done: dict[int, Answer | str] = {}
        try:
            if not self.stopped:  # the cross-check takes as long again
                self._run(jobs, done)
        except KeyboardInterrupt:
            self.stopped = True
            print("\ninterrupted: the report has only the finished recordings", file=sys.stderr)
        return [done.get(number, "interrupted before it was done") for number in range(len(jobs))]

    def _run(self, jobs: list[Job], done: dict[int, Answer | str]) -> None:
        progress = Progress(len(jobs))
        progress.show(())
        if self._args.workers == 1 and self._args.executor == "processes":
            for number, job in enumerate(jobs):
                done[number] = diagnose_or_reason(job)
                progress.show(done.values())
            return
        from raccoon.sweep.execute import run_all

        with open_crew(self._args) as crew:
            for number, each in run_all(
                partial(_diagnose_number, jobs), range(len(jobs)), crew, partial(_lost_worker_reason, jobs)
            ):
                done[number] = each
                progress.show(done.values())


class Progress:
    """Progress on standard error: a line updated after each recording if that is a terminal, otherwise one
    line per tenth of them."""

    def __init__(self, total: int) -> None:
        self._total = total
        self._begun = time.monotonic()
        self._live = sys.stderr.isatty()
        self._tenths = 0

    def show(self, found: Collection[Answer | str]) -> None:
        """Show the progress. found: all results so far; call it before the first and after each recording."""
        count, failed = len(found), sum(isinstance(each, str) for each in found)
        tenths = 10 * count // self._total
        if not self._live and tenths == self._tenths:
            return
        self._tenths = tenths
        if not count:  # the next line of the log, e.g. about compiling, overwrites this one
            print(f"0/{self._total} recordings", file=sys.stderr, end="\r", flush=True)
            return
        left = int((time.monotonic() - self._begun) / count * (self._total - count))
        text = f"{count}/{self._total} recordings, {failed} failed, {left // 60}:{left % 60:02d} left "
        start, end = ("\r", "\n" if count == self._total else "") if self._live else ("", "\n")
        print(f"{start}{text}", file=sys.stderr, end=end, flush=True)


def _finite(value: object) -> object:
    """The value with None in place of every number that is not finite."""
    if isinstance(value, dict):
        return {key: _finite(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(each) for each in value]
    if isinstance(value, float) and not abs(value) < float("inf"):
        return None
    return value
