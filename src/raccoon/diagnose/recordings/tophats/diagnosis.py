"""The diagnosis of reflectance recordings by ambient light, the sensor's gain, its height, or noise.

The simulated reading is factor * counts(height) + offset. White and black are two levels, so a single cause
of the three is distinguishable, and a pair only by usual deviations; if these do not decide, all fitting
causes are listed. A clipped level only shows that it is beyond the range, so then a single level is left. If
the levels jump, the parts before and after are judged separately; levels that drift have no single cause.
"""

from __future__ import annotations

import time as clock
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.time_column import check_time
from raccoon.diagnose.findings.fitted_model import with_causes
from raccoon.diagnose.recordings.tophats.fit import NominalSensor
from raccoon.diagnose.recordings.tophats.judge import SensorDiagnosis, diagnose_sensor
from raccoon.diagnose.recordings.tophats.sentences import HEIGHT, PARAMETER_NAMES
from raccoon.diagnose.result import Diagnosis, Rejected, Unexplained, Verdict
from raccoon.sim.effects.effect import effect
from raccoon.sim.effects.parameters import Parameters
from raccoon.trace.recording import ports_in

Array = NDArray[np.float64]
MAX_STEP_S = 0.9
"""Longest time between samples, s: a sensor held over a surface may be read slowly, but a time in ms advances
by more."""
Columns = Mapping[str, Array]


def tophat_ports(columns: Columns, robot: RobotConfig) -> list[int]:
    """Analog ports of the robot's tophats that were recorded; all recorded ones if it names none."""
    recorded = _recorded_ports(columns)
    named = [each.analog for each in robot.tophats.values() if each.analog in recorded]
    return named or recorded


def _recorded_ports(columns: Columns) -> list[int]:
    return ports_in(columns, "analog")


def _unjudged_notes(columns: Columns, ports: list[int]) -> tuple[str, ...]:
    """A note on recorded ports that are no tophat of the robot."""
    others = [port for port in _recorded_ports(columns) if port not in ports]
    if not others:
        return ()
    names = ", ".join(f"analog.{port}" for port in others)
    return (
        f"{names} {'was' if len(others) == 1 else 'were'} not judged: robot.toml has no tophat there; add "
        f"[tophat.NAME] with analog = {others[0]} to have it judged",
    )


def diagnose_tophats(
    columns: Columns,
    robot: RobotConfig,
    model: Parameters | None,
    truth_free: bool,
    of_a_drive: bool = False,
) -> Diagnosis:
    """Compare recorded tophats with the simulated ones. truth_free: do not use `truth.surface.N`. of_a_drive:
    the recording was not made for tophats, so what could not be judged is not reported.

    Raises TraceError for a time that is not a number, does not advance or is in another unit.
    """
    begin = clock.perf_counter()
    check_time(columns["t"], MAX_STEP_S)
    ports = tophat_ports(columns, robot)
    sensors = [
        diagnose_sensor(
            columns["t"],
            columns[f"analog.{port}"],
            None if truth_free else columns.get(f"truth.surface.{port}"),
            port,
            _nominal(model, port),
        )
        for port in ports
    ]
    causes = [cause for each in sensors for cause in each.causes]
    causes.sort(key=lambda each: each.gain.heldout_rmse_after - each.gain.heldout_rmse_before)
    ranked = tuple(replace(each, rank=rank) for rank, each in enumerate(causes, start=1))
    channels = tuple(each.channel for each in sensors if each.channel is not None)
    return Diagnosis(
        _verdict(bool(channels), bool(causes), any(each.depends_on for each in sensors)),
        channels,
        ranked,
        (
            *(rejected for each in sensors for rejected in each.rejected),
            *_rejected_missing(columns, robot, of_a_drive),
        ),
        Unexplained(
            # If the levels are as assumed or explained, the rest is chance and does not count.
            float(np.mean([each.unexplained_share if each.depends_on else 0.0 for each in sensors]))
            if sensors
            else 0.0,
            tuple(dict.fromkeys(name for each in sensors for name in each.depends_on)),
        ),
        tuple(dict.fromkeys(text for each in sensors for text in each.advice)),
        clock.perf_counter() - begin,
        with_causes(model or Parameters.from_robot(robot), ranked) if robot.tophats else None,
        _notes(sensors, columns, ports, of_a_drive),
        {name: value for each in sensors for name, value in each.identified.items()},
        tuple(fault for each in sensors for fault in each.faults),
        tuple(curve for each in sensors for curve in each.curves),
    )


def _rejected_missing(columns: Columns, robot: RobotConfig, of_a_drive: bool) -> list[Rejected]:
    """The causes of the robot's tophats that the recording lacks, as rejected."""
    recorded = _recorded_ports(columns)
    ports = [] if of_a_drive else sorted({each.analog for each in robot.tophats.values()} - set(recorded))
    return [
        Rejected(f"{id_}@{port}", f"not identifiable: analog.{port} is missing")
        for port in ports
        for id_ in PARAMETER_NAMES
    ]


def _notes(
    sensors: Sequence[SensorDiagnosis], columns: Columns, ports: list[int], of_a_drive: bool
) -> tuple[str, ...]:
    if of_a_drive:
        return tuple(note for each in sensors if each.channel is not None for note in each.notes)
    return (*(note for each in sensors for note in each.notes), *_unjudged_notes(columns, ports))


def _verdict(has_channels: bool, has_causes: bool, has_unknown_rest: bool) -> Verdict:
    if not has_channels:
        return Verdict.NOT_IDENTIFIABLE
    if has_causes:
        return Verdict.PARTLY if has_unknown_rest else Verdict.EXPLAINED
    return Verdict.UNKNOWN if has_unknown_rest else Verdict.ADEQUATE


def _nominal(model: Parameters | None, port: int) -> NominalSensor:
    if model is None:
        return NominalSensor(height=float(effect(HEIGHT).parameters[0].neutral or 0.007))
    return NominalSensor(*(model.value(id_, name, str(port)) for id_, name in PARAMETER_NAMES.items()))
