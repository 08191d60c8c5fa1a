"""The sentence of each cause, for a team: what is wrong, and separately what to do."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from raccoon.diagnose.reports.numbers import format_value
from raccoon.diagnose.result import ParameterResult

Values = Mapping[str, ParameterResult]

TUNE_COMMAND, CALIBRATE_COMMAND = "(raccoon tune wheels)", "(raccoon calibrate drive)"
BOTH_COMMANDS = "(raccoon calibrate drive, raccoon tune wheels)"
"""The commands for K_E: the first calibrates the worth of a tick, the second the voltage for a speed."""
CHECK_PLAY_TEXT = (
    "and turn each wheel by hand, since play in the gears of a wheel that rolls on freely looks the same"
)
SMOOTHED_GYRO_TEXT = (
    "If the program or its log smooths the gyro's readings by as much, that looks the same and is no slip"
)
INTO_ROBOT_TOML = "put this value into robot.toml"

MIN_ASYMMETRY_STDS = 2.0
"""Least asymmetry, in standard deviations, of a kind of friction (dry, viscous) that is reported to differ by
direction."""


@dataclass(frozen=True, slots=True)
class CauseText:
    """A cause in words. what: what is wrong, with its value. todo: what to do on the robot, "" if unknown;
    both without a full stop. more: further sentences about the recording."""

    what: str
    todo: str
    more: str = ""

    def __str__(self) -> str:
        return f"{self.what}: {self.todo}." if self.todo else f"{self.what}."


TextMaker = Callable[[str, Values], CauseText]


def first_value(values: Values) -> ParameterResult:
    """The first parameter of a cause, which is its size."""
    return next(iter(values.values()))


def _factor_maker(what: str, more: str, less: str, todo: str, todo_less: str = "") -> TextMaker:
    """Text maker for a factor. todo_less: what to do if it is below 1, by default the same."""

    def make_text(place: str, values: Values) -> CauseText:
        number = first_value(values)
        factor = number.value / (number.nominal if number.nominal > 0.0 else 1.0)  # model.toml has its own
        larger = factor > 1.0
        text = f"{what} is {abs(factor - 1.0) * 100:.1f} % {more if larger else less} than assumed"
        action = todo if larger else todo_less or todo
        return CauseText(text.replace("{place}", place), action.replace("{place}", place))

    return make_text


def _number_maker(what: str, todo: str) -> TextMaker:
    """Text maker for a parameter with only one direction, or whose sign is part of the text."""
    return _above_or_below_maker(what, todo, what, todo)


def _above_or_below_maker(more: str, todo_more: str, less: str, todo_less: str) -> TextMaker:
    """Text maker for a parameter with one text above and another below the assumed value."""

    def make_text(place: str, values: Values) -> CauseText:
        number = first_value(values)
        what, todo = (less, todo_less) if number.value < number.nominal else (more, todo_more)
        named = {"place": place, "value": number.value, "nominal": number.nominal, **_derived_values(number)}
        return CauseText(what.format(**named), todo.format(**named))

    return make_text


def _derived_values(number: ParameterResult) -> dict[str, float]:
    return {
        "milli": float(format_value(1000.0 * number.value, 1000.0 * number.std)),
        "nominal_milli": 1000.0 * number.nominal,
        "degrees": math.degrees(number.value),
        "percent": 100.0 * number.value,
    }


def _direction_text(place: str, values: Values) -> CauseText:
    """Text of the kinds of friction that differ by direction, and of the direction in which the wheel turns
    harder."""
    said, ways = [], set()
    for name, kind in (("asymmetry", "dry"), ("viscous_asymmetry", "speed-dependent")):
        number = values.get(name)
        if number is None or not abs(number.value) > MIN_ASYMMETRY_STDS * number.std:
            continue
        harder, easier = ("forwards", "backwards") if number.value > 0.0 else ("backwards", "forwards")
        percent = f"{100.0 * abs(number.value):.0f} %"
        ways.add(harder)
        said.append(f"{kind} friction is {percent} above its mean {harder} and {percent} below it {easier}")
    what = f"at {place} {' and '.join(said)}" if said else f"friction at {place} differs by direction"
    only = f" when it turns {ways.pop()}" if len(ways) == 1 else " in one direction only"
    return CauseText(what, f"look for something that rubs{only}")


def _slope_text(_place: str, values: Values) -> CauseText:
    """Text of a slope's size and direction: x points ahead of the robot at the start, y to its left."""
    x, y = (values[name].value if name in values else 0.0 for name in ("along_x", "along_y"))
    way = DIRECTIONS[round(math.atan2(y, x) / (0.25 * math.pi)) % len(DIRECTIONS)]
    what = (
        f"the floor is not level and pulls {way} with {math.hypot(x, y):.3f} N m at each wheel, as seen from "
        "the robot at the start"
    )
    return CauseText(what, "level the table, which is too low on that side")


DIRECTIONS = (
    "forward", "forward and to the left", "to the left", "back and to the left",
    "back", "back and to the right", "to the right", "forward and to the right",
)  # fmt: skip
"""Directions in steps of an eighth of a turn to the left."""

SENTENCES: Mapping[str, TextMaker] = {
    "battery.open_circuit_voltage": _above_or_below_maker(
        "the battery has {value:.2f} V without load, more than the {nominal:.2f} V that were assumed",
        INTO_ROBOT_TOML,
        "the battery has only {value:.2f} V without load, not {nominal:.2f} V",
        f"charge it, or {INTO_ROBOT_TOML}",
    ),
    "battery.internal_resistance": _above_or_below_maker(
        "the battery's resistance is {value:.3f} ohm instead of {nominal:.3f}, so it sags more when you "
        "drive hard",
        "take a fresh battery, and clean its contacts",
        "the battery's resistance is {value:.3f} ohm instead of {nominal:.3f}, so it sags less than assumed",
        INTO_ROBOT_TOML,
    ),
    "battery.discharge": _number_maker(
        "the battery loses {milli:.1f} mV for every ampere second drawn, so the robot gets slower during the "
        "run",
        "use a fuller battery",
    ),
    "motor.armature_resistance": _factor_maker(
        "the winding resistance of {place}",
        "higher",
        "lower",
        f"look for worn brushes and loose plugs, then calibrate {{place}} {TUNE_COMMAND}",
        f"calibrate {{place}} {TUNE_COMMAND}",
    ),
    "motor.back_emf_constant": _factor_maker(
        "the K_E (volts per speed) of {place}", "higher", "lower", f"calibrate {{place}} {BOTH_COMMANDS}"
    ),
    "motor.heating": _number_maker(
        "the windings get hot, and their resistance rises by {percent:.0f} % for each A2 of lasting load "
        "({place})",
        "do not push against walls, and let the motors cool between runs",
    ),
    "motor.current_limit": _number_maker(
        "the motor driver limits the current to {value:.2f} A ({place})", "accelerate more gently"
    ),
    "friction.coulomb": _above_or_below_maker(
        "dry friction at {place} is {value:.3f} N m instead of {nominal:.3f}",
        "check axles, gears and floor for what rubs",
        "dry friction at {place} is only {value:.3f} N m instead of {nominal:.3f}",
        INTO_ROBOT_TOML,
    ),
    "friction.viscous": _above_or_below_maker(
        "speed-dependent friction at {place} is {value:.4f} N m s/rad instead of {nominal:.4f}",
        "check bearings and grease",
        "speed-dependent friction at {place} is only {value:.4f} N m s/rad instead of {nominal:.4f}",
        INTO_ROBOT_TOML,
    ),
    "friction.stiction": _number_maker(
        "breaking loose takes {value:.3f} N m more than keeping moving ({place}), so slow driving stutters",
        "begin each slow move with a short push, or drive it faster",
    ),
    "friction.load_dependent": _number_maker(
        "the gear of {place} loses {percent:.0f} % of the torque it transmits",
        "check gear mesh and alignment",
    ),
    "friction.direction_dependent": _direction_text,
    "friction.quadratic": _number_maker(
        "drag grows with the square of the speed ({value:.4f} N m s2/rad2, {place})",
        "drive slower, or compensate for it with feedforward",
    ),
    "drive.backlash": _number_maker(
        "the gears have {degrees:.1f} degrees of play ({place}), so after a reversal the wheel waits",
        "set the gears closer, or come to each stop from the same direction",
    ),
    "drive.wheel_slip": _number_maker(
        "the wheels slip, and the robot lags {milli:.3g} ms behind them when they speed up or brake",
        f"clean the tyres, or accelerate more gently; {CHECK_PLAY_TEXT}. {SMOOTHED_GYRO_TEXT}",
    ),
    "drive.turn_scrub": _number_maker(
        "turning on the spot costs {value:.3f} N m at each wheel",
        "look for what scrubs sideways, such as a caster or wide tyres",
    ),
    "drive.wheel_radius": _factor_maker(
        "the radius of {place}",
        "larger",
        "smaller",
        f"measure it, or calibrate a straight drive {CALIBRATE_COMMAND}",
    ),
    "drive.track_width": _factor_maker(
        "the effective track width", "larger", "smaller", f"calibrate it {CALIBRATE_COMMAND}"
    ),
    "drive.inertia": _factor_maker(
        "the robot's inertia",
        "larger",
        "smaller",
        "take off what it does not need, or calibrate it with its load",
        "calibrate it with the load that it has now",
    ),
    "drive.slope": _slope_text,
    "drive.wheel_eccentricity": _number_maker(
        "{place} is out of round by {percent:.1f} %", "re-seat or replace it"
    ),
    "actuation.deadband": _number_maker(
        "commands below {percent:.1f} % do nothing ({place})", "add that much to small commands"
    ),
    "actuation.latency": _number_maker(
        "commands reach the motors {milli:.3g} ms late", "plan stops ahead by that much"
    ),
    "bemf.offset": _number_maker(
        "the back-EMF of {place} reads {value:+.0f} counts at standstill, not {nominal:+.0f}",
        f"calibrate its offset {CALIBRATE_COMMAND}",
    ),
    "bemf.scale": _factor_maker(
        "the back-EMF reading of {place}",
        "larger",
        "smaller",
        f"calibrate its radians per tick {CALIBRATE_COMMAND}",
    ),
    "bemf.dead_zone": _number_maker(
        "back-EMF below {value:.0f} counts is reported as 0 ({place}), so slow creeping goes unseen",
        "drive faster where a distance is measured",
    ),
    "bemf.filter_lag": _number_maker(
        "back-EMF is smoothed with {milli:.3g} ms instead of {nominal_milli:.3g} ms ({place})",
        INTO_ROBOT_TOML,
    ),
    "imu.gyro_bias": _number_maker(
        "the gyro reads {value:+.4f} rad/s at rest, not {nominal:+.4f}",
        "begin every run with a second at rest, wait(1.0), during which it is measured",
    ),
    "imu.gyro_scale": _factor_maker(
        "the gyro's reading",
        "larger",
        "smaller",
        "turn the robot by hand through ten full turns, and put gyro_scale into robot.toml",
    ),
    "imu.gyro_drift": _number_maker(
        "the gyro's zero moves by {value:+.5f} rad/s every second",
        "switch the robot on some minutes before the run, so that the gyro warms up",
    ),
    "imu.latency": _number_maker(
        "gyro readings come {milli:.3g} ms late", f"turn more gently, or plan ahead; {CHECK_PLAY_TEXT}"
    ),
}
