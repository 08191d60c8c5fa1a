"""Plain sentences about causes, for a team."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from raccoon.diagnose.result import ParameterResult

Values = Mapping[str, ParameterResult]


def _percent(factor: float, more: str, less: str) -> str:
    return f"{abs(factor - 1.0) * 100:.1f} % {more if factor > 1.0 else less}"


def _first(values: Values) -> ParameterResult:
    return next(iter(values.values()))


def _scaled(what: str, more: str, less: str, advice: str) -> Callable[[str, Values], str]:
    def sentence(place: str, values: Values) -> str:
        number = _first(values)
        subject = what.replace("{place}", place)
        todo = advice.replace("{place}", place)
        return f"{subject} is {_percent(number.value, more, less)} than assumed: {todo}"

    return sentence


def _number(text: str) -> Callable[[str, Values], str]:
    def sentence(place: str, values: Values) -> str:
        number = _first(values)
        return text.format(place=place, value=number.value, nominal=number.nominal, **_derived(number))

    return sentence


def _derived(number: ParameterResult) -> dict[str, float]:
    return {
        "milli": 1000.0 * number.value,
        "degrees": math.degrees(number.value),
        "percent": 100.0 * number.value,
    }


_SENTENCES: Mapping[str, Callable[[str, Values], str]] = {
    "battery.open_circuit_voltage": _number(
        "the battery has {value:.2f} V without load, not {nominal:.2f} V: charge it, or put this value "
        "into robot.toml."
    ),
    "battery.internal_resistance": _number(
        "the battery's resistance is {value:.3f} ohm instead of {nominal:.3f}: it sags when you drive "
        "hard; a "
        "fresh battery or cleaner contacts help."
    ),
    "battery.discharge": _number(
        "the battery loses {milli:.1f} mV for every ampere second drawn: the robot gets slower during "
        "the run; "
        "use a fuller battery."
    ),
    "motor.armature_resistance": _scaled(
        "the winding resistance of {place}", "higher", "lower", "calibrate it; worn brushes raise it."
    ),
    "motor.back_emf_constant": _scaled("the K_E of {place}", "higher", "lower", "calibrate {place}."),
    "motor.heating": _number(
        "the windings get hot: their resistance rises by {percent:.0f} % for each A2 of lasting load; "
        "avoid stalls."
    ),
    "motor.current_limit": _number(
        "the driver lets no more than {value:.2f} A through: accelerate more gently."
    ),
    "friction.coulomb": _number(
        "dry friction at {place} is {value:.3f} N m instead of {nominal:.3f}: check axles, gears and floor."
    ),
    "friction.viscous": _number(
        "speed-dependent friction at {place} is {value:.4f} N m s/rad instead of {nominal:.4f}: "
        "check bearings "
        "and grease."
    ),
    "friction.stiction": _number(
        "breaking loose takes {value:.3f} N m more than keeping moving ({place}): very slow driving "
        "will stutter."
    ),
    "friction.load_dependent": _number(
        "the gear of {place} loses {percent:.0f} % of the torque it transmits: check gear mesh and alignment."
    ),
    "friction.direction_dependent": _number(
        "friction at {place} differs by direction (dry part {percent:+.0f} %): look for something "
        "that rubs "
        "one way."
    ),
    "friction.quadratic": _number(
        "drag grows with the square of the speed ({value:.4f} N m s2/rad2, {place}): drive slower or "
        "feed it forward."
    ),
    "drive.backlash": _number(
        "the gears have {degrees:.1f} degrees of play ({place}): after a reversal the wheel waits."
    ),
    "drive.wheel_slip": _number(
        "the robot lags {milli:.0f} ms behind its wheels when they speed up: they slip; clean the tyres."
    ),
    "drive.turn_scrub": _number(
        "turning on the spot costs {value:.3f} N m at each wheel: caster or tyres scrub."
    ),
    "drive.wheel_radius": _scaled(
        "the radius of {place}", "larger", "smaller", "measure it or calibrate straight driving."
    ),
    "drive.track_width": _scaled(
        "the effective track width", "larger", "smaller", "calibrate with counted full turns."
    ),
    "drive.inertia": _scaled("the robot's inertia", "larger", "smaller", "has a payload changed?"),
    "drive.slope": _number(
        "the floor is not level: it pulls with {value:+.3f} N m at each wheel along the start direction."
    ),
    "drive.wheel_eccentricity": _number("{place} is out of round by {percent:.1f} %: re-seat or replace it."),
    "actuation.deadband": _number(
        "commands below {percent:.1f} % do nothing ({place}): add that much to small commands."
    ),
    "actuation.latency": _number(
        "commands reach the motors {milli:.0f} ms late: plan stops ahead by that much."
    ),
    "bemf.offset": _number(
        "the back-EMF of {place} reads {value:+.0f} counts at standstill: calibrate its offset."
    ),
    "bemf.scale": _scaled(
        "the back-EMF reading of {place}", "larger", "smaller", "calibrate its ticks per turn."
    ),
    "bemf.dead_zone": _number(
        "back-EMF below {value:.0f} counts is reported as 0 ({place}): drive faster where a way is measured, "
        "slow creeping goes unseen."
    ),
    "bemf.filter_lag": _number(
        "back-EMF is smoothed with {milli:.0f} ms ({place}) instead of what robot.toml says: correct it "
        "there."
    ),
    "imu.gyro_bias": _number("the gyro reads {value:+.4f} rad/s at rest: calibrate it before every run."),
    "imu.gyro_scale": _scaled(
        "the gyro's reading", "larger", "smaller", "calibrate with counted full turns."
    ),
    "imu.gyro_drift": _number("the gyro's zero moves by {value:+.5f} rad/s every second: let it warm up."),
    "imu.latency": _number("gyro readings come {milli:.0f} ms late: turn more gently or plan ahead."),
}

_PLACES = {
    "motor": {None: "the motors", "left": "the left motor", "right": "the right motor"},
    "bemf": {None: "the motors", "left": "the left motor", "right": "the right motor"},
    None: {None: "both wheels", "left": "the left wheel", "right": "the right wheel"},
}


def explanation(id: str, where: str | None, values: Values) -> str:  # noqa: A002
    """One sentence: what is wrong, its number, what to do."""
    group = id.split(".", 1)[0]
    place = _PLACES.get(group, _PLACES[None])[where]
    maker = _SENTENCES.get(id)
    if maker is None:
        numbers = ", ".join(f"{name} {each.value:.4g} {each.unit}".strip() for name, each in values.items())
        text = f"{id} at {place}: {numbers}."
    else:
        text = maker(place, values)
    return text[0].upper() + text[1:]


MANOEUVRES: Mapping[str, str] = {
    "stall": "push against a wall at half power for 3 s, then fast steps: heating, current limit and "
    "resistance",
    "creep": "slow ramps from standstill to 30 % and back, both ways: stiction, deadband, dead zone, "
    "dry friction",
    "spin": "spins to both sides with quick reversals: backlash, slip, scrub, gyro scale and latency, "
    "track width",
    "straight": "long straight legs at full speed, both ways: wheel radius, quadratic and viscous "
    "friction, discharge",
    "turns": "ten counted full turns to each side, from line to line: gyro scale against track width "
    "and wheel radius",
    "still": "stand still for 10 s at the start and at the end: gyro bias, drift and back-EMF offsets",
    "steps": "random power steps between -100 and 100 % for 20 s: latency, inertia, resistance and K_E",
    "square": "the same drive in two headings at right angles: slope against direction-dependent friction",
}
"""Safe manoeuvres in words, by key."""

_SHOWN_BY: Mapping[str, str] = {
    "motor.heating": "stall", "motor.current_limit": "stall", "motor.armature_resistance": "steps",
    "motor.back_emf_constant": "steps", "friction.stiction": "creep", "friction.coulomb": "creep",
    "friction.viscous": "straight", "friction.quadratic": "straight", "friction.load_dependent": "steps",
    "friction.direction_dependent": "square", "drive.slope": "square", "drive.backlash": "spin",
    "drive.wheel_slip": "spin", "drive.turn_scrub": "spin", "drive.wheel_radius": "straight",
    "drive.track_width": "turns", "imu.gyro_scale": "turns", "drive.inertia": "steps",
    "drive.wheel_eccentricity": "straight", "actuation.deadband": "creep", "actuation.latency": "steps",
    "bemf.dead_zone": "creep", "bemf.filter_lag": "steps", "bemf.offset": "still", "bemf.scale": "straight",
    "imu.gyro_bias": "still", "imu.gyro_drift": "still", "imu.latency": "spin",
    "battery.internal_resistance": "steps", "battery.discharge": "straight",
    "battery.open_circuit_voltage": "straight",
}  # fmt: skip


def manoeuvre_for(id: str) -> str | None:  # noqa: A002
    """The manoeuvre that shows an effect best."""
    key = _SHOWN_BY.get(id)
    return None if key is None else MANOEUVRES[key]
