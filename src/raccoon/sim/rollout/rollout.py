"""Open-loop simulation along recorded commands, of one robot or of many at once."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import ConfigError
from raccoon.core.near_names import did_you_mean
from raccoon.core.readings import BATTERY_VOLTS_PER_COUNT
from raccoon.sim.effects.chain import Noise
from raccoon.sim.effects.parameters import SIDES, Parameters
from raccoon.sim.effects.physical import gyro_lag, safe_step
from raccoon.sim.plant.lanes import NO_READING
from raccoon.sim.plant.quantities import Plant, State
from raccoon.sim.rollout.commands import Commands
from raccoon.sim.rollout.initial import Initial, initial_states
from raccoon.sim.rollout.packing import Lanes
from raccoon.sim.rollout.running import Course, cycles_of, run

__all__ = ["Lanes", "Rollout", "channel_names", "initial_states", "rollout"]

Floats = NDArray[np.float64]
Indices = NDArray[np.intp]
_LATENCY = 3  # column of `Lanes.gyro`


@dataclass(frozen=True, slots=True, eq=False)
class Rollout:
    """The result of a rollout: channels by trace name, each of shape (robots, rows), and the final states.

    time: of each row, s. final: state of each robot at the last row, (robots, fields of State), from which
    another rollout can continue; NaN in fields that were not computed.
    """

    time: Floats
    channels: Mapping[str, Floats]
    final: Floats

    def __getitem__(self, name: str) -> Floats:
        try:
            return self.channels[name]
        except KeyError:
            raise KeyError(f"{name}: there is {', '.join(self.channels)}") from None


def rollout(
    robots: Parameters | Sequence[Parameters] | Lanes,
    commands: Commands,
    *,
    channels: Sequence[str] | None = None,
    initial: Initial | None = None,
    begin: int = 0,
    end: int | None = None,
    longest_step: float = 0.0025,
    readings_only: bool = False,
    noise: Noise | None = None,
    seed: int = 0,
) -> Rollout:
    """Simulate robots under recorded commands, without rounding of the readings.

    robots: one, several (they run side by side, one lane each) or packed `Lanes`. commands: n rows; the
    robots run from row `begin` to row `end` (by default the last one); earlier rows still count for the
    latency. channels: trace names to return, by default all of `channel_names`:

    - motor.N.bemf (counts) and motor.N.position (counts * s since the start), with the board's sign
    - motor.N.current (A) and motor.N.speed (rad/s), with the board's sign
    - imu.gyro.z (rad/s, with the IMU's effects; drift counts from commands.time[0])
    - battery.voltage (V)
    - truth.x, truth.y (m), truth.heading (rad): relative to the start pose

    initial: a State, or fields of it by name (one number, or one per robot) that replace those of a robot at
    rest; from a given wheel speed follow the speeds of wheel and robot and a settled back-EMF filter, unless
    their fields are given too. longest_step: s; each row is divided into equal steps no longer than this, and
    into shorter ones if a robot's time constants or its gyro's filter require them. readings_only: omit what
    no reading depends on (position, angles of the wheels, heat), which is faster for robots with presliding
    friction; truth.x and truth.y are then not available, and no other rollout can continue from `final`.
    noise: standard deviations of the readings' noise, drawn for each robot on its own from one seed; by
    default there is none.

    Row i of a channel is at commands.time[begin + i]: row 0 is the initial state, and the command of row i
    acts between rows i and i + 1. The equations are those of `sim.plant.equations`; the result is the same,
    bit for bit, for a robot alone and in a lane, with and without numba.

    Raises ConfigError for unknown channels or fields, channels that are not computed, rows out of range and a
    longest_step that is not above 0 or is longer than 0.02 s.
    """
    lanes = _looking(_packed(robots), commands)
    end = len(commands) - 1 if end is None else end
    _check(begin, end, len(commands), longest_step)
    names = tuple(dict.fromkeys(channel_names(lanes.ports) if channels is None else channels))
    fields = _fields_of(names, lanes.ports)
    if readings_only:
        _check_readings(fields)
    states = initial_states(lanes.plant, initial)
    kept = np.array([State._fields.index(each) for each in fields], dtype=np.int64)
    raw = np.empty((len(kept), end - begin + 1, len(states)))
    raw[:, 0, :] = states[:, kept].T
    scatter = None if noise is None else (noise, np.random.default_rng(seed))
    if scatter is None:
        bemf_noise = np.zeros((2, 1, len(states)))
    else:
        bemf_noise = _bemf_noise(*scatter, cycles_of(commands, begin, end, lanes.cycle), len(states))
    course = Course(
        commands,
        begin,
        end,
        min(longest_step, safe_step(lanes.plant)),
        bemf_noise,
        readings_only,
    )
    final = run(lanes, states, course, kept, raw)
    if readings_only:
        final[:, [State._fields.index(each) for each in NO_READING]] = np.nan
    recorded = {name: raw[row].T for row, name in enumerate(fields)}
    time = commands.time[begin : end + 1]
    age = time - commands.time[0]
    made = {name: _channel(name, recorded, lanes, age) for name in names}
    return Rollout(time, _scattered(made, *scatter) if scatter else made, final)


def _check(begin: int, end: int, rows: int, longest_step: float) -> None:
    if not 0 <= begin < end < rows:
        raise ConfigError(f"rows {begin} to {end}: allowed are 0 <= begin < end <= {rows - 1}")
    if not 0.0 < longest_step <= 0.02:
        raise ConfigError(f"longest_step is {longest_step} s: allowed are numbers above 0 up to 0.02")


def _check_readings(fields: Sequence[str]) -> None:
    for each in fields:
        if each in NO_READING:
            raise ConfigError(f"truth.{each} is no reading: ask for it without readings_only")


def _bemf_noise(noise: Noise, random: np.random.Generator, cycles: int, robots: int) -> Floats:
    if noise.bemf == 0.0:
        return np.zeros((2, 1, robots))
    return random.normal(0.0, noise.bemf, (2, cycles, robots))


def _scattered(channels: dict[str, Floats], noise: Noise, random: np.random.Generator) -> dict[str, Floats]:
    """The channels with noise added to gyro and battery; noise of back-EMF is added before its filter, not
    here."""
    if "imu.gyro.z" in channels:
        shape = channels["imu.gyro.z"].shape
        bias = random.normal(0.0, noise.gyro_bias, (shape[0], 1))
        channels["imu.gyro.z"] = channels["imu.gyro.z"] + bias + random.normal(0.0, noise.gyro, shape)
    if "battery.voltage" in channels:
        sd = noise.battery * BATTERY_VOLTS_PER_COUNT
        voltage = channels["battery.voltage"]
        channels["battery.voltage"] = voltage + random.normal(0.0, sd, voltage.shape)
    return channels


def channel_names(ports: tuple[int, int]) -> tuple[str, ...]:
    """Names of all channels of a rollout of a robot whose left and right motors are at `ports`."""
    motors = [f"motor.{port}.{kind}" for kind in _MOTOR_FIELDS for port in ports]
    return (*motors, "imu.gyro.z", *_PLAIN_FIELDS)


_MOTOR_FIELDS = {"bemf": "bemf", "position": "position", "current": "current", "speed": "speed"}
_PLAIN_FIELDS = {
    "battery.voltage": "battery",
    "truth.x": "x",
    "truth.y": "y",
    "truth.heading": "heading",
}


def _packed(robots: Parameters | Sequence[Parameters] | Lanes) -> Lanes:
    if isinstance(robots, Lanes):
        return robots
    return Lanes.of([robots] if isinstance(robots, Parameters) else robots)


def _looking(lanes: Lanes, commands: Commands) -> Lanes:
    """The robots with the time at which their gyros are sampled set for rows as long as these and their
    latency."""
    latency = lanes.gyro[:, _LATENCY]
    if not latency.any():
        return lanes
    plant = lanes.plant.copy()
    plant[:, Plant._fields.index("gyro_lag")] = gyro_lag(latency, float(np.median(np.diff(commands.time))))
    return replace(lanes, plant=plant)


def _fields_of(names: Sequence[str], ports: tuple[int, int]) -> tuple[str, ...]:
    """Fields of the state from which the channels are computed. Raises ConfigError for an unknown channel."""
    known = channel_names(ports)
    fields: dict[str, None] = {}
    for name in names:
        if name not in known:
            raise ConfigError(
                f"channel {name!r}: there is none of that name{did_you_mean(name, known)}; allowed are"
                f" {', '.join(known)}"
            )
        fields[_field(name, ports)] = None
    if "gyro_followed" in fields:
        fields["gyro_rate"] = None
    return tuple(fields)


def _field(name: str, ports: tuple[int, int]) -> str:
    if name == "imu.gyro.z":
        return "gyro_followed"
    if name in _PLAIN_FIELDS:
        return _PLAIN_FIELDS[name]
    _, port, kind = name.split(".")
    return f"{_MOTOR_FIELDS[kind]}_{SIDES[ports.index(int(port))]}"


def _channel(name: str, recorded: Mapping[str, Floats], lanes: Lanes, age: Floats) -> Floats:
    values = recorded[_field(name, lanes.ports)]
    if name == "imu.gyro.z":
        lags = lanes.plant[:, Plant._fields.index("gyro_lag")]
        return _gyro(values, recorded["gyro_rate"], lanes.gyro, lags, age)
    if name in _PLAIN_FIELDS:
        return values
    sign = lanes.signs[lanes.ports.index(int(name.split(".")[1]))]
    return values if sign > 0.0 else -values


def _gyro(rate: Floats, looked: Floats, numbers: Floats, lags: Floats, age: Floats) -> Floats:
    """The gyro's readings, (robots, rows), from the filtered yaw rate `rate`, which is overwritten: no other
    channel uses it.

    looked: rate when the gyro was sampled in each row. numbers: `Lanes.gyro`. lags: s before the end of a row
    at which it was sampled. age: time of each row since the first command, s.
    """
    scale, bias, drift, latency = (each[:, None] for each in numbers.T)
    late = dict.fromkeys(zip(latency[:, 0].tolist(), lags.tolist(), strict=True))
    for seconds, lag in late:  # in a fit nearly all robots have the same latency
        if seconds != 0.0:
            robots = np.flatnonzero((latency[:, 0] == seconds) & (lags == lag))
            _make_earlier(rate, looked, robots, age, seconds, lag)
    if np.any(scale != 1.0):
        rate *= scale
    if np.any(bias):
        rate += bias
    if np.any(drift):
        rate += drift * age
    return rate


def _make_earlier(
    rate: Floats, looked: Floats, robots: Indices, age: Floats, latency: float, lag: float
) -> None:
    """Replace the yaw rates of some robots by those `latency` s before each row; before the first row, its
    rate holds.

    looked: the rate `lag` s before the end of each row, in rows that are longer than that. Between these
    samples and the ends of rows the rate is interpolated. Time stamps jitter, so the moments are right but
    for some tenths of a millisecond. A curve through the ends of rows alone would miss where within a row a
    command changes or a tooth meets its wheel.
    """
    inside = np.flatnonzero(np.diff(age) > lag) + 1
    ends: slice | Indices = slice(0, None, 2)
    looks: slice | Indices = slice(1, None, 2)
    if len(inside) < len(age) - 1:  # seldom: some rows have no sample
        place = np.argsort(np.argsort(np.concatenate([age, age[inside] - lag]), kind="stable"))
        ends, looks = place[: len(age)], place[len(age) :]
    times, rates = (np.empty(len(age) + len(inside)) for _ in range(2))
    times[ends], times[looks] = age, age[inside] - lag
    at = age - latency
    before = np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 2)
    since, gaps = np.maximum(at - times[before], 0.0), np.diff(times)[before]
    gaps[gaps == 0.0] = 1.0  # with a tiny latency the last sample is at the row's end
    for robot in robots:  # one by one: the arrays of all together would not fit into the cache
        rates[ends], rates[looks] = rate[robot], looked[robot, inside]
        here = rates[before]
        rate[robot] = (rates[before + 1] - here) / gaps * since + here
