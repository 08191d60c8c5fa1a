"""From the effects' parameters to the numbers of the equations."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import ConfigError
from raccoon.core.readings import BEMF_VOLTS_PER_COUNT, MOTOR_PORTS
from raccoon.sim.effects.nominal import check_nominal
from raccoon.sim.effects.parameters import SIDES, Parameters
from raccoon.sim.plant.quantities import PLANT_COLUMNS, Plant, State

Numbers = tuple[float, ...]
Floats = NDArray[np.float64]

LOOSE_STEP = 0.00105
"""Longest step (s) of a robot whose gears have play: slightly above 1 ms, so that a cycle of 5 ms with a
jittering time stamp still has five."""
MIN_COMPLIANCE = 1e-5
"""rad/(N m) below which presliding is neglected: no sensor sees it, and steps would have to be below 0.2
ms."""
MIN_CREEP = 0.002
"""rad/s below which creep is neglected: less than a count of back-EMF, and a step of 1 ms would oscillate."""
MIN_LOW_PASS = 0.00125
"""s; time constant below which a gyro's filter is neglected, half of the usual step."""
LOW_PASS_STEP = 2.0
"""Longest step in time constants of the gyro's filter: beyond it the series of its exponential fails."""
BRISTLE_STEP = 0.6
"""Longest step as a share of sqrt(compliance J), the period of the bristles' oscillation over 2 pi."""


def plant_numbers(parameters: Parameters, checked: bool = False) -> Plant:
    """The plant of a robot: nominal values and effects multiplied, signs of wiring removed.

    checked: whether the nominal values are known to be plausible. Raises ConfigError otherwise, naming one
    that no robot can have.
    """
    if not checked:
        check_nominal(parameters.robot.model)
    sides = _Sides(parameters)
    return Plant._make(
        (
            *_motor_numbers(parameters, sides),
            *_friction_numbers(sides),
            *_presliding_numbers(parameters),
            *_chassis_numbers(parameters, sides),
            *_controller_numbers(parameters, sides),
        )
    )


def _motor_numbers(parameters: Parameters, sides: _Sides) -> Numbers:
    value, chain = parameters.value, parameters.chain
    return (
        value("battery.open_circuit_voltage", "voltage"),
        # Currents are means over the pauses; those that flow together flow in the rest of the time.
        value("battery.internal_resistance", "resistance") / (1.0 - chain.coast_share * chain.together),
        value("battery.discharge", "volts_per_coulomb"),
        *sides.resistance,
        *sides.back_emf,
        # Heat is fed by means over the pauses for samples, and heated by the square while a motor is driven.
        *(gain / (1.0 - chain.coast_share) for gain in sides.of("motor.heating", "gain")),
        *(1.0 / each for each in sides.of("motor.heating", "time_constant")),
        *sides.of("motor.current_limit", "limit"),
    )


def _friction_numbers(sides: _Sides) -> Numbers:
    return (
        *sides.of("friction.coulomb", "torque"),
        *sides.of("friction.viscous", "coefficient"),
        *sides.of("friction.stiction", "torque"),
        *(1.0 / each for each in sides.of("friction.stiction", "speed")),
        *sides.of("friction.load_dependent", "coefficient"),
        *sides.of("friction.direction_dependent", "asymmetry"),
        *sides.of("friction.direction_dependent", "viscous_asymmetry"),
        *sides.of("friction.quadratic", "coefficient"),
    )


def _presliding_numbers(parameters: Parameters) -> Numbers:
    compliance = parameters.value("friction.presliding", "compliance")
    creep = parameters.value("friction.presliding", "creep")
    return (
        compliance if compliance >= MIN_COMPLIANCE else 0.0,
        parameters.value("friction.presliding", "damping"),
        creep if creep >= MIN_CREEP else 0.0,
        parameters.value("friction.presliding", "creep_tail"),
        parameters.value("friction.presliding", "break_away"),
    )


def _chassis_numbers(parameters: Parameters, sides: _Sides) -> Numbers:
    value = parameters.value
    drive = parameters.robot.model.drive
    inertia = value("drive.inertia", "factor")
    straight, turn = drive.inertia_straight.value * inertia, drive.inertia_turn.value * inertia
    slips = list(zip(*(sides.of("drive.wheel_slip", each) for each in ("time", "at_once")), strict=True))
    runout = sides.of("drive.wheel_eccentricity", "amplitude")
    phase = sides.of("drive.wheel_eccentricity", "phase")
    return (
        *(0.5 * each for each in sides.of("drive.backlash", "angle")),
        *sides.of("drive.backlash", "coasting"),
        *(time * (1.0 - share) for time, share in slips),
        *(time * share for time, share in slips),
        value("drive.turn_scrub", "torque"),
        *(drive.wheel_radius.value * each for each in sides.of("drive.wheel_radius", "factor")),
        # amplitude * sin(angle + phase), by the cosine and the sine of the wheel's angle
        *(size * math.sin(at) for size, at in zip(runout, phase, strict=True)),
        *(size * math.cos(at) for size, at in zip(runout, phase, strict=True)),
        1.0 / (drive.track_width.value * value("drive.track_width", "factor")),
        0.5 * (straight + turn),
        0.5 * (straight - turn),
        value("drive.slope", "along_x"),
        value("drive.slope", "along_y"),
        0.0,  # what a robot touches, a table says; see `world.contact`
        0.0,
    )


def _controller_numbers(parameters: Parameters, sides: _Sides) -> Numbers:
    chain = parameters.chain
    back_emf, scale = sides.back_emf, sides.of("bemf.scale", "factor")
    signs, offset = wiring_signs(parameters), sides.of("bemf.offset", "counts")
    return (
        *sides.of("actuation.deadband", "duty"),
        0.0 if chain.threshold else 1.0,
        0.0 if chain.threshold or chain.cut else 1.0,
        parameters.value("actuation.latency", "seconds"),
        1.0 - chain.coast_share,
        *(k * factor / BEMF_VOLTS_PER_COUNT for k, factor in zip(back_emf, scale, strict=True)),
        *(sign * counts for sign, counts in zip(signs, offset, strict=True)),
        *sides.of("bemf.dead_zone", "counts"),
        *(filter_rate(each) for each in sides.of("bemf.filter_lag", "time_constant")),
        filter_rate(chain.battery_time_constant),
        chain.battery_held,
        1.0 if chain.median else 0.0,
        *_dips(parameters),
        0.0,  # who knows the rows sets it; see `gyro_lag`
        *_low_pass_numbers(parameters),
        1.0 if chain.whole else 0.0,
    )


def _dips(parameters: Parameters) -> Numbers:
    """Dip of a wheel's speed below its mean at the end of a coasting pause, rad/s per N m of mean torque of
    its own and of the other motor. Between pauses a wheel gains what it loses in them, so it is off by half
    of that at their ends."""
    drive, chain = parameters.robot.model.drive, parameters.chain
    factor = 0.5 * chain.pause / parameters.value("drive.inertia", "factor")
    per_sum, per_difference = 1.0 / drive.inertia_straight.value, 1.0 / drive.inertia_turn.value
    own, other = 0.5 * (per_sum + per_difference), 0.5 * (per_sum - per_difference)
    return factor * own, factor * other * chain.together


def _low_pass_numbers(parameters: Parameters) -> Numbers:
    seconds = parameters.value("imu.low_pass", "time_constant")
    return (seconds, 1.0 / seconds) if seconds >= MIN_LOW_PASS else (0.0, 0.0)


def filter_rate(time_constant: float) -> float:
    """Rate of a filter, 1/s; for a filter without effect so large that it keeps nothing."""
    return 1.0 / time_constant if time_constant > 0.0 else 1e30


class _Sides:
    """Left and right values of a parameter."""

    def __init__(self, parameters: Parameters) -> None:
        self._value = parameters.value
        model = parameters.robot.model
        left, right = self.of("motor.armature_resistance", "factor")
        self.resistance = (
            model.left.armature_resistance.value * left,
            model.right.armature_resistance.value * right,
        )
        left, right = self.of("motor.back_emf_constant", "factor")
        self.back_emf = model.left.back_emf_constant.value * left, model.right.back_emf_constant.value * right

    def of(self, effect: str, name: str) -> tuple[float, float]:
        value = self._value
        return value(effect, name, "left"), value(effect, name, "right")


def gyro_lag(latency: Floats, row: float) -> Floats:
    """s before the end of a row of commands of `row` s at which a gyro is read that is `latency` s late: the
    part of its latency beyond whole rows."""
    whole = np.floor(latency / row + 1e-9) * row
    return np.asarray(np.maximum(latency - whole, 0.0), float)


SHORTEST = 1e-4
"""s; no drive train has a smaller mechanical time constant."""


def time_constants(plants: NDArray[np.float64]) -> NDArray[np.float64]:
    """Mechanical time constant of each robot, (robots,), s: J / (K^2 / R + B) with the smaller of the two
    inertias and a stiff battery, since a battery's resistance only makes it longer. plants: (robots, fields
    of Plant)."""
    damping = [
        _column(plants, f"back_emf_{side}") ** 2 / _column(plants, f"resistance_{side}")
        + _column(plants, f"viscous_{side}")
        for side in SIDES
    ]
    return np.asarray(_least_inertia(plants) / np.maximum(*damping), float)


def _column(plants: NDArray[np.float64], field: str) -> NDArray[np.float64]:
    return np.asarray(plants[:, PLANT_COLUMNS[field]])


def _least_inertia(plants: NDArray[np.float64]) -> NDArray[np.float64]:
    own, other = _column(plants, "inertia_own"), _column(plants, "inertia_other")
    return np.asarray(own - np.abs(other), float)


def safe_step(plants: NDArray[np.float64]) -> float:
    """The longest step (s) that resolves the fastest motion of every robot.

    It is half the mechanical time constant; a millisecond if gears have play, as a wheel that meets a tooth
    jumps, and readings are before or after; limited by the bristles' oscillation with the inertia for wheels
    with presliding, and by the gyro's filter. plants: (robots, fields of Plant). Raises ConfigError for a
    time constant below 0.1 ms, which no drive train has.
    """
    shortest = float(np.min(time_constants(plants)))
    if shortest < SHORTEST:
        raise ConfigError(
            f"the robot's mechanical time constant is {shortest} s: allowed are {SHORTEST:g} s and more"
        )
    loose = any(np.any(_column(plants, f"half_play_{side}") > 0.0) for side in SIDES)
    swing = np.sqrt(_column(plants, "compliance") * _least_inertia(plants))
    return min(
        0.5 * shortest,
        LOOSE_STEP if loose else math.inf,
        BRISTLE_STEP * _least_positive(swing),
        LOW_PASS_STEP * _least_positive(_column(plants, "low_pass")),
    )


def _least_positive(values: NDArray[np.float64]) -> float:
    """The smallest positive number, infinity if there is none."""
    return float(np.min(values, where=values > 0.0, initial=math.inf))


def sample_slots(parameters: Parameters) -> tuple[float, float]:
    """The time in the controller's cycle at which the left and the right motor are sampled (1 is its end)."""
    if parameters.chain.free_running:
        return 0.5, 0.5
    if not parameters.chain.slots:
        return 1.0, 1.0
    drive = parameters.robot.drive
    return (drive.left + 1) / MOTOR_PORTS, (drive.right + 1) / MOTOR_PORTS


def wiring_signs(parameters: Parameters) -> tuple[float, float]:
    """-1 for a side whose motor turns the wheel backwards on positive duty."""
    robot = parameters.robot
    left, right = robot.motor(robot.drive.left), robot.motor(robot.drive.right)
    return -1.0 if left.inverted else 1.0, -1.0 if right.inverted else 1.0


def state_at_rest(plant: Plant) -> State:
    """A robot at rest at the origin, with cold windings, a rested battery and settled filters."""
    return State._make(states_at_rest(np.array([plant]))[0].tolist())


def states_at_rest(plants: NDArray[np.float64]) -> NDArray[np.float64]:
    """`state_at_rest` for many robots: (robots, fields of Plant) in, (robots, fields of State) out."""
    column = {name: index for index, name in enumerate(State._fields)}
    states = np.zeros((len(plants), len(column)))
    for name in ("heading_cos", "wheel_cos_left", "wheel_cos_right"):
        states[:, column[name]] = 1.0
    for name in ("bus", "battery"):
        states[:, column[name]] = _column(plants, "open_circuit_voltage")
    for side in SIDES:
        offset = _column(plants, f"offset_{side}")
        for name in ("recent", "older", "filtered"):
            states[:, column[f"{name}_{side}"]] = offset
        dead = np.abs(offset) <= _column(plants, f"dead_zone_{side}")
        states[:, column[f"bemf_{side}"]] = np.where(dead, 0.0, offset)
    return states
