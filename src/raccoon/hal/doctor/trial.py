"""The trial of one motor: its readings at rest and while it turns a little forward and backward."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from raccoon.core.readings import Device, Inputs
from raccoon.hal.doctor.session import Session, deviation, mean, one_motor, port_words

TRIAL_DUTY = 0.3
MOVE_S = 0.35
"""Duration of a move, s; the wheel reaches its speed after about 0.1 s and covers a few centimetres."""
SETTLE_S = 0.4
STEADY_S = 0.15
"""The last part of a move, s, in which its speed is measured."""
START_S = 0.2
"""The first part of a move, s, in which the wheel accelerates."""
SILENT_COUNTS = 60.0
"""Back-EMF in counts up to which a motor at `TRIAL_DUTY` does not move (the stock firmware suppresses 40
counts when starting)."""
STILL_TICKS = 2
"""Ticks up to which a position has not changed."""


@dataclass(frozen=True, slots=True)
class MotorMove:
    """The response of one motor to a duty of one sign.

    bemf: counts, without the offset. ticks: change of the position. integral: integral of the raw back-EMF,
    counts * s, by which the position should have changed. turn_rate: of the robot, rad/s, without the gyro's
    bias. acceleration: forward, m/s2, mean of the first `START_S` without the accelerometer's bias. latency:
    s from the first commanded cycle to the first sign of motion. None if there is no such reading.
    """

    duty: float
    bemf: float | None
    ticks: float
    integral: float | None
    turn_rate: float | None
    acceleration: float | None
    latency: float | None


@dataclass(frozen=True, slots=True)
class MotorTrial:
    """One motor at rest and moved both ways.

    offset, noise: mean and standard deviation of the back-EMF at rest, counts. battery: V. The duties of
    `moves` are those of the port, before any wiring sign.
    """

    motor_port: int
    offset: float | None
    noise: float
    battery: float | None
    moves: tuple[MotorMove, MotorMove]
    device: Device

    @property
    def has_moved(self) -> bool:
        """Whether the motor moved at all, in either direction."""
        return any(
            abs(move.ticks) > STILL_TICKS if move.bemf is None else abs(move.bemf) > SILENT_COUNTS
            for move in self.moves
        )


def try_motor(session: Session, motor_port: int) -> MotorTrial:
    """Move one motor forward, then backward, with a rest after each."""
    rest = session.run(SETTLE_S)
    readings = port_words(rest, "bemf", motor_port)
    offset = mean(readings) if readings else None
    moves = []
    for duty in (TRIAL_DUTY, -TRIAL_DUTY):
        moves.append(_move(session, motor_port, duty, offset or 0.0))
        session.run(SETTLE_S)
    battery = rest[-1].battery_voltage
    noise = deviation(readings) if readings else 0.0
    return MotorTrial(motor_port, offset, noise, battery, (moves[0], moves[1]), rest[-1].device)


def _move(session: Session, motor_port: int, duty: float, offset: float) -> MotorMove:
    before = session.cycles[-20:]
    gyro, accel = _turn_rates(before), _forward_accelerations(before)
    still = mean(gyro) if gyro else 0.0
    cycles = session.run(MOVE_S, one_motor(motor_port, duty))
    starting = _forward_accelerations([each for each in cycles if each.time < cycles[0].time + START_S])
    steady = [each for each in cycles if each.time > cycles[-1].time - STEADY_S]
    bemf = port_words(steady, "bemf", motor_port)
    positions = port_words(cycles, "position", motor_port)
    turning = _turn_rates(steady)
    return MotorMove(
        duty=duty,
        bemf=mean(bemf) - offset if bemf else None,
        ticks=positions[-1] - positions[0] if len(positions) > 1 else 0.0,
        integral=_bemf_integral(cycles, motor_port),
        turn_rate=mean(turning) - still if turning else None,
        acceleration=mean(starting) - mean(accel) if starting and accel else None,
        latency=_latency(cycles, motor_port, offset),
    )


def _turn_rates(cycles: Sequence[Inputs]) -> list[float]:
    return [rate for rate in (each.turn_rate for each in cycles) if rate is not None]


def _forward_accelerations(cycles: Sequence[Inputs]) -> list[float]:
    """m/s2, of the cycles in which the accelerometer was read."""
    return [each.device.accel_m_s2 * each.accel[0] for each in cycles if each.accel is not None]


def _bemf_integral(cycles: Sequence[Inputs], motor_port: int) -> float | None:
    steps = []
    for earlier, later in pairwise(cycles):
        word = later.bemf[motor_port]
        if word is None:
            return None
        steps.append(word * (later.time - earlier.time))
    return math.fsum(steps)


def _latency(cycles: Sequence[Inputs], motor_port: int, offset: float) -> float | None:
    """s from the first commanded cycle to the first in which the motor moves; None if none."""
    first = cycles[0]
    for each in cycles:
        word, position, start = each.bemf[motor_port], each.position[motor_port], first.position[motor_port]
        if word is not None:
            moved = abs(word - offset) > SILENT_COUNTS
        else:
            moved = position is not None and start is not None and abs(position - start) > STILL_TICKS
        if moved:
            return each.time - first.time
    return None
