"""The plant fitted to recorded voltage steps of small two-wheel robots (2, 4, -4, 0 V at 1 kHz).

Fitted on the steps to 2 V and 4 V, judged on those to -4 V and 0 V, which the fit has not seen.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from raccoon.core.config import RobotConfig
from raccoon.core.schema import Measured
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.rollout.commands import Commands
from raccoon.sim.rollout.rollout import rollout

Floats = NDArray[np.float64]
SUPPLY = 12.0  # V; the command is a voltage, so any supply above it gives the same motor voltage
RADIUS = 0.03  # m, assumed; it only scales the motor constants
SPLIT = 0.352  # s: the step to -4 V
START = np.log([4.0, 0.09, 2e-4, 0.008, 1e-5])  # ohm, V s/rad, kg m2, N m, N m s/rad
LOW = START - np.array([1.2, 1.2, 3.0, 3.0, 6.0])
HIGH = START + np.array([1.2, 1.2, 3.0, 2.0, 6.0])
# Of the catalogue's effects those that can show in straight steps of 0.66 s: parameter, start, bounds, scale.
EFFECTS: dict[str, tuple[str, float, float, float, float]] = {
    "actuation.latency": ("seconds", 0.003, 0.0, 0.05, 0.005),
    "actuation.deadband": ("duty", 0.005, 0.0, 0.2, 0.01),
    "friction.load_dependent": ("coefficient", 0.05, 0.0, 0.9, 0.1),
    "friction.stiction": ("torque", 0.002, 0.0, 0.05, 0.002),
    "friction.quadratic": ("coefficient", 1e-6, 0.0, 1e-3, 1e-6),
    "friction.direction_dependent": ("asymmetry", 0.0, -0.95, 0.95, 0.1),
    "motor.heating": ("gain", 0.01, 0.0, 10.0, 0.1),
}
LATENCY = ("actuation.latency",)
NEAR = 1e-6  # how far a number is moved for its column, as a part of it
STICTION_SPEED = 5.0  # rad/s: a fiftieth of the top speed of these wheels
CURRENT_SD, SPEED_SD = 0.3, 0.05  # A, m/s


@dataclass(frozen=True)
class Wheel:
    """One wheel's recording."""

    time: Floats
    command: Floats
    speed: Floats
    current: Floats

    @property
    def current_is_plausible(self) -> bool:
        """Some current channels are dead."""
        return bool(np.median(np.abs(self.current[10:350])) > 0.03 and np.ptp(self.current) < 8.0)


@dataclass(frozen=True)
class Score:
    """Held-out figures: share of variance explained, RMSE (m/s), lag-1 correlation of the residual."""

    r2: float
    rmse: float
    lag1: float


def recordings(folder: Path) -> list[NDArray[np.void]]:
    """The robots' tables."""
    return [np.genfromtxt(path, delimiter=",", names=True) for path in sorted(folder.glob("robot-*.csv"))]


def wheels(table: NDArray[np.void]) -> list[Wheel]:
    """Left and right wheel of a robot."""
    return [
        Wheel(
            table["t_s"],
            table[f"{side}_command_V"],
            table[f"{side}_velocity_m_per_s"],
            table[f"{side}_current_A"],
        )
        for side in ("left", "right")
    ]


def simulated(numbers: Floats, wheel: Wheel, effects: tuple[str, ...] = ()) -> tuple[Floats, Floats]:
    """Speed (m/s) and current (A) of a wheel. numbers: logs of R, K, J, Coulomb, viscous; effects'."""
    (speed,), (current,) = _side_by_side(numbers[None], wheel, effects)
    return speed, current


def _side_by_side(many: Floats, wheel: Wheel, effects: tuple[str, ...]) -> tuple[Floats, Floats]:
    """Speeds and currents (wheels, times) of several sets of numbers (wheels, numbers)."""
    robots = [_robot(numbers, effects) for numbers in many]
    commands = Commands.of_wheels(wheel.time, wheel.command / SUPPLY, np.zeros_like(wheel.time))
    run = rollout(robots, commands, channels=("motor.0.speed", "motor.0.current"), longest_step=0.001)
    return RADIUS * run["motor.0.speed"], run["motor.0.current"]


def _robot(numbers: Floats, effects: tuple[str, ...]) -> Parameters:
    resistance, back_emf, inertia, coulomb, viscous = (Measured(float(each)) for each in np.exp(numbers[:5]))
    model = RobotConfig().model
    motor = replace(model.left, armature_resistance=resistance, back_emf_constant=back_emf)
    model = replace(
        model,
        battery=replace(
            model.battery, open_circuit_voltage=Measured(SUPPLY), internal_resistance=Measured(0.0)
        ),
        left=motor,
        right=motor,
        friction=replace(model.friction, coulomb=coulomb, viscous=viscous),
        drive=replace(model.drive, inertia_straight=inertia, inertia_turn=inertia),
    )
    robot = Parameters.from_robot(replace(RobotConfig(), model=model))
    for effect, value in zip(effects, numbers[5:].tolist(), strict=True):
        values = {EFFECTS[effect][0]: value}
        if effect == "friction.stiction":
            values["speed"] = STICTION_SPEED
        robot = robot.with_effect(effect, None, **values)
    return robot


def steps_inside(numbers: Floats, scale: Floats, high: Floats) -> Floats:
    """How far each number is moved for its column; down where it would leave its bounds."""
    steps = NEAR * np.maximum(np.abs(numbers), scale)
    return np.where(numbers + steps > high, -steps, steps)


def fitted(wheel: Wheel, effects: tuple[str, ...] = ()) -> Floats:
    """Numbers that fit the steps to 2 V and 4 V, with effects of the catalogue besides the base."""
    train = wheel.time < SPLIT

    def errors(many: Floats) -> Floats:
        """Of several sets of numbers, (wheels, rows)."""
        speed, current = _side_by_side(many, wheel, effects)
        parts = [(speed - wheel.speed)[:, train] / SPEED_SD, 0.05 * (many[:, :5] - START)]
        if wheel.current_is_plausible:
            parts.append((current - wheel.current)[:, train] / CURRENT_SD)
        return np.concatenate(parts, axis=1)

    def residuals(numbers: Floats) -> Floats:
        return np.asarray(errors(numbers[None])[0], float)

    def columns(numbers: Floats) -> Floats:
        steps = steps_inside(numbers, scale, high)
        here, *moved = errors(np.vstack([numbers, numbers + np.diag(steps)]))
        return np.asarray((np.array(moved) - here).T / steps, float)

    extra = np.array([EFFECTS[each][1:] for each in effects]).reshape(-1, 4)
    start, low, high = (
        np.concatenate([base, more]) for base, more in zip((START, LOW, HIGH), extra.T, strict=False)
    )
    scale = np.concatenate([np.full(5, 0.3), extra[:, 3]])
    return np.asarray(
        least_squares(
            residuals,
            start,
            jac=columns,
            bounds=(low, high),
            x_scale=scale,
            ftol=1e-4,
            max_nfev=40,
        ).x
    )


def supported(wheel: Wheel) -> tuple[str, ...]:
    """The effects with each of which the fitted steps are likelier, a number more counted in (BIC).

    Neighbouring residuals are alike (lag-1 correlation c), so n of them count as n (1 - c) / (1 + c).
    """
    plain = _train_errors(wheel, ())
    alike = float(np.clip(np.corrcoef(plain[1:], plain[:-1])[0, 1], 0.0, 0.999))
    count = max(8.0, len(plain) * (1.0 - alike) / (1.0 + alike))
    return tuple(
        each
        for each in EFFECTS
        if count * math.log(np.mean(plain**2) / np.mean(_train_errors(wheel, (each,)) ** 2)) > math.log(count)
    )


def _train_errors(wheel: Wheel, effects: tuple[str, ...]) -> Floats:
    speed, _ = simulated(fitted(wheel, effects), wheel, effects)
    return (speed - wheel.speed)[wheel.time < SPLIT]


def held_out(wheel: Wheel, numbers: Floats, effects: tuple[str, ...] = ()) -> Score:
    """How well the fit foresees the steps to -4 V and 0 V, run on freely from the start."""
    test = wheel.time >= SPLIT
    truth = wheel.speed[test]
    error = simulated(numbers, wheel, effects)[0][test] - truth
    centred = error - error.mean()
    return Score(
        r2=float(1.0 - np.sum(error**2) / np.sum((truth - truth.mean()) ** 2)),
        rmse=float(np.sqrt(np.mean(error**2))),
        lag1=float(np.sum(centred[1:] * centred[:-1]) / np.sum(centred**2)),
    )


@dataclass(frozen=True)
class Sag:
    """Median over robots of the RMS (V) on the part of the recordings that no fit has seen.

    plain: of the mean voltage, without sag. own: of U_oc - R_i I fitted for each robot by itself. shared: the
    same with R_i drawn towards the fleet's. floor: of a fit to the judged part itself, which no prediction
    can be below by more than chance.
    """

    plain: float
    own: float
    shared: float
    floor: float


def sag(tables: list[NDArray[np.void]], split: float) -> Sag:
    """Fit what is before `split` (s), judge what is after it.

    I is the motors' electrical power over the battery's voltage. The fleet's distribution of R_i (mean m,
    spread s) is that of the robots' own estimates less their uncertainty v, all from the fitted part; a
    robot's R_i is then the mean of its own and m, weighted by 1 / v and 1 / s^2. A robot whose current has
    the wrong sign keeps its own.
    """
    pairs = [_voltage_and_current(table) for table in tables]
    trains = [table["t_s"] < split for table in tables]
    own = np.array([_own_resistance(*pair, train) for pair, train in zip(pairs, trains, strict=True)])
    shared = _drawn_together(own)
    scores = []
    for (voltage, current), train, alone, together in zip(pairs, trains, own[:, 0], shared, strict=True):
        errors = [
            voltage[~train] - (np.mean((voltage + ohm * current)[train]) - ohm * current[~train])
            for ohm in (0.0, float(alone), float(together))
        ]
        errors.append(_residual(voltage[~train], current[~train]))
        scores.append([float(np.sqrt(np.mean(each**2))) for each in errors])
    return Sag(*(float(each) for each in np.median(scores, axis=0)))


def _voltage_and_current(table: NDArray[np.void]) -> tuple[Floats, Floats]:
    power = sum(table[f"{side}_command_V"] * table[f"{side}_current_A"] for side in ("left", "right"))
    return table["battery_V"], power / table["battery_V"]


def _residual(voltage: Floats, current: Floats) -> Floats:
    columns = np.stack([np.ones(len(current)), -current], axis=1)
    return np.asarray(voltage - columns @ np.linalg.lstsq(columns, voltage, rcond=None)[0])


def _own_resistance(voltage: Floats, current: Floats, train: NDArray[np.bool_]) -> tuple[float, float]:
    """R_i and its variance, where residuals count as one for as long as they are alike."""
    residual = _residual(voltage[train], current[train])
    deviation = current[train] - current[train].mean()
    power = float(deviation @ deviation)
    alike = np.correlate(residual, residual, "full")[len(residual) - 1 :] / float(residual @ residual)
    lasting = 1.0 + 2.0 * float(alike[1 : int(np.argmax(alike < 0.05))].sum())
    return -float(deviation @ voltage[train]) / power, float(np.var(residual)) * lasting / power


def _drawn_together(own: Floats) -> Floats:
    resistance, variance = own.T
    sound = resistance > 0.0
    mean, spread = float(np.median(resistance[sound])), float(np.var(resistance[sound]))
    for _ in range(20):
        weight = 1.0 / (spread + variance[sound])
        mean = float(weight @ resistance[sound] / weight.sum())
        spread = max(1e-5, float(np.mean((resistance[sound] - mean) ** 2 - variance[sound])))
    together = (resistance / variance + mean / spread) / (1.0 / variance + 1.0 / spread)
    return np.asarray(np.where(sound, together, resistance))
