"""The diagnosis of single motors: each as an axis, their battery, and faulty sensors."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.errors import HoldoutError, TraceError
from raccoon.diagnose.drives.holdout import missing_phrase
from raccoon.diagnose.drives.time_column import check_time
from raccoon.diagnose.recordings.axis.diagnosis import AxisName, diagnose_axis
from raccoon.diagnose.recordings.axis.log import EFFORT_UNITS, MOTION_UNITS
from raccoon.diagnose.recordings.channels.invalid_samples import without_invalid_samples
from raccoon.diagnose.recordings.motors.supply import Supply, judge_supply, motor_power
from raccoon.diagnose.recordings.motors.units import (
    BATTERY,
    check_volts,
    speed_saturation_fault,
    unlike_motor_notes,
)
from raccoon.diagnose.result import CauseResult, Diagnosis, Rejected, SensorFault, Unexplained, Verdict
from raccoon.trace.recording import ports_in

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

MAX_DEAD_CURRENT_A = 0.01
"""Largest current of a driven motor, A, at which its current sensor is dead."""
MAX_CURRENT_A = 100.0
"""Upper bound of a motor's current, A."""
MAX_REST_CURRENT_A = 0.06
"""Largest current at rest without voltage, A; a larger one is an offset of the sensor (the best drift by
0.02)."""
MAX_REST_SPEED_SHARE = 0.02
"""Speed over the largest one below which a motor stands still."""
MIN_CURRENT_R2 = 0.3
"""R2 of the regression of the current on voltage and speed below which it is not this motor's current."""
MIN_SAMPLES = 50
"""Least number of samples for a check."""
MAX_STEP_S = 0.9
"""Longest time between samples, s, even of a slow axis."""
MAX_BATTERY_V = 100.0
"""Largest battery reading, V."""
NO_LOAD_CHANGE = "not visible: battery.voltage, or what the motors take, never changes"
_WORST_FIRST = (Verdict.UNKNOWN, Verdict.PARTLY, Verdict.EXPLAINED, Verdict.ADEQUATE)


@dataclass(frozen=True, slots=True)
class _CheckedMotor:
    """Columns without a motor's faulty readings, their faults, and notes."""

    columns: dict[str, Array]
    faults: tuple[SensorFault, ...]
    notes: tuple[str, ...]


def motor_ports(columns: Columns) -> list[int]:
    """Ports with both an effort (force, torque, voltage) and a motion."""
    ports = sorted({port for kind in EFFORT_UNITS for port in ports_in(columns, "motor", kind)})
    return [
        port
        for port in ports
        if _has_any(columns, port, EFFORT_UNITS) and _has_any(columns, port, MOTION_UNITS)
    ]


def _has_any(columns: Columns, port: int, kinds: Mapping[str, str]) -> bool:
    return any(f"motor.{port}.{kind}" in columns for kind in kinds)


def diagnose_motors(columns: Columns, robot: RobotConfig, holdout: Columns | None = None) -> Diagnosis:
    """One diagnosis of all motors of a recording and of their battery.

    Raises TraceError if no motor has both an effort and a motion.
    """
    begin = time.perf_counter()
    check_time(np.asarray(columns["t"], float), MAX_STEP_S)
    ports = motor_ports(columns)
    if not ports:
        raise TraceError("no motor has both a force, torque or voltage and a travel, angle or speed")
    diagnoses: list[Diagnosis] = []
    notes: list[str] = []
    rejected: list[Rejected] = []
    diagnosed_ports: list[int] = []
    cleaned, faults = _check_battery(columns)
    for port in ports:
        checked = _check_motor(cleaned, port)
        check_volts(checked.columns, port)
        cleaned = checked.columns
        faults += checked.faults
        notes += checked.notes
        try:
            other = None if holdout is None else _check_motor(dict(holdout), port).columns
            diagnoses.append(diagnose_axis(cleaned, port, _axis_name(robot, port, ports), other))
            diagnosed_ports.append(port)
        except HoldoutError:
            raise
        except TraceError as error:
            rejected.append(Rejected(f"motor {port}", f"not diagnosed: {error}"))
    supply, missing = _judge_battery(cleaned, ports)
    return _join_diagnoses(diagnoses, diagnosed_ports, supply, missing, faults, notes, rejected, begin)


def _check_battery(columns: Columns) -> tuple[dict[str, Array], list[SensorFault]]:
    """The columns without invalid samples of the battery, and the faults. Raises TraceError for another
    unit."""
    cleaned = dict(columns)
    battery = cleaned.get(BATTERY)
    if battery is None:
        return cleaned, []
    cleaned[BATTERY], faults = without_invalid_samples(BATTERY, "battery", cleaned["t"], battery, None)
    if not (np.nan_to_num(battery) > 0.0).any():
        del cleaned[BATTERY]
    elif (median := float(np.nanmedian(cleaned[BATTERY]))) > MAX_BATTERY_V:
        raise TraceError(
            f"{BATTERY} is around {median:g} V: allowed are {MAX_BATTERY_V:g}; it looks like counts or "
            "millivolts, not volts"
        )
    return cleaned, list(faults)


def _axis_name(robot: RobotConfig, port: int, ports: list[int]) -> AxisName:
    if len(ports) == 1:
        return AxisName(None, "the axis")
    sides = {robot.drive.left: "left", robot.drive.right: "right"}
    side = sides.get(port)
    return AxisName(side or str(port), f"the {side} motor" if side else f"motor {port}")


def _check_motor(columns: dict[str, Array], port: int) -> _CheckedMotor:
    """Leave out a saturated speed and an implausible current, and correct the sign of a motor with swapped
    wires."""
    names = [f"motor.{port}.{kind}" for kind in ("voltage", "current", "speed")]
    voltage, current, speed = (columns.get(name) for name in names)
    faults: list[SensorFault] = []
    notes: list[str] = []
    if voltage is not None and speed is not None and _is_inverted(voltage, speed):
        if current is not None and float(np.nansum(voltage * current)) > 0.0:  # its sign is the command's
            columns[names[1]] = current = -current
        columns[names[0]] = voltage = -voltage
        notes.append(f"motor {port} turns against its command: its wires are swapped; the sign was corrected")
    if speed is not None and (saturated := speed_saturation_fault(names[2], speed)):
        faults.append(saturated)
        columns = {**columns, names[2]: np.full_like(speed, np.nan)}
        speed = None
    if current is not None and voltage is not None:
        fault = _current_fault(names[1], voltage, current, speed)
        if fault is not None:
            faults.append(fault)
            columns = {**columns, names[1]: np.full_like(current, np.nan)}
    return _CheckedMotor(columns, tuple(faults), tuple(notes))


def _is_inverted(voltage: Array, speed: Array) -> bool:
    known = np.isfinite(voltage) & np.isfinite(speed) & (voltage != 0.0)
    if known.sum() < MIN_SAMPLES:
        return False
    power = voltage[known] * np.clip(speed[known], *np.percentile(speed[known], [2.0, 98.0]))
    return float(power.sum()) < -0.3 * float(np.abs(power).sum())


def _current_fault(name: str, voltage: Array, current: Array, speed: Array | None) -> SensorFault | None:
    known = np.isfinite(current) & np.isfinite(voltage)
    if speed is not None and np.isfinite(speed).sum() < MIN_SAMPLES:
        speed = None
    if speed is not None:
        known &= np.isfinite(speed)
    largest = float(np.abs(current[known]).max(initial=0.0))
    if largest > MAX_CURRENT_A:
        text = f"{name} reaches {largest:g} A: it looks like milliamperes or counts, and was not used"
        return SensorFault(name, "unit", text)
    if known.sum() < MIN_SAMPLES or largest < MAX_DEAD_CURRENT_A:
        return SensorFault(
            name, "dead", f"{name} shows no current although the motor is driven: its sensor is dead; R, K_E "
            "and friction torque of this motor cannot be told apart without it"
        )  # fmt: skip
    if speed is None:
        return None
    offset = _rest_current(voltage[known], current[known], speed[known])
    if abs(offset) > MAX_REST_CURRENT_A:
        return SensorFault(
            name, "offset", f"{name} reads {offset:+.2f} A while the motor stands without voltage: its zero "
            "is wrong or moves, and it was not used"
        )  # fmt: skip
    columns = np.column_stack([voltage, speed, np.ones_like(voltage)])[known]
    coefficients = np.linalg.lstsq(columns, current[known], rcond=None)[0]
    residuals = current[known] - columns @ coefficients
    r_squared = 1.0 - float(residuals.var()) / max(float(current[known].var()), 1e-12)
    if r_squared < MIN_CURRENT_R2 or coefficients[0] <= 0.0:
        return SensorFault(
            name, "implausible", f"{name} does not follow voltage and speed (R2 {r_squared:.2f}, "
            f"{coefficients[0]:+.3f} A/V): it is not this motor's current and was not used"
        )  # fmt: skip
    return None


def _rest_current(voltage: Array, current: Array, speed: Array) -> float:
    """Median current without voltage and motion, A; 0 if there are too few such samples."""
    still = (voltage == 0.0) & (
        np.abs(speed) < MAX_REST_SPEED_SHARE * float(np.percentile(np.abs(speed), 95.0))
    )
    return float(np.median(current[still])) if still.sum() >= 20 else 0.0


def _judge_battery(columns: Columns, ports: list[int]) -> tuple[Supply | None, tuple[str, ...]]:
    if BATTERY not in columns:
        return None, (BATTERY,)
    power, missing = motor_power(columns, ports)
    if power is None:
        return None, missing
    return judge_supply(columns["t"], columns[BATTERY], power), ()


def _join_diagnoses(
    diagnoses: list[Diagnosis],
    ports: list[int],
    supply: Supply | None,
    missing: tuple[str, ...],
    faults: list[SensorFault],
    notes: list[str],
    ruled_out: list[Rejected],
    begin: float,
) -> Diagnosis:
    causes = [cause for each in diagnoses for cause in each.causes]
    channels = [channel for each in diagnoses for channel in each.channels]
    rejected = [
        each for one in diagnoses for each in one.rejected if each.id != "battery.internal_resistance"
    ]
    rejected += ruled_out
    if supply is not None:
        channels.append(supply.channel)
        rejected += supply.rejected
        causes += [] if supply.cause is None else [supply.cause]
    else:
        reason = f"not identifiable: {missing_phrase(missing)}" if missing else NO_LOAD_CHANGE
        rejected.append(Rejected("battery.internal_resistance", reason))
    identified = {
        name if len(ports) == 1 else f"motor.{port}.{name}": value
        for port, each in zip(ports, diagnoses, strict=True)
        for name, value in each.identified.items()
    }
    verdicts = [each.verdict for each in diagnoses]
    verdict = next((each for each in _WORST_FIRST if each in verdicts), Verdict.NOT_IDENTIFIABLE)
    return Diagnosis(
        Verdict.EXPLAINED if verdict is Verdict.ADEQUATE and causes else verdict,
        tuple(channels),
        _rank(causes),
        tuple(dict.fromkeys(rejected)),
        Unexplained(
            float(np.mean([each.unexplained.share for each in diagnoses])) if diagnoses else 1.0,
            tuple(dict.fromkeys(name for each in diagnoses for name in each.unexplained.depends_on)),
        ),
        (),
        time.perf_counter() - begin,
        None,
        tuple(
            dict.fromkeys(
                [
                    *notes,
                    *unlike_motor_notes(identified),
                    *(note for each in diagnoses for note in each.notes),
                ]
            )
        ),
        identified,
        tuple(faults),
        tuple(curve for each in diagnoses for curve in each.curves),
    )


def _rank(causes: list[CauseResult]) -> tuple[CauseResult, ...]:
    """Causes ranked by the reduction of the held-out error, relative to the noise."""

    def worth(each: CauseResult) -> float:
        return -(each.gain.heldout_rmse_before - each.gain.heldout_rmse_after)

    return tuple(replace(each, rank=rank + 1) for rank, each in enumerate(sorted(causes, key=worth)))
