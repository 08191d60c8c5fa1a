"""The robots on which the mitigations are tried, as they were when tuned and as they are in the run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from statistics import fmean, stdev

from numpy.random import Generator, default_rng

from raccoon.core.config import RobotConfig
from raccoon.model.paper import COMPETITION_VOLTAGE, MOTORS, TESTING_VOLTAGE, PaperMotor
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import Parameters

TABLE_BATTERY = 6.6  # V, in conditions that do not vary the battery
TAPE_STD = 0.001  # m, standard deviation of a distance measured by tape
OFFSET_STD = 30.0  # counts, standard deviation of real controllers' back-EMF at rest
PAIRINGS = [(left, right) for left in range(3) for right in range(3)]
Pair = tuple[PaperMotor, PaperMotor]
Trio = tuple[PaperMotor, PaperMotor, PaperMotor]


@dataclass(frozen=True, slots=True)
class Trial:
    """One robot.

    tuned: at the time when its program was tuned and it was calibrated. run: when it is measured. fresh: both
    again, each time with a full battery instead. matched: both again, with the two best matching of three
    motors. tape: errors of its two taped distances, m. seed: of its noise.
    """

    tuned: Parameters
    run: Parameters
    fresh: tuple[Parameters, Parameters]
    matched: tuple[Parameters, Parameters]
    tape: tuple[float, float]
    seed: int


@dataclass(frozen=True, slots=True)
class Situation:
    """What differs between robots: the motors, when tuned and in the run, the battery voltages (V), and
    further effects in the run.

    motors: left, right and spare. replacement: right motor in the run, None: the same.
    """

    motors: Trio
    replacement: PaperMotor | None = None
    tuned_battery: float = TABLE_BATTERY
    run_battery: float = TABLE_BATTERY
    effects: tuple[tuple[str, dict[str, float]], ...] = ()


@dataclass(frozen=True, slots=True)
class Condition:
    """A column of the table.

    draw: the situation of a robot, from its random generator, its number and its drawn motors. robots: number
    in the full table.
    """

    draw: Callable[[Generator, int, Trio], Situation]
    robots: int


def nominal_motor() -> PaperMotor:
    """A motor with the mean constants of the paper's three."""
    return _motor(*(fmean(each) for each in _columns()))


def drawn_motor(random: Generator) -> PaperMotor:
    """A motor drawn from normal distributions with mean and standard deviation of the paper's three, no
    constant below 0.3 of its mean."""
    return _motor(*(max(0.3 * fmean(each), random.normal(fmean(each), stdev(each))) for each in _columns()))


def _columns() -> tuple[list[float], list[float], list[float]]:
    return (
        [each.current for each in MOTORS],
        [each.armature_resistance for each in MOTORS],
        [each.back_emf_constant for each in MOTORS],
    )


def _motor(current: float, resistance: float, constant: float) -> PaperMotor:
    return PaperMotor("drawn", (6.6 - current * resistance) / constant, current, resistance, constant)


def _paper_trio(number: int) -> Trio:
    """A pairing of the paper's motors, all nine in turn, with the first remaining motor as the third."""
    left, right = PAIRINGS[number % 9]
    third = min({0, 1, 2} - {left, right})
    return MOTORS[left], MOTORS[right], MOTORS[third]


def _spread_level(number: int, ratio: float) -> float:
    """Battery voltage of robot `number`, V: a sequence that covers the paper's range evenly, however many
    robots there are."""
    return TESTING_VOLTAGE + (COMPETITION_VOLTAGE - TESTING_VOLTAGE) * ((0.5 + number * ratio) % 1.0)


def _batteries(_random: Generator, number: int, _drawn: Trio) -> Situation:
    alike = (nominal_motor(),) * 3
    return Situation(
        alike, tuned_battery=TESTING_VOLTAGE, run_battery=_spread_level(number, 0.6180339887498949)
    )


def _sagging(random: Generator, _number: int, _drawn: Trio) -> Situation:
    effects = (
        ("battery.discharge", {"volts_per_coulomb": random.uniform(0.01, 0.04)}),
        ("battery.internal_resistance", {"resistance": 0.12}),
    )
    alike = (nominal_motor(),) * 3
    return Situation(alike, None, COMPETITION_VOLTAGE, COMPETITION_VOLTAGE, effects)


def _paper_pairs(_random: Generator, number: int, _drawn: Trio) -> Situation:
    return Situation(_paper_trio(number))


def _drawn_pairs(_random: Generator, _number: int, drawn: Trio) -> Situation:
    return Situation(drawn)


def _match(random: Generator, number: int, drawn: Trio) -> Situation:
    """The paper's nine pairings first, then drawn motors; the two battery voltages follow an even
    two-dimensional sequence."""
    tuned, run = (_spread_level(number, ratio) for ratio in (0.7548776662466927, 0.5698402909980532))
    effects = (
        ("battery.discharge", {"volts_per_coulomb": random.uniform(0.0, 0.02)}),
        ("battery.internal_resistance", {"resistance": random.uniform(0.05, 0.12)}),
    )
    return Situation(_paper_trio(number) if number < 9 else drawn, None, tuned, run, effects)


def _replaced(random: Generator, _number: int, drawn: Trio) -> Situation:
    return Situation(drawn, replacement=drawn_motor(random))


def _slipping(random: Generator, _number: int, drawn: Trio) -> Situation:
    return Situation(drawn, effects=(("drive.wheel_slip", {"time": random.uniform(0.005, 0.02)}),))


def _sloping(random: Generator, _number: int, drawn: Trio) -> Situation:
    along_x, along_y = (float(each) for each in random.uniform(-0.03, 0.03, 2))
    return Situation(drawn, effects=(("drive.slope", {"along_x": along_x, "along_y": along_y}),))


BATTERY, PAPER, DRAWN, REPLACED, MATCH = (
    "battery 6.1-7.0 V",
    "paper's motors",
    "drawn motors",
    "motor replaced",
    "motors and battery",
)
CONDITIONS: dict[str, Condition] = {
    BATTERY: Condition(_batteries, 24),
    "battery sags": Condition(_sagging, 24),
    PAPER: Condition(_paper_pairs, 27),
    DRAWN: Condition(_drawn_pairs, 200),
    MATCH: Condition(_match, 59),
    REPLACED: Condition(_replaced, 50),
    "wheel slip": Condition(_slipping, 30),
    "slope": Condition(_sloping, 30),
}
"""The conditions by name; docs/mitigations.md describes each of them."""


def trial(condition: str, number: int, seed: int, config: RobotConfig, tape_std: float = TAPE_STD) -> Trial:
    """Robot `number` of a condition. It is the same for every mitigation, and its drawn motors are the same
    in every condition. tape_std: m."""
    motors = default_rng((seed, number))
    drawn = drawn_motor(motors), drawn_motor(motors), drawn_motor(motors)
    random = default_rng((seed, list(CONDITIONS).index(condition), number))
    case = CONDITIONS[condition].draw(random, number, drawn)
    base = _body(config, random)

    def pair(motors: Pair, tuned: float, run: float) -> tuple[Parameters, Parameters]:
        before = _with_motors(base, motors, tuned)
        after = motors if case.replacement is None else (motors[0], case.replacement)
        now = _with_motors(base, after, run)
        for effect, values in case.effects:
            now = now.with_effect(effect, None, **values)
        return before, now

    tuned, run = pair(case.motors[:2], case.tuned_battery, case.run_battery)
    full = COMPETITION_VOLTAGE
    first, second = (tape_std * float(each) for each in random.standard_normal(2))
    return Trial(
        tuned,
        run,
        pair(case.motors[:2], full + random.normal(0.0, 0.03), full + random.normal(0.0, 0.03)),
        pair(_closest(case.motors), case.tuned_battery, case.run_battery),
        (first, second),
        int(random.integers(1 << 31)),
    )


def _closest(motors: Trio) -> Pair:
    """The two of three motors whose free speeds differ least."""
    pairs = ((motors[0], motors[1]), (motors[0], motors[2]), (motors[1], motors[2]))
    return min(pairs, key=lambda pair: abs(pair[0].speed - pair[1].speed))


def _body(config: RobotConfig, random: Generator) -> Parameters:
    """A robot whose true track width and gyro scale scatter by the standard deviations in robot.toml and
    whose back-EMF has offsets, behind the firmware's filters."""
    track, gyro = config.model.drive.track_width, config.model.imu.gyro_scale
    body = Parameters.from_robot(config).with_chain(Chain.firmware())
    body = body.with_effect("drive.track_width", factor=random.normal(1.0, track.std / track.value))
    body = body.with_effect("imu.gyro_scale", factor=random.normal(1.0, gyro.std / gyro.value))
    for side in ("left", "right"):
        body = body.with_effect("bemf.offset", side, counts=random.normal(0.0, OFFSET_STD))
    return body


def _with_motors(body: Parameters, motors: Pair, battery: float) -> Parameters:
    model = body.robot.model
    parameters = body.with_effect("battery.open_circuit_voltage", voltage=battery)
    for side, motor in zip(("left", "right"), motors, strict=True):
        nominal = model.left if side == "left" else model.right
        resistance = motor.armature_resistance / nominal.armature_resistance.value
        constant = motor.back_emf_constant / nominal.back_emf_constant.value
        # Friction torque from the free-running current, less its viscous part.
        coulomb = max(0.02, motor.friction_torque - model.friction.viscous.value * motor.speed)
        parameters = (
            parameters.with_effect("motor.armature_resistance", side, factor=resistance)
            .with_effect("motor.back_emf_constant", side, factor=constant)
            .with_effect("friction.coulomb", side, torque=coulomb)
        )
    return parameters
