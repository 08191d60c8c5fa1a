"""The diagnosis of one motor's step response: faults of the reading, and the dead time."""

from __future__ import annotations

import time
from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.time_column import check_time
from raccoon.diagnose.recordings.motors.reading_faults import ReadingFaults, reading_faults
from raccoon.diagnose.reports.manoeuvre_text import MANOEUVRES
from raccoon.diagnose.result import (
    Curve,
    Diagnosis,
    ParameterResult,
    Rejected,
    SensorFault,
    Unexplained,
    Verdict,
)
from raccoon.trace.recording import median_step, ports_in

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

MAX_STEP_S = 0.9
"""Longest time between samples, s."""
MIN_READINGS = 10
"""Least number of values in a column that is a reading."""
MIN_REPEATED_SHARE = 0.02
"""Share of repeated samples above which they are a fault."""
MIN_STALE_SPEED = 0.4
"""Least stale value that is reported, rad/s: a smaller one is less than one count per sample."""
SHARED_CONSTANTS = (
    "not identifiable: one step gives one steady speed, which cannot tell K_E, friction and the reading's "
    "scale apart"
)
UNIDENTIFIABLE_CAUSES = (
    "motor.back_emf_constant", "motor.armature_resistance", "friction.coulomb", "friction.viscous",
    "friction.stiction", "drive.inertia", "bemf.scale", "actuation.latency",
)  # fmt: skip


def step_port(columns: Columns) -> int | None:
    """The port of a single motor with a constant power; None for other recordings."""
    ports = ports_in(columns, "motor", "duty")
    if len(ports) != 1:
        return None
    duty = columns[f"motor.{ports[0]}.duty"]
    known = duty[np.isfinite(duty)]
    if len(known) == 0 or np.ptp(known) > 0.0 or known[0] == 0.0:
        return None
    return None if _reading_name(_rows_from_command(columns, ports[0]), ports[0]) is None else ports[0]


def _rows_from_command(columns: Columns, port: int) -> Columns:
    """The columns from the first row with a command, from which the dead time counts."""
    first = int(np.argmax(np.isfinite(columns[f"motor.{port}.duty"])))
    return {name: each[first:] for name, each in columns.items()}


def _reading_name(columns: Columns, port: int) -> str | None:
    names = (f"motor.{port}.{kind}" for kind in ("speed_recorded", "speed", "bemf"))
    return next(
        (name for name in names if name in columns and np.isfinite(columns[name]).sum() >= MIN_READINGS), None
    )


def diagnose_step_response(columns: Columns, port: int) -> Diagnosis:
    """Diagnose faults of the reading and the dead time; one step does not determine motor constants.

    Raises TraceError for a time that goes back or is in another unit, which would also make the dead time
    wrong.
    """
    begin = time.perf_counter()
    columns = _rows_from_command(columns, port)
    check_time(np.asarray(columns["t"], float), MAX_STEP_S)
    name = _reading_name(columns, port)
    if name is None:
        raise ValueError(f"motor {port} has no speed")
    duty, unit = float(columns[f"motor.{port}.duty"][0]), "counts" if name.endswith(".bemf") else "rad/s"
    faults = reading_faults(columns["t"], columns[name])
    repeats = _repeated_share(columns, port, faults)
    latency = () if faults.dead_time is None else (f"dead time at {100 * duty:.0f} %",)
    return Diagnosis(
        Verdict.NOT_IDENTIFIABLE,
        (),
        (),
        tuple(Rejected(each, _rejection_reason(each, faults)) for each in UNIDENTIFIABLE_CAUSES),
        Unexplained(0.0),
        (MANOEUVRES["steps"], MANOEUVRES["creep"]),
        time.perf_counter() - begin,
        None,
        ("a single step shows the properties of the reading and the dead time, but no motor constants",),
        _identified(columns, faults, repeats, latency),
        (*_sensor_faults(name, faults, repeats), *_inverted_faults(columns, port, name, duty)),
        (Curve(name, unit, columns["t"], columns[name], _empty_curve(columns), _empty_curve(columns)),),
    )


def _empty_curve(columns: Columns) -> Array:
    return np.full(len(columns["t"]), np.nan)


def _rejection_reason(id_: str, faults: ReadingFaults) -> str:
    if id_ == "actuation.latency" and faults.dead_time is not None:
        return (
            f"not identifiable: the motor begins to move {1000 * faults.dead_time:.0f} ms after the command, "
            "which may be latency, deadband or stiction"
        )
    return SHARED_CONSTANTS


def _identified(
    columns: Columns, faults: ReadingFaults, repeats: float, latency: tuple[str, ...]
) -> dict[str, ParameterResult]:
    step = median_step(columns["t"])
    found = {"repeated samples": ParameterResult(repeats, 0.0, "", 0.0)}
    if faults.dead_time is not None:
        found[latency[0]] = ParameterResult(faults.dead_time, step / np.sqrt(12.0), "s", 0.0)
    if faults.decay is not None:
        found["filter keeps of a sample"] = ParameterResult(faults.decay, faults.decay_std, "", 0.0)
    return found


def _sensor_faults(name: str, faults: ReadingFaults, repeats: float) -> list[SensorFault]:
    found = []
    if faults.stale is not None and abs(faults.stale) > MIN_STALE_SPEED:
        first = f"the first sample of {name}, {faults.stale:.1f}, is left over from before"
        found.append(SensorFault(name, "stale", f"{first}: drop all samples until it has decayed"))
    if faults.decay is not None:
        mixed = 2.0 / (1.0 - faults.decay)
        text = f"a filter keeps {faults.decay:.2f} of the value before: each value mixes {mixed:.1f} samples"
        found.append(SensorFault(name, "filtered", text))
    if repeats == 1.0:
        text = f"{name} never changes: the motor did not turn, or nothing was read; check plug and wires"
        found.append(SensorFault(name, "stuck", text))
    elif repeats > MIN_REPEATED_SHARE:
        text = f"{100 * repeats:.0f} % of the samples of {name} repeat the last count: it is read too fast"
        found.append(SensorFault(name, "repeats", text))
    return found


def _repeated_share(columns: Columns, port: int, faults: ReadingFaults) -> float:
    """Share of repeated samples: those that the reader blanked after the filter, else equal neighbours."""
    clean, recorded = columns.get(f"motor.{port}.speed"), columns.get(f"motor.{port}.speed_recorded")
    if clean is None or recorded is None:
        return faults.repeats
    return float((np.isfinite(recorded) & ~np.isfinite(clean))[1:].mean())


def _inverted_faults(columns: Columns, port: int, name: str, duty: float) -> list[SensorFault]:
    clean = columns.get(f"motor.{port}.speed", columns[name])
    later = clean[len(clean) // 4 :]
    mean, size = float(np.nanmean(later)), float(np.nanmean(np.abs(later)))
    if not mean * duty < -0.2 * size * abs(duty):
        return []
    text = (
        f"{name} goes against its command (robot.toml's inverted flips both): write one of the two with the "
        "other sign, or check the wires by which the motor is read"
    )
    return [SensorFault(name, "inverted", text)]
