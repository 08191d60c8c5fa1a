"""The source text that runs the plant's equations for many robots side by side.

All numbers of BLOCK robots are in one flat array, row by row: the fields of `State`, those of `Plant`, then
the orders. An inner loop over the robots loads, computes with the same functions as for a single robot, and
stores; compiled, a vector unit computes several robots at once. Most robots have none of the effects that
cost half of the time (`SELDOM`, and `GIVING`): the text for them omits those and gives the same bits. The
same is done for robots of which only readings are needed. Loads and stores are functions of their own:
written out in each loop, they took four fifths of the compilation time.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

from raccoon.sim.plant.quantities import Circuit, Plant, State

BLOCK = 32  # robots: their numbers stay in the fastest cache
LINE = 8  # numbers in a line of the cache, and in the widest vector
STRIDE = 5 * LINE  # from row to row: a vector that lies across two lines takes twice as long; not a power of
# two, or rows would crowd into the same cache sets
STATE_ROWS = len(State._fields)
PLANT_ROWS = len(Plant._fields)
OLDER_ROW = STATE_ROWS + PLANT_ROWS
NEWER_ROW, ORDER_ROW, CHANGE_ROW = OLDER_ROW + 4, OLDER_ROW + 8, OLDER_ROW + 12
CIRCUIT_ROW = CHANGE_ROW + 1
SPEED_ROW = CIRCUIT_ROW + len(Circuit._fields)
KEEP_ROW = SPEED_ROW + 2
ROWS = KEEP_ROW + 3
# Fields before these change in a step, when a motor is sampled, and in a cycle.
_FIRST_SAMPLED, _FIRST_SENSED = (State._fields.index(name) for name in ("sampled_left", "recent_left"))
# What no step reads of the one before: only a cycle's last step has to work it out.
_UNREAD = ("forward_speed", "bus")
_GRIPS = ("grip_left", "grip_right")  # known with the speeds, and read by nothing before the next step
_STEPPED = [name for name in State._fields[:_FIRST_SAMPLED] if name not in _GRIPS]

SELDOM: Mapping[str, Mapping[str, float]] = {
    "motor.heating": {"heating_left": 0.0, "heating_right": 0.0},
    "motor.current_limit": {"limit_left": math.inf, "limit_right": math.inf},
    "friction.stiction": {"stiction_left": 0.0, "stiction_right": 0.0},
    "drive.backlash": {"half_play_left": 0.0, "half_play_right": 0.0},
    "drive.wheel_slip": dict.fromkeys(("slip_left", "slip_right", "kick_left", "kick_right"), 0.0),
    "drive.turn_scrub": {"scrub": 0.0},
    "drive.wheel_eccentricity": dict.fromkeys(
        ("runout_cos_left", "runout_cos_right", "runout_sin_left", "runout_sin_right"), 0.0
    ),
}
"""Effects that are expensive and rare, with the fields of `Plant` and their values when the effect is off."""
LOOSE = ("drive.backlash", "drive.wheel_slip", "drive.wheel_eccentricity")
"""The rare effects between motor and floor. Without them a wheel's angle and play need not be computed."""
GIVING: Mapping[str, float] = {"compliance": 0.0, "creep": 0.0}
"""Fields of `Plant` for presliding friction (`friction.presliding`), with their values for rigid friction.
Every robot of a diagnosis has presliding friction, and no other robot does."""
CREEPING: Mapping[str, float] = {"creep": 0.0, "break_away": 0.0}
"""Fields of `Plant` for how presliding friction lets go, with their values for bristles that let go at |w|:
the lines with `# creeping`."""
NO_READING = (
    "time", "x", "y", "wheel_cos_left", "wheel_sin_left", "wheel_cos_right", "wheel_sin_right", "play_left",
    "play_right", "wheel_left", "wheel_right", "rolling_left", "rolling_right", "heat_left", "heat_right",
)  # fmt: skip
"""Fields of `State` on which no reading of a robot without rare effects depends."""
_HEAT = ("heat_left", "heat_right")


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of robots for which a text is made: effects that none of them has (without), effects that all of
    them have (always), fields of the state that are not needed (unfollowed), and whether presliding wheels
    may let go in another way than at |w| (CREEPING)."""

    without: tuple[str, ...] = ()
    always: tuple[str, ...] = ()
    unfollowed: tuple[str, ...] = ()
    creeping: bool = True


SELDOM_KIND = "robots with rare effects"
GIVING_KIND = "robots with presliding friction"
READ_KIND = "readings of robots with presliding friction"
ROLLING_KIND = "readings of robots with rare motors or friction, or other bristles"
GIVING_SELDOM_KIND = "robots with presliding friction and rare effects"
PLAIN_KIND = "plain robots"
KINDS: Mapping[str, Kind] = {
    SELDOM_KIND: Kind(("friction.presliding",)),
    GIVING_SELDOM_KIND: Kind((), ("friction.presliding",)),
    GIVING_KIND: Kind(tuple(SELDOM), ("friction.presliding",)),
    READ_KIND: Kind(tuple(SELDOM), ("friction.presliding",), NO_READING, creeping=False),
    ROLLING_KIND: Kind(
        LOOSE, ("friction.presliding",), tuple(each for each in NO_READING if each not in _HEAT)
    ),
    PLAIN_KIND: Kind((*SELDOM, "friction.presliding")),
}


def lanes_text(unfollowed: Collection[str] = ()) -> str:
    """Source text of `advance_lanes`, which advances count <= BLOCK robots from times[begin] to times[end].

    Its arguments: a is the flat array, of which the first `width` lanes are advanced, best a multiple of the
    vector's size; the others are as in `driver.advance`, except that noise[i] has one column per robot and
    out[i, r + 1, places[k]] gets the field of robot k < count.

    unfollowed: fields of the state that are not stored; the compiler then omits what only they need.
    """
    stepped = [State._fields.index(name) for name in _STEPPED if name not in unfollowed]
    between = [row for row in stepped if State._fields[row] not in _UNREAD]
    loads = (
        _load("state_of", STATE_ROWS, 0, "State"),
        _load("plant_of", PLANT_ROWS, STATE_ROWS, "Plant"),
        _load("older_of", 4, OLDER_ROW),
        _load("newer_of", 4, NEWER_ROW),
        _load("acting_of", 4, ORDER_ROW),
        _load("circuit_of", len(Circuit._fields), CIRCUIT_ROW, "Circuit"),
        _load("speeds_of", 2, SPEED_ROW),
        _load("keeps_of", 3, KEEP_ROW),
    )
    stores = (
        _store("keep_older", range(OLDER_ROW, OLDER_ROW + 4)),
        _store("keep_newer", range(NEWER_ROW, NEWER_ROW + 4)),
        _store("keep_acting", range(ORDER_ROW, ORDER_ROW + 4)),
        _store("keep_circuit", range(CIRCUIT_ROW, CIRCUIT_ROW + len(Circuit._fields))),
        _store("keep_keeps", range(KEEP_ROW, KEEP_ROW + 3)),
        _store("keep_speeds", [SPEED_ROW, SPEED_ROW + 1, *map(State._fields.index, _GRIPS)]),
        _store("keep_sampled", range(_FIRST_SAMPLED, _FIRST_SAMPLED + 2)),
        _store("keep_step", stepped, "State"),
        _store("keep_between", between, "State"),
        _store("keep_cycle", range(_FIRST_SENSED, STATE_ROWS), "State"),
    )
    change, latency = _cell(CHANGE_ROW), _cell(STATE_ROWS + Plant._fields.index("latency"))
    text = _TEXT.format(
        stride=STRIDE,
        change=change,
        latency=latency,
        moved_between=_MOVED.format(when="step < steps - 1", keep="keep_between"),
        moved_last=_MOVED.format(when="step == steps - 1", keep="keep_step"),
    )
    return "\n\n".join((*loads, *stores, text))


def _cell(row: int) -> str:
    return f"a[{row * STRIDE} + k]"


def _load(name: str, count: int, row: int, kind: str = "") -> str:
    cells = ", ".join(_cell(each) for each in range(row, row + count))
    return f"def {name}(a, k):\n    return {kind}({cells})"


def _store(name: str, rows: Sequence[int], kind: str = "") -> str:
    values = (f"n.{State._fields[row]}" if kind else f"n[{place}]" for place, row in enumerate(rows))
    stores = (f"    {_cell(row)} = {value}" for row, value in zip(rows, values, strict=True))
    return "\n".join((f"def {name}(a, k, n):", *stores))


_MOVED = """\
                for k in range(width if {when} else 0):
                    s = state_of(a, k)
                    p = plant_of(a, k)
                    c = circuit_of(a, k)
                    u = command(acting_of(a, k), left, right, to_go)
                    w = speeds_of(a, k)
                    n = moved(s, p, u, c, w[0], w[1], s.grip_left, s.grip_right, h, per_h)
                    {keep}(a, k, n)"""

_TEXT = """
def advance_lanes(
    a, width, commands, times, begin, end, cycle, longest_step, slots, noise, kept, out, places, count
):
    turn = 0
    period = -1.0
    changed = begin
    settled = False
    longest = 0.0
    for k in range(width):
        longest = max(longest, {latency})
    for row in range(begin, end):
        dt = times[row + 1] - times[row]
        cycles = cycle_count(dt, cycle)
        steps = step_count(dt / cycles, longest_step)
        h = dt / (cycles * steps)
        per_h = 1.0 / h
        if period != period_of(dt / cycles, cycle):
            period = period_of(dt / cycles, cycle)
            for k in range(width):
                p = plant_of(a, k)
                keeps = kept_shares(p, period)
                keep_keeps(a, k, keeps)
        now = order_of(commands, row)
        if row > begin and now != order_of(commands, row - 1):
            changed = row
        before = settled
        settled = times[changed] <= times[row] - longest  # an order that is in force at all motors
        for k in range(width if settled and (changed == row or not before) else 0):
            p = plant_of(a, k)
            order = effective(p, now)
            keep_acting(a, k, order)
        for k in range(0 if settled else width):
            p = plant_of(a, k)
            index = in_force(times, row, p.latency)
            older = effective(p, order_of(commands, index))
            newer = effective(p, order_of(commands, index + 1 if index < row else row))
            keep_older(a, k, older)
            keep_newer(a, k, newer)
            {change} = change_time(times, row, index, p.latency)
        for each in range(cycles):
            for step in range(steps):
                for k in range(0 if settled else width):
                    share = within_unit({change} * per_h - (each * steps + step))
                    order = mixed(older_of(a, k), newer_of(a, k), share)
                    keep_acting(a, k, order)
                left = sample_place(slots[0], steps, step)
                right = sample_place(slots[1], steps, step)
                to_go = ((cycles - each) * steps - step - 1) * h
                for k in range(width):
                    s = state_of(a, k)
                    p = plant_of(a, k)
                    c = circuit(s, p, command(acting_of(a, k), left, right, to_go), h)
                    keep_circuit(a, k, c)
                    rubbing = frictions(s, p, c, h)
                    speeds = driven(s, p, c, rubbing[0], rubbing[1], h, per_h)
                    keep_speeds(a, k, speeds)
                for k in range(width if left > 0.0 or right > 0.0 else 0):
                    s = state_of(a, k)
                    speeds = speeds_of(a, k)
                    keep_sampled(a, k, sampled_both(s, speeds[0], speeds[1], left, right))
{moved_between}
{moved_last}
            draw = turn % noise.shape[1]
            for k in range(width):
                s = state_of(a, k)
                p = plant_of(a, k)
                n = sensed(s, p, dt / cycles, keeps_of(a, k), noise[0, draw, k], noise[1, draw, k])
                keep_cycle(a, k, n)
            turn += 1
        for channel in range(len(kept)):
            for k in range(count):
                out[channel, row - begin + 1, places[k]] = a[kept[channel] * {stride} + k]
"""
