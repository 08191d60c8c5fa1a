"""What robot.toml leaves open: the numbers that every fit may move, and how far.

It gives most of them with a standard deviation. Of others it says nothing: how wheels slide, a loop's own
delay, whether the gyro's chip smooths.
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
"""Standard deviations around robot.toml's value inside which a parameter is refitted silently."""


class WheelSliding(Enum):
    """How wheels slide: at once, giving a little before, or creeping at every torque."""

    RIGID = auto()
    COMPLIANT = auto()
    CREEPING = auto()


PRESLIDING = {"compliance": 0.001, "damping": 0.3}
"""rad/(N m) and N m s/rad: how much a wheel gives before it slides. robot.toml does not say, and it is no
cause: every gear gives a little, and what a robot does when it stops shows how much."""
PRESLIDING_WIDTH = 0.7
"""Of the logarithm of both: a factor of two is one standard deviation."""
PRESLIDING_MAX_STDS = 1.7
"""Standard deviations of both: three tenths to three times. Stiffer wheels ask for shorter steps than a
millisecond, and differ from rigid ones by less than a reading's noise."""
CREEP_SPEED, CREEP_TAIL = 0.05, 0.5
"""rad/s, known to a factor of two as well, and the standard deviation of a number from 0 to 1: the speed at
which friction that creeps is near its level, and how gradually."""
LOW_PASS, LOW_PASS_WIDTH, LOW_PASS_MAX_STDS = 1.0 / (2.0 * math.pi * 41.0), 0.4, 1.2
"""s of a gyro's chip that filters at 41 Hz, as the Wombat's firmware sets it, the standard deviation of its
logarithm, and how many of them it may be off. Wheels that slip by more stay wheels that slip."""
LOW_PASS_DELAY, LOW_PASS_DELAY_MAX_STDS = 0.0025, 2.0
"""s, one standard deviation of what its reading is late by beside that, and how many of them it may be: one
of second order is nearly one of first order and a delay, and an IMU has a clock of its own, so that a row of
5 ms takes a reading from none to as much old."""
SAMPLE_PHASE_STD = 0.005 / math.sqrt(12.0)
"""s, one standard deviation of how old the sample of a row is where the controller's cycle of 5 ms is not the
row's, and of when its command is taken up. A filter that is slower by as much reads nearly the same."""
SELF_DISCHARGE, SELF_DISCHARGE_MAX_STDS = 0.0004, 3.0
"""V/C, one standard deviation of what any battery loses while it is driven, and how many it may be: its
voltage also creeps after the current, by some mV in ten seconds, and goes on doing so."""
WHEEL_STD_SHARE = 0.25
"""Part of robot.toml's standard deviation of a number of both wheels by which each differs from it. With none
a friction of one wheel that is 2 % higher was its stiction, or its K_E and radius. With 0.5 there were no
fewer such, and what is gained on unseen data had a tenth percentile of 0.945 instead of 0.965."""
LOOP_LATENCY = 0.0003
"""s, one standard deviation of what a controller's own work delays commands by. No robot.toml says, and a
fifth of a millisecond is a cause to no team, though it shows in every reading."""
WOMBAT_LATENCY = 0.0025
"""The same of a Wombat: a command waits for the link and then for its motor's turn, up to a cycle of 5.5 ms
each. With less, one of eight sound robots had a latency of 4.3 ms."""


MAX_KEYS_LISTED = 4
"""Numbers without a deviation that a note lists."""


def with_default_stds(robot: RobotConfig) -> tuple[RobotConfig, tuple[str, ...]]:
    """The robot with the default's standard deviation where a number of the model has none, and their keys.

    robot.toml may give a number alone. Taken as exact, whatever is a little off is a cause, and what is right
    beside it too. The deviation is the default's part of the value; of a number that may be 0, such as an
    offset, it is the default's own. A resistance or a friction of 0 is none at all, and stays exact.
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
    """That numbers of robot.toml were not taken as exact."""
    both = [each.replace("left", "right") for each in keys if ".left." in each]
    alike = [each for each in both if each in keys]
    shown = [each.replace(".left", "") if each.replace("left", "right") in alike else each for each in keys]
    said = [each for each in dict.fromkeys(shown) if each not in alike]
    if not said:
        return ()
    named = ", ".join(said[:MAX_KEYS_LISTED])
    more = f" and {len(said) - MAX_KEYS_LISTED} more" if len(said) > MAX_KEYS_LISTED else ""
    return (
        f"robot.toml gives no std for {named}{more}: taken as well known as by default; write "
        "{ value = ..., std = ... } where you know better, with a tiny std for what is exact",
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
    """What robot.toml leaves open: one coordinate for each number with a standard deviation above 0.

    inside: standard deviations that a number may move. wheels: how they slide, of which it
    says nothing. low_pass: whether the gyro has one. free_running: whether the controller's cycle has a clock
    of its own. wombat: whether controller and gyro are known to be a Wombat's, whose own delays are likelier
    than any fault. any_moment: whether when each motor is sampled is a number of its own.
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
    id_, most = "battery.discharge", SELF_DISCHARGE_MAX_STDS
    yield additive_coordinate(id_, None, "volts_per_coulomb", SELF_DISCHARGE, low=0.0, high=most)


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
    for place in (None, *SIDES):  # robot.toml has one number of both wheels, which each has about
        coulomb, viscous = (
            _for_place(each, place) for each in (model.friction.coulomb, model.friction.viscous)
        )
        if coulomb.value > 0.0:
            yield from _multiplicative("friction.coulomb", place, coulomb, inside, "torque")
        else:
            yield from _additive("friction.coulomb", place, "torque", coulomb, inside)
        yield from _additive("friction.viscous", place, "coefficient", viscous, inside)


def _for_place(number: Measured, place: str | None) -> Measured:
    """A number of both wheels, or what one of them may differ from it by."""
    return number if place is None else replace(number, std=WHEEL_STD_SHARE * number.std)


def _presliding(wheels: WheelSliding, inside: float) -> Iterator[Coordinate]:
    id_, width, most = "friction.presliding", PRESLIDING_WIDTH, PRESLIDING_MAX_STDS
    if wheels is WheelSliding.COMPLIANT:
        for parameter, usual in PRESLIDING.items():
            yield multiplicative_coordinate(id_, None, width, -most, most, parameter, usual)
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
    for side in SIDES:  # one filter, and a sample whose moment in the cycle no document says to a millisecond
        yield from _additive("bemf.filter_lag", side, "time_constant", lag, inside)
    yield additive_coordinate("actuation.latency", None, "seconds", delay, low=0.0, high=MAX_BASE_STDS)


def _gyro(robot: RobotConfig, inside: float, low_pass: bool, wombat: bool) -> Iterator[Coordinate]:
    imu = robot.model.imu
    yield from _additive("imu.gyro_bias", None, "rate", imu.gyro_bias, inside)
    yield from _multiplicative("imu.gyro_scale", None, imu.gyro_scale, inside)
    if low_pass:
        most = LOW_PASS_MAX_STDS
        yield multiplicative_coordinate(
            "imu.low_pass", None, LOW_PASS_WIDTH, -most, most, "time_constant", LOW_PASS
        )
        late = max(LOW_PASS_DELAY, 0.5 / robot.controller.rate_hz)
        yield additive_coordinate(
            "imu.latency",
            None,
            "seconds",
            late,
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
