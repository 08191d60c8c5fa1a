"""`raccoon diagnose` of one recording: what it is compared with, and the result. Can run in any process."""

from __future__ import annotations

import argparse
import logging
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from raccoon.core.readings import SI_WORDS

if TYPE_CHECKING:
    from raccoon.core.config import RobotConfig
    from raccoon.core.readings import Device
    from raccoon.diagnose.result import Diagnosis
    from raccoon.sim.effects.parameters import Parameters
    from raccoon.trace.loading import Run
    from raccoon.trace.recording import Recording

    ResolvedRobot = tuple[RobotConfig, Path | None, tuple[str, ...]]


@dataclass(frozen=True, slots=True)
class Job:
    """One recording to diagnose and what it is compared with. Can be pickled.

    robot: robot.toml given by the user. model: model to start from. holdout: held-out recording. truth_free:
    ignore truth columns. causes: Python file with own effects. port: controller, if the recording names none.
    """

    path: Path
    robot: Path | None
    model: Path | Parameters | None
    holdout: Path | None
    truth_free: bool
    causes: Path | None = None
    port: str | None = None


@dataclass(frozen=True, slots=True)
class Answer:
    """The result of one recording.

    robot: name of its robot. file: the robot.toml it was compared with. samples: `Recording.fingerprint`.
    config: the content of robot.toml.
    """

    diagnosis: Diagnosis
    robot: str
    file: Path | None
    samples: str
    config: RobotConfig


def diagnose_job(job: Job) -> Answer:
    """Load and diagnose one recording. Raises as `diagnose_recording`."""
    from raccoon.core.errors import TraceError
    from raccoon.trace.loading import load_run

    run = load_run(job.path)
    try:
        whose = resolve_robot(run, job.robot)
    except TraceError as error:  # name the file: there may be several
        raise TraceError(f"{job.path}: {error}") from None
    robot, file, _ = whose
    found = _diagnose_runs(job, [run], [job.path], whose)
    return Answer(found, run.whose or robot.name, file, run.recording.fingerprint(), robot)


def diagnose_together(args: argparse.Namespace, paths: Sequence[Path]) -> Diagnosis:
    """One diagnosis of several drives of one robot. Raises as `diagnose_recording`, and ConfigError if the
    recordings are of different robots or controllers."""
    from raccoon.cli.diagnose.files import robot_names
    from raccoon.core.errors import ConfigError
    from raccoon.trace.loading import load_run

    runs = [load_run(path) for path in paths]
    whose = [resolve_robot(each, args.robot) for each in runs]
    called = [(each.whose or robot.name, file) for each, (robot, file, _) in zip(runs, whose, strict=True)]
    names = dict.fromkeys(robot_names(called))
    if len(names) > 1:
        raise ConfigError(f"--together: the recordings are of {len(names)} robots, {', '.join(names)}")
    device = runs[0].recording.device
    for path, each in zip(paths, runs, strict=True):
        if each.recording.device != device:
            one, other = _controller_text(device), _controller_text(each.recording.device)
            raise ConfigError(f"--together: {paths[0]} is of {one}, {path} of {other}")
    found = _diagnose_runs(make_job(args, paths[0]), runs, paths, whose[0])
    listed = ", ".join(f"{number} {path.name}" for number, path in enumerate(paths, 1))
    return replace(found, notes=(f"recordings that are fitted together: {listed}", *found.notes))


def _controller_text(device: Device) -> str:
    """Text that names the controller of a recording, if the recording does."""
    return "an unnamed controller" if device == SI_WORDS else f"the controller {device.name}"


_NUMBERED = re.compile(r"recording (\d+)")


def _diagnose_runs(job: Job, runs: Sequence[Run], paths: Sequence[Path], whose: ResolvedRobot) -> Diagnosis:
    """The diagnosis of runs of one robot; several runs are fitted together."""
    from raccoon.cli.diagnose.known_values import without_known_values
    from raccoon.core.errors import HoldoutError, TraceError
    from raccoon.diagnose.own import load_own_effects
    from raccoon.diagnose.recordings.diagnosis import diagnose_recording
    from raccoon.sim.effects.parameters import Parameters
    from raccoon.trace.loading import load_run

    robot, file, told = whose
    start = Parameters.from_model_file(job.model, robot) if isinstance(job.model, Path) else job.model
    own = () if job.causes is None else load_own_effects(job.causes)
    holdout = None if job.holdout is None else load_run(job.holdout).recording
    if start is not None and job.robot is not None:  # robot.toml has the present wiring
        start = replace(start, robot=_with_model_numbers(robot, start))
    first, *others = (each.recording for each in runs)
    problems = list(first.problems) if not others else [
        f"{path}: {each}" for path, run in zip(paths, runs, strict=True) for each in run.recording.problems
    ]  # fmt: skip
    if holdout is not None:
        problems += [f"--holdout {job.holdout}: {each}" for each in _holdout_problems(holdout, first)]
    try:
        found = diagnose_recording(
            first.columns,
            robot if start is None else start.robot,
            holdout=None if holdout is None else holdout.columns,
            more=[each.columns for each in others],
            model=start,
            truth_free=job.truth_free,
            device=first.device,
            problems=(*problems, *(told if start is None else ())),
            own=own,
            port=job.port or _written_port(file),
        )
    except HoldoutError as error:
        raise TraceError(f"--holdout {job.holdout}: {error}") from None
    except TraceError as error:
        if others and _NUMBERED.search(str(error)):
            raise TraceError(_NUMBERED.sub(lambda it: str(paths[int(it[1]) - 1]), str(error))) from None
        raise TraceError(f"{job.path}: {error}" if not others else f"--together: {error}") from None
    return found if start is None else without_known_values(found, robot)


def _holdout_problems(holdout: Recording, first: Recording) -> list[str]:
    """Problems of a held-out recording, including a controller that differs from that of the first
    recording."""
    if holdout.device == first.device:
        return holdout.problems
    one, other = _controller_text(holdout.device), _controller_text(first.device)
    return [*holdout.problems, f"it is of {one}, but is treated as one of {other}"]


def _with_model_numbers(robot: RobotConfig, model: Parameters) -> RobotConfig:
    """The robot with the model's numbers, and with those tophats of the model for which it has effects and
    the robot has no sensor."""
    ports = {each.analog for each in robot.tophats.values()}
    known = {where for _, where in model.effects}
    more = {
        name: each
        for name, each in model.robot.tophats.items()
        if each.analog not in ports and name not in robot.tophats and str(each.analog) in known
    }
    return replace(robot, model=model.robot.model, tophats={**robot.tophats, **more})


def resolve_robot(run: Run, named: Path | None) -> ResolvedRobot:
    """The robot of a run, the robot.toml it comes from (None if none was needed), and a note if it had to be
    guessed.

    named: a robot.toml given by the user. Raises ConfigError, and TraceError for a recording without samples.
    """
    from raccoon.core.config import load_robot
    from raccoon.diagnose.recordings.kind import Kind, kind_of
    from raccoon.trace.loading import find_robot_toml

    if named is not None:
        return load_robot(named), named, ()
    if run.robot is not None:
        return run.robot, None, ()
    robot, near, which = find_robot_toml(run)
    kind = kind_of(run.recording.columns, robot)
    if kind is Kind.STEP or (near is None and kind not in (Kind.DRIVE, Kind.GEOMETRY)):
        return robot, None, ()  # the analysis of a step needs no robot
    said = f"the recording does not contain its robot: compared with {which} (--robot names another)"
    return robot, near, (said,)


def _written_port(robot: Path | None) -> str | None:
    """controller.port if the robot.toml contains that line, None if it leaves the default."""
    from raccoon.core.toml_text import parse_toml

    if robot is None:
        return None
    controller = parse_toml(robot.read_bytes()).get("controller", {})
    port = controller.get("port") if isinstance(controller, dict) else None
    return port if isinstance(port, str) else None


def diagnose_or_reason(job: Job) -> Answer | str:
    """The diagnosis, or the reason why there is none: neither a bad file nor a defect of this library, which
    is logged, stops the diagnosis of the others."""
    from raccoon.core.errors import RaccoonError

    try:
        return diagnose_job(job)
    except (RaccoonError, OSError) as error:
        return str(error)
    except Exception as error:
        logging.getLogger(__name__).exception("%s", job.path)
        return f"{type(error).__name__}: {error}"


def make_job(args: argparse.Namespace, path: Path) -> Job:
    """The job of one recording from the command's arguments. Raises ConfigError for more than one held-out
    file."""
    from raccoon.core.errors import ConfigError

    if len(args.holdout) > 1:
        raise ConfigError(f"--holdout: {len(args.holdout)} files: one recording is judged on one other")
    other = args.holdout[0] if args.holdout else None
    return Job(path, args.robot, args.model, other, args.truth_free, args.causes, args.port)
