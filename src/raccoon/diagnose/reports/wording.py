"""Plain sentences about causes, for a team: what is wrong, and apart from it what to do."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

from raccoon.diagnose.reports.names import place_name
from raccoon.diagnose.reports.numbers import with_deviation
from raccoon.diagnose.result import CauseResult, ParameterResult
from raccoon.sim.effects.parameters import SIDES

Values = Mapping[str, ParameterResult]

TUNED, DRIVEN = "(raccoon tune wheels)", "(raccoon calibrate drive)"
BOTH = "(raccoon calibrate drive, raccoon tune wheels)"
"""Of K_E: what a tick is worth, and which voltage a speed takes."""
OR_PLAY = (
    "and turn each wheel by hand, since play in the gears of a wheel that rolls on freely looks the same"
)
OR_SMOOTHED = "A gyro whose readings the program or its log smooths by as much looks the same, and is no slip"
INTO_ROBOT = "put this value into robot.toml"
KEYS = {
    "battery.open_circuit_voltage": "open_circuit_voltage",
    "battery.internal_resistance": "internal_resistance",
    "friction.coulomb": "coulomb",
    "friction.viscous": "viscous",
    "bemf.filter_lag": "filter_time_constant",
}
"""How [model.GROUP] of robot.toml calls a value that is to be put into it."""
INTO_MODEL = "keep it in a model.toml (--save-model), since robot.toml has one number for both wheels"
"""What to do instead with a number of one side: put into robot.toml it would make the other side's wrong."""
CLEAR = 2.0
"""Deviations from which one of the two kinds of friction by direction is said to differ."""


@dataclass(frozen=True, slots=True)
class Told:
    """A cause in words. what: what is wrong, and its number. todo: what to do on the robot; empty where
    nothing is known; both without the point at the end. more: sentences that a recording adds."""

    what: str
    todo: str
    more: str = ""

    def __str__(self) -> str:
        return f"{self.what}: {self.todo}." if self.todo else f"{self.what}."


Maker = Callable[[str, Values], Told]


def _first(values: Values) -> ParameterResult:
    return next(iter(values.values()))


def _scaled(what: str, more: str, less: str, todo: str, todo_less: str = "") -> Maker:
    """A factor. todo_less: what to do where it is below 1, if that is something else."""

    def told(place: str, values: Values) -> Told:
        number = _first(values)
        factor = number.value / (number.nominal if number.nominal > 0.0 else 1.0)  # a model has its own
        larger = factor > 1.0
        text = f"{what} is {abs(factor - 1.0) * 100:.1f} % {more if larger else less} than assumed"
        action = todo if larger else todo_less or todo
        return Told(text.replace("{place}", place), action.replace("{place}", place))

    return told


def _number(what: str, todo: str) -> Maker:
    """A number that has one direction, or whose sign says all."""
    return _either(what, todo, what, todo)


def _either(more: str, todo_more: str, less: str, todo_less: str) -> Maker:
    """A number above what was assumed, or below it."""

    def told(place: str, values: Values) -> Told:
        number = _first(values)
        what, todo = (less, todo_less) if number.value < number.nominal else (more, todo_more)
        named = {"place": place, "value": number.value, "nominal": number.nominal, **_derived(number)}
        return Told(what.format(**named), todo.format(**named))

    return told


def _derived(number: ParameterResult) -> dict[str, float]:
    return {
        "milli": float(with_deviation(1000.0 * number.value, 1000.0 * number.std)),
        "nominal_milli": 1000.0 * number.nominal,
        "degrees": math.degrees(number.value),
        "percent": 100.0 * number.value,
    }


def _by_direction(place: str, values: Values) -> Told:
    """Which kind of friction differs, and which way the wheel turns harder."""
    said, ways = [], set()
    for name, kind in (("asymmetry", "dry"), ("viscous_asymmetry", "speed-dependent")):
        number = values.get(name)
        if number is None or not abs(number.value) > CLEAR * number.std:
            continue
        harder, easier = ("forwards", "backwards") if number.value > 0.0 else ("backwards", "forwards")
        percent = f"{100.0 * abs(number.value):.0f} %"
        ways.add(harder)
        said.append(f"{kind} friction is {percent} above its mean {harder} and {percent} below it {easier}")
    what = f"at {place} {' and '.join(said)}" if said else f"friction at {place} differs by direction"
    only = f" when it turns {ways.pop()}" if len(ways) == 1 else " in one direction only"
    return Told(what, f"look for something that rubs{only}")


def _slope(_place: str, values: Values) -> Told:
    """Size and direction of the pull: x is ahead of the robot as it stood at the start, y to its left."""
    x, y = (values[name].value if name in values else 0.0 for name in ("along_x", "along_y"))
    way = DIRECTIONS[round(math.atan2(y, x) / (0.25 * math.pi)) % len(DIRECTIONS)]
    what = (
        f"the floor is not level and pulls {way} with {math.hypot(x, y):.3f} N m at each wheel, as seen from "
        "the robot at the start"
    )
    return Told(what, "level the table, which is too low on that side")


DIRECTIONS = (
    "forward", "forward and to the left", "to the left", "back and to the left",
    "back", "back and to the right", "to the right", "forward and to the right",
)  # fmt: skip
"""By eighths of a turn to the left."""

_CATALOGUE: Mapping[str, Maker] = {
    "battery.open_circuit_voltage": _either(
        "the battery has {value:.2f} V without load, more than the {nominal:.2f} V that were assumed",
        INTO_ROBOT,
        "the battery has only {value:.2f} V without load, not {nominal:.2f} V",
        f"charge it, or {INTO_ROBOT}",
    ),
    "battery.internal_resistance": _either(
        "the battery's resistance is {value:.3f} ohm instead of {nominal:.3f}, so it sags more when you "
        "drive hard",
        "take a fresh battery, and clean its contacts",
        "the battery's resistance is {value:.3f} ohm instead of {nominal:.3f}, so it sags less than assumed",
        INTO_ROBOT,
    ),
    "battery.discharge": _number(
        "the battery loses {milli:.1f} mV for every ampere second drawn, so the robot gets slower during the "
        "run",
        "use a fuller battery",
    ),
    "motor.armature_resistance": _scaled(
        "the winding resistance of {place}",
        "higher",
        "lower",
        f"look for worn brushes and loose plugs, then calibrate {{place}} {TUNED}",
        f"calibrate {{place}} {TUNED}",
    ),
    "motor.back_emf_constant": _scaled(
        "the K_E (volts per speed) of {place}", "higher", "lower", f"calibrate {{place}} {BOTH}"
    ),
    "motor.heating": _number(
        "the windings get hot, and their resistance rises by {percent:.0f} % for each A2 of lasting load "
        "({place})",
        "do not push against walls, and let the motors cool between runs",
    ),
    "motor.current_limit": _number(
        "the driver lets no more than {value:.2f} A through ({place})", "accelerate more gently"
    ),
    "friction.coulomb": _either(
        "dry friction at {place} is {value:.3f} N m instead of {nominal:.3f}",
        "check axles, gears and floor for what rubs",
        "dry friction at {place} is only {value:.3f} N m instead of {nominal:.3f}",
        INTO_ROBOT,
    ),
    "friction.viscous": _either(
        "speed-dependent friction at {place} is {value:.4f} N m s/rad instead of {nominal:.4f}",
        "check bearings and grease",
        "speed-dependent friction at {place} is only {value:.4f} N m s/rad instead of {nominal:.4f}",
        INTO_ROBOT,
    ),
    "friction.stiction": _number(
        "breaking loose takes {value:.3f} N m more than keeping moving ({place}), so slow driving stutters",
        "begin each slow move with a short push, or drive it faster",
    ),
    "friction.load_dependent": _number(
        "the gear of {place} loses {percent:.0f} % of the torque it transmits",
        "check gear mesh and alignment",
    ),
    "friction.direction_dependent": _by_direction,
    "friction.quadratic": _number(
        "drag grows with the square of the speed ({value:.4f} N m s2/rad2, {place})",
        "drive slower, or feed it forward",
    ),
    "drive.backlash": _number(
        "the gears have {degrees:.1f} degrees of play ({place}), so after a reversal the wheel waits",
        "set the gears closer, or come to each stop from the same direction",
    ),
    "drive.wheel_slip": _number(
        "the wheels slip, and the robot lags {milli:.3g} ms behind them when they speed up or brake",
        f"clean the tyres, or accelerate more gently; {OR_PLAY}. {OR_SMOOTHED}",
    ),
    "drive.turn_scrub": _number(
        "turning on the spot costs {value:.3f} N m at each wheel",
        "look for what scrubs sideways, such as a caster or wide tyres",
    ),
    "drive.wheel_radius": _scaled(
        "the radius of {place}", "larger", "smaller", f"measure it, or calibrate a straight drive {DRIVEN}"
    ),
    "drive.track_width": _scaled("the effective track width", "larger", "smaller", f"calibrate it {DRIVEN}"),
    "drive.inertia": _scaled(
        "the robot's inertia",
        "larger",
        "smaller",
        "take off what it does not need, or calibrate it with its load",
        "calibrate it with the load that it has now",
    ),
    "drive.slope": _slope,
    "drive.wheel_eccentricity": _number(
        "{place} is out of round by {percent:.1f} %", "re-seat or replace it"
    ),
    "actuation.deadband": _number(
        "commands below {percent:.1f} % do nothing ({place})", "add that much to small commands"
    ),
    "actuation.latency": _number(
        "commands reach the motors {milli:.3g} ms late", "plan stops ahead by that much"
    ),
    "bemf.offset": _number(
        "the back-EMF of {place} reads {value:+.0f} counts at standstill, not {nominal:+.0f}",
        f"calibrate its offset {DRIVEN}",
    ),
    "bemf.scale": _scaled(
        "the back-EMF reading of {place}", "larger", "smaller", f"calibrate its radians a tick {DRIVEN}"
    ),
    "bemf.dead_zone": _number(
        "back-EMF below {value:.0f} counts is reported as 0 ({place}), so slow creeping goes unseen",
        "drive faster where a distance is measured",
    ),
    "bemf.filter_lag": _number(
        "back-EMF is smoothed with {milli:.3g} ms instead of {nominal_milli:.3g} ms ({place})", INTO_ROBOT
    ),
    "imu.gyro_bias": _number(
        "the gyro reads {value:+.4f} rad/s at rest, not {nominal:+.4f}",
        "begin every run with a second at rest, wait(1.0), in which it is learnt",
    ),
    "imu.gyro_scale": _scaled(
        "the gyro's reading",
        "larger",
        "smaller",
        "turn the robot by hand through ten full turns, and put gyro_scale into robot.toml",
    ),
    "imu.gyro_drift": _number(
        "the gyro's zero moves by {value:+.5f} rad/s every second",
        "switch the robot on some minutes before the run, so that the gyro warms up",
    ),
    "imu.latency": _number(
        "gyro readings come {milli:.3g} ms late", f"turn more gently, or plan ahead; {OR_PLAY}"
    ),
}


def told(cause: CauseResult) -> Told:
    """A cause of a result in words; one whose recording has a sentence of its own (a single axis, a tophat,
    an effect of the team's) says in it what to do."""
    own, said = _told(cause.id, cause.where, cause.parameters), cause.explanation
    if said.startswith(str(own)):
        return replace(own, more=said.removeprefix(str(own)).strip())
    if said.startswith(f"{own.what}: "):  # what to do is something else, as of what robot.toml has
        return replace(own, todo=said.removeprefix(f"{own.what}: ").removesuffix("."))
    return Told(said.removesuffix("."), "")


def as_robot_toml_has(cause: CauseResult, has: float) -> CauseResult:
    """A cause with a key in robot.toml, which has its number, `has`, already: a model.toml, from which the
    diagnosis began, is behind it, and nothing is to be done on the robot."""
    group, _, _ = cause.id.partition(".")
    todo = (
        f"robot.toml has {KEYS[cause.id]} = {has:.4g} in [model.{group}] already, and the model.toml of "
        "--model is behind it (--save-model writes a new one)"
    )
    found = replace(told(cause), todo=todo)
    return replace(cause, explanation=f"{found} {found.more}".rstrip())


def explanation(id: str, where: str | None, values: Values) -> str:  # noqa: A002
    """One sentence: what is wrong, its number, what to do."""
    return str(_told(id, where, values))


def _told(id: str, where: str | None, values: Values) -> Told:  # noqa: A002
    place, maker = place_name(id, where), _CATALOGUE.get(id)
    if maker is None:
        numbers = ", ".join(f"{name} {each.value:.4g} {each.unit}".strip() for name, each in values.items())
        found = Told(f"{id} at {place}: {numbers}", "")
    else:
        found = maker(place, values)
    into = INTO_MODEL if where in SIDES else INTO_ROBOT
    if id in KEYS and where not in SIDES:
        number = _first(values)
        unit = f" ({number.unit})" if number.unit else ""
        into = f"put {KEYS[id]} = {number.value:.4g}{unit} into [model.{id.partition('.')[0]}] of robot.toml"
    return Told(found.what[0].upper() + found.what[1:], found.todo.replace(INTO_ROBOT, into))
