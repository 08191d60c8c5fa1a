"""Judges the sag of the battery behind motors with recorded voltages and currents."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.drives.bins import solve_recursion
from raccoon.diagnose.recordings.axis.log import holdout_start
from raccoon.diagnose.result import CauseResult, ChannelResult, Gain, ParameterResult, Rejected

Array = NDArray[np.float64]

BATTERY_RESISTANCE = "battery.internal_resistance"
MIN_GAIN = 0.1
"""Least relative reduction of the held-out error by the resistance, or then by a second branch."""
MIN_CLEAR_SIGMAS, MIN_CLEAR_GAIN = 10.0, 0.01
"""Standard deviations from 0 above which a resistance with a smaller reduction is named, and that
reduction."""
BRANCH_TIME_CONSTANTS_S = (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0)
"""Time constants of a battery's second branch, s; the best-fitting one is used."""
MIN_SAMPLES = 100
"""Least number of samples."""
JACKKNIFE_BLOCKS = 8
"""Number of blocks of time of the jackknife for a standard deviation."""


@dataclass(frozen=True, slots=True)
class Supply:
    """Result for the battery. cause: its resistance, if that improves held-out data."""

    channel: ChannelResult
    cause: CauseResult | None
    rejected: tuple[Rejected, ...]
    resistance: ParameterResult


def judge_supply(time: Array, voltage: Array, power: Array) -> Supply | None:
    """Judge the battery's resistance, which is assumed to be 0 so far. voltage: of the battery, V. power:
    that the motors take, W.

    The current is power over voltage; the model V = V0 - R I is fitted before the row that the command steps
    determine and judged after it. None if too little is known, or voltage or power never changes.
    """
    known = np.isfinite(voltage) & np.isfinite(power)
    if known.sum() < MIN_SAMPLES or not (np.ptp(power[known]) > 0.0 and np.ptp(voltage[known]) > 0.0):
        return None
    time, voltage, power = time[known], voltage[known], power[known]
    current = power / voltage
    split = holdout_start(np.round(power, 1))
    error_without, _, _ = _fit_and_score(voltage, np.ones((len(time), 1)), split)
    error_with, numbers, std = _fit_and_score(voltage, np.column_stack([np.ones(len(time)), -current]), split)
    branch_error = min(
        _fit_and_score(
            voltage, np.column_stack([np.ones(len(time)), -current, -_low_passed(time, current, each)]), split
        )[0]
        for each in BRANCH_TIME_CONSTANTS_S
    )
    noise = float(np.std(np.diff(voltage)) / np.sqrt(2.0))
    resistance = ParameterResult(float(numbers[1]), std, "ohm", 0.0)
    min_gain, min_sigmas = (
        (MIN_CLEAR_GAIN, MIN_CLEAR_SIGMAS) if numbers[1] > MIN_CLEAR_SIGMAS * std else (MIN_GAIN, 3.0)
    )
    is_named = error_with < (1.0 - min_gain) * error_without and numbers[1] > min_sigmas * std
    channel = ChannelResult(
        "battery.voltage", "V", error_without, error_with if is_named else error_without, noise
    )
    rejected = (
        [_reject_branch(1.0 - branch_error / error_with)]
        if branch_error > (1.0 - MIN_GAIN) * error_with
        else []
    )
    if not is_named:
        rejected.append(
            Rejected(
                BATTERY_RESISTANCE, "the voltage does not follow the current on data that was not fitted"
            )
        )
    return Supply(channel, _cause(channel, resistance) if is_named else None, tuple(rejected), resistance)


def _reject_branch(gain: float) -> Rejected:
    return Rejected(
        "battery.*",
        f"a second, slower branch (RC) saves {max(100.0 * gain, 0.0):.0f} % of the error on unseen data: not "
        "worth a term (10 % is)",
    )


def _fit_and_score(voltage: Array, columns: Array, split: int) -> tuple[float, Array, float]:
    """RMS error after the split; coefficients fitted before it; jackknife standard deviation of the last
    one."""
    rows = np.arange(split)
    numbers = np.linalg.lstsq(columns[:split], voltage[:split], rcond=None)[0]
    jackknifed = [
        np.linalg.lstsq(columns[:split][keep], voltage[:split][keep], rcond=None)[0][-1]
        for keep in (rows * JACKKNIFE_BLOCKS // split != block for block in range(JACKKNIFE_BLOCKS))
    ]
    std = float(
        np.sqrt(
            (JACKKNIFE_BLOCKS - 1)
            / JACKKNIFE_BLOCKS
            * np.sum((np.array(jackknifed) - np.mean(jackknifed)) ** 2)
        )
    )
    error = voltage[split:] - columns[split:] @ numbers
    return float(np.sqrt(np.mean(error**2))), np.asarray(numbers, float), std


def _low_passed(time: Array, current: Array, constant: float) -> Array:
    """The current after a first-order low-pass with this time constant (s)."""
    kept = np.exp(-np.diff(time, prepend=time[0]) / constant)
    return solve_recursion(kept, (1.0 - kept) * current)


def _cause(channel: ChannelResult, found: ParameterResult) -> CauseResult:
    gain = Gain(
        channel.rmse_before / channel.noise_floor,
        channel.rmse_after / channel.noise_floor,
        1.0,
    )
    sentence = (
        f"The battery's resistance is {found.value:.3f} ohm instead of {found.nominal:.3f}: its voltage sags "
        "under load; command volts instead of duty, or use a fresher battery."
    )
    return CauseResult(BATTERY_RESISTANCE, None, 1, {"resistance": found}, gain, 0.99, (), sentence)


def motor_power(columns: Mapping[str, Array], ports: list[int]) -> tuple[Array | None, tuple[str, ...]]:
    """Total power of all motors, W, or None; and the columns that are missing for it."""
    names = [f"motor.{port}.{kind}" for port in ports for kind in ("voltage", "current")]
    missing = tuple(
        name for name in names if name not in columns or np.isfinite(columns[name]).sum() < MIN_SAMPLES
    )
    if missing:
        return None, missing
    total = np.zeros(len(columns["t"]))
    for port in ports:
        total = total + columns[f"motor.{port}.voltage"] * columns[f"motor.{port}.current"]
    return total, ()
