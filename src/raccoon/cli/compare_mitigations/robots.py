"""The robots that the mitigations are tried on: as they were tuned, and as they come to the table."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from statistics import fmean, stdev

from numpy.random import Generator, default_rng

from raccoon.core.config import RobotConfig
from raccoon.model.paper import COMPETITION_VOLTAGE, MOTORS, TESTING_VOLTAGE, PaperMotor
from raccoon.sim.parameters import Parameters

TABLE_BATTERY = 6.6  # V, where the battery is not what differs
Pair = tuple[PaperMotor, PaperMotor]


@dataclass(frozen=True, slots=True)
class Trial:
    """One robot. tuned: when its program was made and it was calibrated; run: when it counts.

    fresh: the same run with a full battery in the place of whatever is in it, both times. matched: with the
    two best matching of three motors.
    """

    tuned: Parameters
    run: Parameters
    fresh: tuple[Parameters, Parameters]
    matched: tuple[Parameters, Parameters]
    seed: int


@dataclass(frozen=True, slots=True)
class Situation:
    """What differs: the motors when tuned and in the run, the batteries, and anything else in the run."""

    motors: tuple[PaperMotor, PaperMotor, PaperMotor]
    replacement: PaperMotor | None = None
    tuned_battery: float = TABLE_BATTERY
    run_battery: float = TABLE_BATTERY
    effects: tuple[tuple[str, dict[str, float]], ...] = ()


def nominal_motor() -> PaperMotor:
    """The middle of the paper's three."""
    return _motor(*(fmean(each) for each in _columns()))


def drawn_motor(random: Generator) -> PaperMotor:
    """One from the spread of the paper's three."""
    return _motor(*(max(0.3 * fmean(each), random.normal(fmean(each), stdev(each))) for each in _columns()))


def _columns() -> tuple[list[float], list[float], list[float]]:
    return (
        [each.current for each in MOTORS],
        [each.armature_resistance for each in MOTORS],
        [each.back_emf_constant for each in MOTORS],
    )


def _motor(current: float, resistance: float, constant: float) -> PaperMotor:
    return PaperMotor("drawn", (6.6 - current * resistance) / constant, current, resistance, constant)


def _alike(_random: Generator) -> Situation:
    return Situation((nominal_motor(),) * 3)


def _batteries(random: Generator) -> Situation:
    voltage = random.uniform(TESTING_VOLTAGE, COMPETITION_VOLTAGE)
    return replace(_alike(random), tuned_battery=TESTING_VOLTAGE, run_battery=voltage)


def _sagging(random: Generator) -> Situation:
    effects = (
        ("battery.discharge", {"volts_per_coulomb": random.uniform(0.01, 0.04)}),
        ("battery.internal_resistance", {"resistance": 0.12}),
    )
    return replace(_alike(random), tuned_battery=COMPETITION_VOLTAGE, run_battery=7.0, effects=effects)


def _paper_pairs(random: Generator) -> Situation:
    order = random.permutation(3)
    if random.random() < 1.0 / 3.0:
        order[1] = order[0]  # the pairings include two of a kind
    return Situation((MOTORS[order[0]], MOTORS[order[1]], MOTORS[order[2]]))


def _spread(random: Generator) -> Situation:
    return Situation((drawn_motor(random), drawn_motor(random), drawn_motor(random)))


def _replaced(random: Generator) -> Situation:
    return replace(_spread(random), replacement=drawn_motor(random))


def _slipping(random: Generator) -> Situation:
    slip = ("drive.wheel_slip", {"time": random.uniform(0.005, 0.02)})
    return replace(_spread(random), effects=(slip,))


def _sloping(random: Generator) -> Situation:
    along_x, along_y = random.uniform(-0.03, 0.03, 2)
    return replace(
        _spread(random), effects=(("drive.slope", {"along_x": float(along_x), "along_y": float(along_y)}),)
    )


CONDITIONS: dict[str, Callable[[Generator], Situation]] = {
    "battery 6.1-7.0 V": _batteries,
    "battery sags": _sagging,
    "paper's motors": _paper_pairs,
    "drawn motors": _spread,
    "motor replaced": _replaced,
    "wheel slip": _slipping,
    "slope": _sloping,
}


def trial(condition: str, number: int, seed: int, config: RobotConfig) -> Trial:
    """Robot `number` of a condition; the same for every mitigation."""
    place = list(CONDITIONS).index(condition)
    random = default_rng((seed, place, number))
    case = CONDITIONS[condition](random)
    first, second, _ = case.motors
    closest = _closest(case.motors)

    def pair(motors: Pair, tuned: float, run: float) -> tuple[Parameters, Parameters]:
        before = _parameters(config, motors, tuned)
        after = motors if case.replacement is None else (motors[0], case.replacement)
        now = _parameters(config, after, run)
        for effect, values in case.effects:
            now = now.with_effect(effect, None, **values)
        return before, now

    tuned, run = pair((first, second), case.tuned_battery, case.run_battery)
    full = COMPETITION_VOLTAGE
    return Trial(
        tuned,
        run,
        pair((first, second), full + random.normal(0.0, 0.03), full + random.normal(0.0, 0.03)),
        pair(closest, case.tuned_battery, case.run_battery),
        int(random.integers(1 << 31)),
    )


def _closest(motors: tuple[PaperMotor, PaperMotor, PaperMotor]) -> Pair:
    """The two of three whose free speeds differ least."""
    pairs = ((motors[0], motors[1]), (motors[0], motors[2]), (motors[1], motors[2]))
    return min(pairs, key=lambda pair: abs(pair[0].speed - pair[1].speed))


def _parameters(config: RobotConfig, motors: Pair, battery: float) -> Parameters:
    parameters = Parameters.from_robot(config).with_effect("battery.open_circuit_voltage", voltage=battery)
    for side, motor in zip(("left", "right"), motors, strict=True):
        nominal = getattr(config.model, side)
        resistance = motor.armature_resistance / nominal.armature_resistance.value
        constant = motor.back_emf_constant / nominal.back_emf_constant.value
        # What the free-running current says of friction, less its viscous part.
        coulomb = max(0.02, motor.friction_torque - config.model.friction.viscous.value * motor.speed)
        parameters = (
            parameters.with_effect("motor.armature_resistance", side, factor=resistance)
            .with_effect("motor.back_emf_constant", side, factor=constant)
            .with_effect("friction.coulomb", side, torque=coulomb)
        )
    return parameters
