"""Base coordinates: the numbers that robot.toml leaves open and that every fit may change, with their bounds.

robot.toml gives most of them with a standard deviation. Others are not in it: how wheels slide, a loop's own
delay, whether the gyro's chip filters.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import fields, replace
from enum import Enum, auto
from typing import Any

from raccoon.core.config import Measured, NominalModel, RobotConfig
from raccoon.diagnose.hypotheses.coordinates import Coordinate, additive_coordinate, multiplicative_coordinate
from raccoon.sim.effects.parameters import SIDES

MAX_BASE_STDS = 3.5
"""Bound of a base number, in standard deviations around robot.toml's value, within which it is refitted
without being reported."""


class WheelSliding(Enum):
    """How wheels slide: only beyond friction (RIGID), after a small deflection of bristles that slowly let go
    (COMPLIANT) or are elastic up to most of the friction (ELASTO_PLASTIC), or slowly at every torque
    (CREEPING)."""

    RIGID = auto()
    COMPLIANT = auto()
    CREEPING = auto()
    ELASTO_PLASTIC = auto()


PRESLIDING = {"compliance": 0.001, "damping": 0.3}
"""Deflection of a wheel before it slides: compliance in rad/(N m), damping in N m s/rad. robot.toml does not
contain it, and it is no cause: every gear is slightly compliant, and how a robot stops shows by how much."""
PRESLIDING_WIDTH = 0.7
"""Standard deviation of the logarithm of both: a factor of two."""
PRESLIDING_BOUNDS = {"compliance": (-1.7, 4.9), "damping": (-1.7, 1.7)}
"""Bounds of both in standard deviations: from three tenths to thirty times the compliance and three times the
damping. Stiffer wheels need steps shorter than a millisecond, and differ from rigid ones by less than a
reading's noise. Rubber is more compliant than gears, and compliance that the bounds exclude is made up for by
less resistance with more inertia and friction: along that scale only the compliance changes."""
BREAK_AWAY, BREAK_AWAY_WIDTH, BREAK_AWAY_BOUNDS = 0.85, 0.1, (-1.7, 1.2)
"""Part of its level up to which elasto-plastic friction is elastic, the standard deviation of its logarithm,
and its bounds in standard deviations: from 0.72 to 0.96. A fit that may go lower ends at bristles that let go
at once, with a tenth of the compliance."""
CREEP_SPEED, CREEP_TAIL = 0.05, 0.5
"""Speed in rad/s at which creeping friction is near its level, known to a factor of two as well, and the
standard deviation of a number from 0 to 1 for how gradually it reaches that level."""
LOW_PASS, LOW_PASS_WIDTH, LOW_PASS_MAX_STDS = 1.0 / (2.0 * math.pi * 41.0), 0.4, 1.2
"""Time constant in s of a gyro's chip that filters at 41 Hz, as the Wombat's firmware sets it, the standard
deviation of its logarithm, and its bound in standard deviations. A larger lag remains a wheel's slip."""
LOW_PASS_DELAY, LOW_PASS_DELAY_MAX_STDS = 0.0025, 2.0
"""Standard deviation in s of the additional delay of the gyro's reading, and its bound in standard
deviations: a filter of second order is nearly one of first order and a delay, and an IMU has its own clock,
so that the reading in a row of 5 ms is up to 5 ms old."""
SAMPLE_PHASE_STD = 0.005 / math.sqrt(12.0)
"""Standard deviation in s of the age of a row's sample, and of the delay of its command, if the controller's
cycle of 5 ms is not the row's. A filter that is slower by as much gives nearly the same readings."""
SELF_DISCHARGE, SELF_DISCHARGE_MAX_STDS = 0.0004, 3.0
"""Standard deviation in V/C of any battery's loss of voltage while it is driven, and its bound in standard
deviations: the voltage also creeps after the current, by some mV in ten seconds, and continues to do so."""
WHEEL_STD_SHARE = 0.25
"""Standard deviation of each wheel's offset from a number of both wheels, relative to that number's in
robot.toml. With 0 a friction of one wheel that is 2 % higher was reported as its stiction, or as its K_E and
radius. With 0.5 that was no rarer, and the gain on unseen data had a tenth percentile of 0.945 instead of
0.965."""
LOOP_LATENCY = 0.0003
"""Standard deviation in s of the delay of commands by a controller's own work. It is in no robot.toml, and a
fifth of a millisecond is no fault for a team, though every reading shows it."""
WOMBAT_LATENCY = 0.0025
"""The same for a Wombat: a command waits for the link and then for its motor's turn, up to a cycle of 5.5 ms
each. With less, one of eight fault-free robots had a latency of 4.3 ms."""


MAX_KEYS_LISTED = 4
"""Number of numbers without a standard deviation that a note lists."""


def with_default_stds(robot: RobotConfig) -> tuple[RobotConfig, tuple[str, ...]]:
    """The robot with default standard deviations for those of the model's numbers that have none, and the
    keys of these.

    robot.toml may give a number without a standard deviation. If it were taken as exact, a small deviation of
    it would be reported as a cause, and other, correct numbers with it. The default is the same relative
    standard deviation as in the nominal model; for a number that may be 0, such as an offset, it is the
    nominal model's absolute one. A resistance or a friction of 0 means that there is none, and stays exact.
    """
    default, model, keys = NominalModel(), robot.model, []
    sections: dict[str, Any] = {}
    for section in fields(model):
        own, usual = getattr(model, section.name), getattr(default, section.name)
        changed = {}
        for each in fields(own):
            number, typical = getattr(own, each.name), getattr(usual, each.name)
            std = typical.std if typical.value == 0.0 else abs(number.value / typical.value) * typical.std
            if number.std == 0.0 and std > 0.0:
                changed[each.name] = replace(number, std=std)
                place = f"motor.{section.name}" if section.name in SIDES else section.name
                keys.append(f"model.{place}.{each.name}")
        sections[section.name] = replace(own, **changed)
    return replace(robot, model=replace(model, **sections)), tuple(keys)


def describe_missing_stds(keys: Sequence[str]) -> tuple[str, ...]:
    """The note that numbers of robot.toml without a std were not taken as exact; empty for no keys."""
    right_keys = [each.replace("left", "right") for each in keys if ".left." in each]
    on_both = [each for each in right_keys if each in keys]
    shown = [each.replace(".left", "") if each.replace("left", "right") in on_both else each for each in keys]
    listed = [each for each in dict.fromkeys(shown) if each not in on_both]
    if not listed:
        return ()
    named = ", ".join(listed[:MAX_KEYS_LISTED])
    more = f" and {len(listed) - MAX_KEYS_LISTED} more" if len(listed) > MAX_KEYS_LISTED else ""
    return (
        f"robot.toml gives no std for {named}{more}: the default's is used, scaled to the value; write "
        "{ value = ..., std = ... } where you know better, with a tiny std for an exact number",
    )


def base_coordinates(
    robot: RobotConfig,
    inside: float = MAX_BASE_STDS,
    sliding: WheelSliding = WheelSliding.COMPLIANT,
    low_pass: bool = False,
    free_running: bool = False,
    wombat: bool = False,
    fit_sample_ages: bool = False,
) -> tuple[Coordinate, ...]:
    """All base coordinates: one for each number of robot.toml with a standard deviation above 0, and those of
    numbers that it does not contain.

    inside: bound of each number in standard deviations. sliding: how wheels slide. low_pass: whether the gyro
    has a low-pass. free_running: whether the controller's cycle has its own clock. wombat: whether controller
    and gyro are known to be a Wombat's, whose own delays are more likely than any fault. fit_sample_ages:
    whether each motor's sample age has its own coordinate, so that the filter lag need not include it.
    """
    model = robot.model
    return (
        *_battery(model, inside),
        *_motors(robot, inside),
        *_friction(model, inside),
        *_presliding(sliding, inside),
        *_delays(model, inside, free_running, wombat, fit_sample_ages),
        *_gyro(robot, inside, low_pass, wombat),
        *_drive(model, inside),
    )


def _additive(
    id: str,  # noqa: A002
    where: str | None,
    parameter: str,
    number: Measured,
    inside: float,
) -> Iterator[Coordinate]:
    if number.std > 0.0:
        yield additive_coordinate(id, where, parameter, number.std, low=-inside, high=inside)


def _multiplicative(
    id: str,  # noqa: A002
    where: str | None,
    number: Measured,
    inside: float,
    parameter: str = "factor",
) -> Iterator[Coordinate]:
    if number.std > 0.0:
        yield multiplicative_coordinate(id, where, number.std / number.value, -inside, inside, parameter)


def _battery(model: NominalModel, inside: float) -> Iterator[Coordinate]:
    yield from _additive(
        "battery.open_circuit_voltage", None, "voltage", model.battery.open_circuit_voltage, inside
    )
    yield from _additive(
        "battery.internal_resistance", None, "resistance", model.battery.internal_resistance, inside
    )
    id_, high = "battery.discharge", SELF_DISCHARGE_MAX_STDS
    yield additive_coordinate(id_, None, "volts_per_coulomb", SELF_DISCHARGE, low=0.0, high=high)


def _motors(robot: RobotConfig, inside: float) -> Iterator[Coordinate]:
    model = robot.model
    ports = robot.drive.left, robot.drive.right
    for side, motor, port in zip(SIDES, (model.left, model.right), ports, strict=True):
        yield from _multiplicative("motor.armature_resistance", side, motor.armature_resistance, inside)
        yield from _multiplicative("motor.back_emf_constant", side, motor.back_emf_constant, inside)
        yield from _multiplicative("drive.wheel_radius", side, model.drive.wheel_radius, inside)
        offset = robot.motor(port).bemf_offset or model.bemf.offset
        yield from _additive("bemf.offset", side, "counts", offset, inside)


def _friction(model: NominalModel, inside: float) -> Iterator[Coordinate]:
    for place in (None, *SIDES):  # one number for both wheels, and each wheel's offset
        coulomb, viscous = (
            _for_place(each, place) for each in (model.friction.coulomb, model.friction.viscous)
        )
        if coulomb.value > 0.0:
            yield from _multiplicative("friction.coulomb", place, coulomb, inside, "torque")
        else:
            yield from _additive("friction.coulomb", place, "torque", coulomb, inside)
        yield from _additive("friction.viscous", place, "coefficient", viscous, inside)


def _for_place(number: Measured, place: str | None) -> Measured:
    """A number of both wheels (place None), or the same with the standard deviation of one wheel's offset
    from it."""
    return number if place is None else replace(number, std=WHEEL_STD_SHARE * number.std)


def _presliding(wheels: WheelSliding, inside: float) -> Iterator[Coordinate]:
    id_, width = "friction.presliding", PRESLIDING_WIDTH
    if wheels is WheelSliding.ELASTO_PLASTIC:
        low, high = BREAK_AWAY_BOUNDS
        yield multiplicative_coordinate(id_, None, BREAK_AWAY_WIDTH, low, high, "break_away", BREAK_AWAY)
    if wheels in (WheelSliding.COMPLIANT, WheelSliding.ELASTO_PLASTIC):
        for parameter, usual in PRESLIDING.items():
            low, high = PRESLIDING_BOUNDS[parameter]
            yield multiplicative_coordinate(id_, None, width, low, high, parameter, usual)
    if wheels is WheelSliding.CREEPING:
        yield multiplicative_coordinate(id_, None, width, -inside, inside, "creep", CREEP_SPEED)
        yield additive_coordinate(id_, None, "creep_tail", CREEP_TAIL, 0.0, 1.0 / CREEP_TAIL)


def _delays(
    model: NominalModel, inside: float, free_running: bool, wombat: bool, any_moment: bool
) -> Iterator[Coordinate]:
    lag, delay = model.bemf.filter_time_constant, WOMBAT_LATENCY if wombat else LOOP_LATENCY
    if free_running:
        delay = math.hypot(delay, SAMPLE_PHASE_STD)
        if lag.std > 0.0 and not any_moment:
            lag = replace(lag, std=math.hypot(lag.std, SAMPLE_PHASE_STD))
    for side in SIDES:  # one filter; the sample's time in the cycle is in no document to a millisecond
        yield from _additive("bemf.filter_lag", side, "time_constant", lag, inside)
    yield additive_coordinate("actuation.latency", None, "seconds", delay, low=0.0, high=MAX_BASE_STDS)


def _gyro(robot: RobotConfig, inside: float, low_pass: bool, wombat: bool) -> Iterator[Coordinate]:
    imu = robot.model.imu
    yield from _additive("imu.gyro_bias", None, "rate", imu.gyro_bias, inside)
    yield from _multiplicative("imu.gyro_scale", None, imu.gyro_scale, inside)
    if low_pass:
        bound = LOW_PASS_MAX_STDS
        yield multiplicative_coordinate(
            "imu.low_pass", None, LOW_PASS_WIDTH, -bound, bound, "time_constant", LOW_PASS
        )
        delay_std = max(LOW_PASS_DELAY, 0.5 / robot.controller.rate_hz)
        yield additive_coordinate(
            "imu.latency",
            None,
            "seconds",
            delay_std,
            low=0.0,
            high=MAX_BASE_STDS if wombat else LOW_PASS_DELAY_MAX_STDS,
        )


def _drive(model: NominalModel, inside: float) -> Iterator[Coordinate]:
    drive = model.drive
    yield from _multiplicative("drive.track_width", None, drive.track_width, inside)
    for kind, number in (("straight", drive.inertia_straight), ("turn", drive.inertia_turn)):
        if number.std > 0.0:
            yield _inertia(kind, number.std / number.value, inside)


def _inertia(kind: str, width: float, inside: float) -> Coordinate:
    keys = (("inertia", None, kind),)
    return Coordinate(f"drive.inertia_{kind}", keys, lambda u: math.exp(width * u), True, -inside, inside)
