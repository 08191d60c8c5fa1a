"""One robot along rows of commands: latency, the controller's cycles and the steps inside them.

A part of the plant's source text (see equations); `lanes` makes the form for many robots from the same
functions.
"""

from __future__ import annotations

from typing import Any

from raccoon.sim.plant.equations import substep
from raccoon.sim.plant.quantities import Command, Plant, State
from raccoon.sim.plant.sensing import duty_at_motor, kept_shares, period_of, sensed
from raccoon.sim.plant.series import within_unit

Order = tuple[float, float, float, float]
NEVER = 1e30  # s


def cycle_count(dt: float, cycle: float) -> int:
    """Number of controller cycles in a row of `dt` seconds. cycle: nominal length of a cycle, s."""
    return max(1, int(dt / cycle + 0.5))


def step_count(dt: float, longest_step: float) -> int:
    """Number of equal steps in a cycle of `dt` seconds, such that none is longer than `longest_step`
    seconds."""
    return max(1, int(dt / longest_step + 0.999999))


def in_force(times: Any, row: int, latency: float) -> int:
    """Row of the command that is in force at the start of `row`, given `latency` s late; -1 before the first
    one."""
    moment = times[row] - latency
    index = row
    while index >= 0 and times[index] > moment:
        index -= 1
    return index


def change_time(times: Any, row: int, index: int, latency: float) -> float:
    """Time after the start of `row` at which the command after `index` takes over, s."""
    return times[index + 1] + latency - times[row] if index < row else NEVER


def order_of(commands: Any, row: int) -> Order:
    """The order of a row: duty left, right, bridge closed left, right; before the first row nothing is
    connected."""
    index = row if row >= 0 else 0
    here = 1.0 if row >= 0 else 0.0
    return (
        commands[0][index] * here,
        commands[1][index] * here,
        commands[2][index] * here,
        commands[3][index] * here,
    )


def sample_place(slot: float, steps: int, step: int) -> float:
    """Where in a step, above 0 up to 1 (its end), a motor is sampled whose slot ends at `slot` (0..1) of the
    cycle; 0 if it is sampled in another step."""
    place = slot * steps - step
    place = place if place > 0.0 else 0.0
    return place if place <= 1.0 else 0.0


def effective(p: Plant, order: Order) -> Order:
    """An order as the motors receive it, after deadband and sampling pauses."""
    return (
        duty_at_motor(order[0], p.deadband_left, p.deadband_lost, p.deadband_stretched),
        duty_at_motor(order[1], p.deadband_right, p.deadband_lost, p.deadband_stretched),
        order[2] * p.closed_share,
        order[3] * p.closed_share,
    )


def mixed(older: Order, newer: Order, share: float) -> Order:
    """The mean order in a step during which the older order holds for `share` of the time, then the newer
    one."""
    left, closed_left = over_both(older[0], older[2], newer[0], newer[2], share)
    right, closed_right = over_both(older[1], older[3], newer[1], newer[3], share)
    return left, right, closed_left, closed_right


def over_both(
    older: float, older_closed: float, newer: float, newer_closed: float, share: float
) -> tuple[float, float]:
    """Mean duty and closed share of one bridge in a step in which an older order holds for `share` of the
    time and then a newer one.

    The closed share is the mean of both. The duty is the mean over the time in which the bridge is closed:
    the product of the two drives the motor, and a motor that starts from coasting, at duty 0, gets the full
    voltage of the newer order from then on. If both orders are the same, the result is that order to the last
    bit.
    """
    closed = newer_closed + share * (older_closed - newer_closed)
    part = older_closed * share / (closed if closed > 0.0 else 1.0)
    return newer + part * (older - newer), closed


def command(order: Order, sample_left: float, sample_right: float, to_go: float) -> Command:
    """An order as the command of one step. sample_left, sample_right: where in the step the motors are
    sampled. to_go: s from the end of the step to the end of its row."""
    return Command(order[0], order[1], order[2], order[3], sample_left, sample_right, to_go)


def advance(
    s: State, p: Plant, commands: Any, times: Any, begin: int, end: int,
    cycle: float, longest_step: float, slots: tuple[float, float], noise: Any, kept: Any, out: Any,
) -> State:  # fmt: skip
    """Advance one robot from times[begin] to times[end]; the command of row r is given at times[r]. Returns
    the state.

    commands: duty left, duty right, closed left, closed right, one entry per row each. cycle: of the
    controller, s. longest_step: s. slots: where in a cycle the motors are sampled, 1 is its end. noise:
    counts on each raw back-EMF sample (left, right), used in order and again from the start when exhausted.
    kept: indices of the state's fields to record; out[i, r] gets field kept[i] at times[begin + r + 1].
    """
    turn = 0
    period = -1.0
    keeps = (0.0, 0.0, 0.0)
    for row in range(begin, end):
        dt = times[row + 1] - times[row]
        cycles = cycle_count(dt, cycle)
        if period != period_of(dt / cycles, cycle):
            period = period_of(dt / cycles, cycle)
            keeps = kept_shares(p, period)
        steps = step_count(dt / cycles, longest_step)
        h = dt / (cycles * steps)
        per_h = 1.0 / h
        index = in_force(times, row, p.latency)
        older = effective(p, order_of(commands, index))
        newer = effective(p, order_of(commands, index + 1 if index < row else row))
        change = change_time(times, row, index, p.latency)
        for each in range(cycles):
            for step in range(steps):
                share = within_unit(change * per_h - (each * steps + step))
                left = sample_place(slots[0], steps, step)
                right = sample_place(slots[1], steps, step)
                to_go = ((cycles - each) * steps - step - 1) * h
                s = substep(s, p, command(mixed(older, newer, share), left, right, to_go), h, per_h)
            count = turn % len(noise[0])
            s = sensed(s, p, dt / cycles, keeps, noise[0][count], noise[1][count])
            turn += 1
        for channel in range(len(kept)):
            out[channel, row - begin] = s[kept[channel]]
    return s
