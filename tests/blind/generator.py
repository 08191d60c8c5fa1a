"""Recordings with known, hidden causes, made by the independent plant from a seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from blind import drives
from blind.hidden import Hidden
from blind.plant import NEUTRAL, parameters, simulate

Array = NDArray[np.float64]

CYCLE = 0.005
LEAD_IN = 1.0
COAST_SHARE = 0.1
TICKS = 1500
"""Of an encoder, a turn."""
BASE_SPREAD = {
    "voc": 0.03, "rint": 0.005, "resistance_l": 0.03, "resistance_r": 0.03, "ke_l": 0.005, "ke_r": 0.005,
    "coulomb": 0.005, "viscous": 0.0005, "inertia_straight": 0.0006, "inertia_turn": 0.0005,
    "radius_l": 0.0001, "radius_r": 0.0001, "track": 0.0008, "bemf_offset_l": 1.0, "bemf_offset_r": 1.0,
    "filter_tau": 0.0005, "gyro_bias": 0.0005, "gyro_scale": 0.001,
}  # fmt: skip
"""Standard deviations of robot.toml's defaults: how far a robot may be from its file without a cause."""


@dataclass(frozen=True)
class Noise:
    """How disturbed a recording is; medians, each drawn log-normally around its own."""

    torque: float = 0.012
    floor: float = 0.04
    bemf_counts: float = 4.0
    gyro: float = 0.009
    battery: float = 0.02
    drop_share: float = 0.004

    def times(self, factor: float) -> Noise:
        """All of it multiplied, dropped samples aside."""
        return Noise(
            factor * self.torque,
            factor * self.floor,
            factor * self.bemf_counts,
            factor * self.gyro,
            factor * self.battery,
            self.drop_share,
        )


@dataclass(frozen=True)
class Blind:
    """A recording and what is hidden in it. columns: names of the CSV format, NaN where nothing is new.

    robot: the plant's parameters, base draw and hidden causes together. Where the robot moved before the
    first row, a slope's direction and an eccentric wheel's phase are those from there, in both. patched: part
    of the recording in which the robot was on its rough patch, if it has one.
    """

    columns: Mapping[str, Array]
    hidden: tuple[Hidden, ...]
    robot: Mapping[str, float]
    seed: int
    patched: float = 0.0


def _ou(rng: np.random.Generator, n: int, sd: float, tau: float) -> Array:
    """Stationary Ornstein-Uhlenbeck noise of two wheels, one value a cycle."""
    keep = float(np.exp(-CYCLE / tau))
    steps = rng.standard_normal((n, 2)) * sd * np.sqrt(1.0 - keep**2)
    steps[0] = rng.standard_normal(2) * sd
    return np.asarray(lfilter([1.0], [1.0, -keep], steps, axis=0), float)


def _base(rng: np.random.Generator) -> dict[str, float]:
    return {name: NEUTRAL[name] + sd * float(rng.standard_normal()) for name, sd in BASE_SPREAD.items()}


def _applied(base: Mapping[str, float], hidden: Sequence[Hidden]) -> dict[str, float]:
    """The base robot with every hidden change added to its own, not to the nominal, value."""
    merged = dict(base)
    for each in hidden:
        for name, value in each.plant.items():
            if name in BASE_SPREAD and NEUTRAL[name] != 0.0:
                merged[name] = merged[name] * value / NEUTRAL[name]
            elif name in BASE_SPREAD:
                merged[name] = merged[name] + value
            else:
                merged[name] = value
    return merged


def make(
    seed: int,
    hidden: Sequence[Hidden] = (),
    drive: str | Array = "exciting",
    seconds: float = 40.0,
    noise: Noise | None = None,
    imu_rate: float | None = None,
    encoders: bool = False,
    robot: int | None = None,
) -> Blind:
    """Draw one robot and one drive and record it. drive: a name in `drives`, or duty (n, 2) at 200 Hz.

    encoders: whether the wheels are read by these, so that no motor need coast for a back-EMF. robot: seed of
    the robot itself, for several drives of one; without it each is another.
    """
    rng = np.random.default_rng(seed)
    noise = Noise() if noise is None else noise
    commands = getattr(drives, drive)(rng, seconds) if isinstance(drive, str) else drive
    lead = np.tile(rng.uniform(-0.5, 0.5, 2) * (rng.random() < 0.5), (int(LEAD_IN / CYCLE), 1))
    duty = np.round(np.vstack([lead, commands]), 4)
    n = len(duty)
    cycles = np.concatenate([[0.0], np.cumsum(CYCLE + np.clip(rng.normal(0, 1e-4, n - 1), -4e-4, 4e-4))])
    cycles -= cycles[len(lead)]
    levels = np.exp(0.25 * rng.standard_normal(5))
    base = _base(rng if robot is None else np.random.default_rng(robot))
    whole = _applied(base, hidden)
    state = simulate(
        parameters(whole),
        cycles,
        duty,
        _ou(rng, n, noise.torque * levels[0], 0.15),
        _ou(rng, n, noise.floor * levels[1], 4.0),
        rng.standard_normal((n, 2)) * noise.bemf_counts * levels[2],
        0.0 if encoders else COAST_SHARE,
    )
    rate = imu_rate or float(rng.choice([50.0, 190.0]))
    sensed = (noise.gyro * levels[3], noise.battery * levels[4], rate)
    columns = _record(rng, cycles, duty, state, sensed, len(lead), noise.drop_share)
    if encoders:
        columns = _by_encoders(columns, cycles, state)
    moved = _Moved(*(float(each) for each in state[len(lead), 8:11]))
    seen = (replace(each, values=moved.values(each), plant=moved.plant(each.plant)) for each in hidden)
    length = whole.get("patch_length", 1.0)
    on = whole.get("patch", 0.0) * (state[len(lead) :, 6] % (3.0 * length) < length)
    return Blind(columns, tuple(seen), moved.plant(whole), seed, float((on > 0.0).mean()))


@dataclass(frozen=True)
class _Moved:
    """How far robot and wheels had turned at the first row, from which a diagnosis counts; rad."""

    heading: float
    left: float
    right: float

    def plant(self, numbers: Mapping[str, float]) -> dict[str, float]:
        """The plant's numbers from there."""
        seen = dict(numbers)
        if "slope_x" in seen:
            along = complex(seen["slope_x"], seen["slope_y"]) * np.exp(-1j * self.heading)
            seen |= {"slope_x": float(along.real), "slope_y": float(along.imag)}
        for name, turned in (("ecc_phase_l", self.left), ("ecc_phase_r", self.right)):
            if name in seen:
                seen[name] = float(np.angle(np.exp(1j * (seen[name] + turned))))
        return seen

    def values(self, hidden: Hidden) -> dict[str, float]:
        """A cause's values from there."""
        seen, values = self.plant(hidden.plant), dict(hidden.values)
        if hidden.id == "drive.slope":
            return {"along_x": seen["slope_x"], "along_y": seen["slope_y"]}
        if hidden.id == "drive.wheel_eccentricity":
            values["phase"] = next(value for name, value in seen.items() if "phase" in name)
        return values


def _by_encoders(columns: Mapping[str, Array], cycles: Array, state: Array) -> dict[str, Array]:
    """The recording with the speeds that encoders count, in the place of back-EMF and its counters."""
    tick = 2.0 * np.pi / TICKS
    speed = np.gradient(np.rint(state[:, 9:11] / tick) * tick, cycles, axis=0)
    row = np.searchsorted(cycles, columns["t"] - 0.5 * CYCLE)
    others = {name: each for name, each in columns.items() if not name.endswith(("bemf", "position"))}
    return others | {f"motor.{side}.speed": speed[row, side] for side in (0, 1)}


def _record(
    rng: np.random.Generator,
    cycles: Array,
    duty: Array,
    state: Array,
    sensed: tuple[float, float, float],
    lead: int,
    drop_share: float,
) -> dict[str, Array]:
    gyro_noise, battery_noise, imu_rate = sensed
    n = len(cycles)
    gyro_word = np.pi / 180 / 16.4
    gyro = np.round((state[:, 5] + gyro_noise * rng.standard_normal(n)) / gyro_word) * gyro_word
    battery_word = 3.3 * 11 / 4096
    battery = np.round((state[:, 4] + battery_noise * rng.standard_normal(n)) / battery_word) * battery_word
    fresh = np.diff(np.floor(cycles * imu_rate), prepend=-np.inf) > 0
    tick = np.arange(n)
    columns = {
        "t": cycles + rng.normal(0.0, 5e-5, n),
        "motor.0.duty": duty[:, 0],
        "motor.0.bemf": np.trunc(state[:, 0]),
        "motor.0.position": np.trunc(state[:, 2]),
        "motor.1.duty": duty[:, 1],
        "motor.1.bemf": np.trunc(state[:, 1]),
        "motor.1.position": np.trunc(state[:, 3]),
        "battery.voltage": np.where(tick % 2 == 0, battery, np.nan),
        "imu.gyro.z": np.where(fresh, gyro, np.nan),
    }
    keep = (rng.random(n) >= drop_share) & (tick >= lead) & (tick < n - 1)
    burst = int(rng.integers(lead + 100, n - 100))
    keep[burst : burst + 3] = False
    keep[lead] = True
    return {name: column[keep].copy() for name, column in columns.items()}
