"""Checks of a program's arguments: wrong units and kinds are reported in the line that has them."""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping
from numbers import Real
from typing import Any

from raccoon.core.readings import ANALOG_FULL_SCALE
from raccoon.core.schema import BATTERY_VOLTAGE, format_value
from raccoon.core.sections import DISTANCE_TOLERANCE, HEADING_TOLERANCE, RATE, SPEED
from raccoon.model.pose import check_heading_unit, looks_like_degrees

LONGEST_WAY_M = 10.0
"""m; a table is 2.4 m long, so a larger distance is in centimetres."""
FASTEST_SPEED = SPEED.high
"""m/s; the limit of speeds in robot.toml and in arguments."""
MAX_TURNS = 4.0
"""Largest heading in full turns (headings count turns); a larger number is an angle in degrees."""
ROUNDING = 1e-9
"""Relative tolerance within which a sum of degrees is a full turn."""
COMPOSE_HINT = "compose actions with seq, parallel or then, or let the function of a do() return the action"
"""Advice for a `run` inside of a function that is itself run."""
SEVERAL_ACTIONS_HINT = ": write seq(*actions) for a list"
"""Advice for several actions given to something that takes one."""
LONGEST_WAIT_S = 600.0
"""s, five matches; a longer time is in milliseconds."""
FASTEST_TURN = RATE.high
"""rad/s; the limit of turn rates in robot.toml and in arguments."""


def check_number(name: str, value: object, allowed: str) -> None:
    """Raise TypeError if `value` is not a number. allowed: the numbers that are, in words. True and False are
    refused, although Python takes them for 1 and 0."""
    if isinstance(value, bool) or not isinstance(value, Real):
        raise TypeError(f"{name} is {value!r}: it must be a number, {allowed}")


def check_positive(name: str, value: float, hint: str = "") -> None:
    """Raise ValueError if a value is not above 0, TypeError if it is not a number. hint: what to write
    instead."""
    check_number(name, value, "above 0")
    if not 0.0 < value < math.inf:
        raise ValueError(f"{name} is {value}: it must be above 0" + (f" ({hint})" if hint else ""))


def check_finite(**values: float) -> None:
    """Raise ValueError naming the first value that is not finite, TypeError for anything that is not a
    number."""
    for name, value in values.items():
        check_number(name, value, "and finite")
        if not math.isfinite(value):
            raise ValueError(f"{name} is {value}: it must be a finite number")


def check_limits(hint: str = "", /, **values: float | None) -> None:
    """Raise ValueError naming the first limit that is given (not None) and not above 0, TypeError if it is
    not a number. hint: what to write instead."""
    for name, value in values.items():
        if value is not None:
            check_positive(name, value, hint)


def check_battery_voltage(**voltages: float) -> None:
    """Raise ValueError naming the first value that cannot be a battery's voltage (V), TypeError if it is not
    a number."""
    allowed = f"from {BATTERY_VOLTAGE.low:g} to {BATTERY_VOLTAGE.high:g} V"
    for name, value in voltages.items():
        check_number(name, value, allowed)
        if not BATTERY_VOLTAGE.allows(value):
            _refuse(name, value, allowed)


def check_times(**times: float | None) -> None:
    """Raise ValueError naming the first value that is given and is not an allowed duration (s), TypeError if
    it is not a number."""
    check_limits(**times)
    for name, value in times.items():
        if value is not None and value > LONGEST_WAIT_S:
            _refuse(name, value, f"above 0, up to {LONGEST_WAIT_S:g} s (500 ms are 0.5)")


def check_limit(**times: float) -> None:
    """`check_times` for a duration that must be given: None is refused."""
    for name, value in times.items():
        check_positive(name, value)
    check_times(**times)


def check_tolerance(**ways: float | None) -> None:
    """Raise ValueError naming the first value that is given and is not an allowed tolerance (m), TypeError if
    it is not a number."""
    _check_small(DISTANCE_TOLERANCE.high, "m (5 mm are 0.005)", ways)


def check_heading_tolerance(**angles: float | None) -> None:
    """Raise the same errors for tolerances of a heading (rad)."""
    _check_small(HEADING_TOLERANCE.high, "rad (write deg(1) for degrees)", angles)


def _check_small(most: float, unit: str, values: Mapping[str, float | None]) -> None:
    check_limits(**values)
    for name, value in values.items():
        if value is not None and value > most:
            _refuse(name, value, f"above 0, up to {most:g} {unit}")


def check_duties(left: float, right: float) -> None:
    """Raise ValueError naming the first value that is not a duty (-1 to 1), TypeError if it is not a
    number."""
    for name, duty in (("left", left), ("right", right)):
        check_number(f"{name} duty", duty, "from -1 to 1")
        if not -1.0 <= duty <= 1.0:
            raise ValueError(f"{name} duty is {duty}: allowed are numbers from -1 to 1 (80 % are 0.8)")


def check_wait(seconds: float) -> None:
    """Raise ValueError if a value is not a waiting time (s), TypeError if it is not a number."""
    allowed = f"from 0 to {LONGEST_WAIT_S:g} s (500 ms are 0.5)"
    check_number("seconds", seconds, allowed)
    if not 0.0 <= seconds <= LONGEST_WAIT_S:
        _refuse("seconds", seconds, allowed)


def check_way(**ways: float) -> None:
    """Raise ValueError naming the first value that is not an allowed distance (m), TypeError if it is not a
    number."""
    allowed = f"up to {LONGEST_WAY_M:g} m either way (30 cm are 0.30)"
    for name, value in ways.items():
        check_number(name, value, allowed)
        if not abs(value) <= LONGEST_WAY_M:
            _refuse(name, value, allowed)


def check_angle(turns: float = 1.0, more: str = "turns= allows more", /, **angles: float) -> None:
    """Raise ValueError naming the first value that is not an angle (rad) of at most `turns` full turns. more:
    what to write for a larger angle."""
    check_positive("turns", turns)
    most = f"up to {turns:g} turn{'' if turns == 1.0 else 's'} in rad either way"
    for name, value in angles.items():
        check_number(name, value, f"{most} (write deg(90) for degrees)")
        if abs(value) <= turns * math.tau * (1.0 + ROUNDING):
            continue
        meant = (
            f"write deg({value:g}) for degrees"
            if looks_like_degrees(value)
            else f"it is {math.degrees(value):g} degrees"
        )
        _refuse(name, value, f"{most} ({'; '.join(filter(None, (meant, more)))})")


def check_heading(**headings: float) -> None:
    """Raise ValueError naming the first value that is not a heading (rad), which may count full turns."""
    check_angle(MAX_TURNS, "", **headings)
    for name, value in headings.items():
        check_heading_unit(name, value)


def check_speed(**speeds: float | None) -> None:
    """Raise ValueError naming the first value that is given and is not a speed (m/s), of either sign."""
    _check_size(FASTEST_SPEED, f"up to {FASTEST_SPEED:g} m/s (20 cm/s are 0.20)", speeds)


def check_rate(**rates: float | None) -> None:
    """Raise ValueError naming the first value that is given and is not a turn rate (rad/s)."""
    _check_size(FASTEST_TURN, f"up to {FASTEST_TURN:g} rad/s (write deg(90) for degrees a second)", rates)


def check_pace(hint: str = "", /, **speeds: float | None) -> None:
    """Raise ValueError naming the first value that is given and is not a speed (m/s) above 0 for a motion to
    a goal. hint: what to write instead."""
    check_speed(**speeds)
    check_limits(hint, **speeds)
    _check_least(SPEED.low, "m/s", speeds)


def check_turn_pace(hint: str = "", /, **rates: float | None) -> None:
    """Raise the same errors for turn rates (rad/s)."""
    check_rate(**rates)
    check_limits(hint, **rates)
    _check_least(RATE.low, "rad/s", rates)


def _check_least(least: float, unit: str, values: Mapping[str, float | None]) -> None:
    for name, value in values.items():
        if value is not None and value < least:
            _refuse(name, value, f"from {least:g} {unit}: more slowly it would never reach its goal")


def _check_size(most: float, allowed: str, values: Mapping[str, float | None]) -> None:
    for name, value in values.items():
        if value is None:
            continue
        check_number(name, value, allowed)
        if not abs(value) <= most:
            _refuse(name, value, allowed)


def check_name(**names: str) -> None:
    """Raise TypeError for the first value that is not a text: parts are named, and robot.toml has their
    ports."""
    for kind, name in names.items():
        if not isinstance(name, str):
            raise TypeError(f"{kind} is {name!r}: it must be a name from robot.toml, where its port is set")


def check_port(kind: str, port: int, count: int) -> None:
    """Raise ValueError for a port that does not exist."""
    if isinstance(port, bool) or port not in range(count) or not hasattr(port, "__index__"):
        raise ValueError(f"{kind} port is {port!r}: allowed are 0 to {count - 1}")


def check_counts(counts: float, beyond: float) -> None:
    """Raise ValueError for counts that an analog port never reads. beyond: the end of the range at which a
    condition could never hold."""
    allowed = f"from 0, below {beyond:g}" if beyond else f"above 0, up to {ANALOG_FULL_SCALE}"
    check_number("counts", counts, allowed)
    if not 0.0 <= counts <= ANALOG_FULL_SCALE or counts == beyond:
        _refuse("counts", counts, allowed)


def check_kind(value: Any, kind: type, where: str, hint: str = "") -> None:
    """Raise TypeError if `value` is of another kind; a function that was not called is named as such."""
    if isinstance(value, kind):
        return
    name = getattr(value, "__name__", None)
    what = f"the function {name}" if callable(value) and name else format_value(value)
    if inspect.isgenerator(value):
        what = f"what the function {name} yields"
        hint = f"{hint}: give the function itself, Action('{name}', {name}), or write seq() instead of yield"
    elif kind.__name__ == "Action" and type(value).__name__ == "MotionResult":
        what, hint = (
            "the result of one",
            f"{hint}: run() has already run it; give the action itself, without run()",
        )
    elif kind.__name__ == "Action" and type(value).__name__ == "Condition":
        hint = f"{hint}: write wait_for(condition), or action.until(condition)"
    called = f": call it, {name}(...)" if callable(value) and name and name != "<lambda>" else ""
    article = "an" if kind.__name__[0] in "AEIOU" else "a"
    raise TypeError(f"{where} takes {article} {kind.__name__}, not {what}{called}{hint}")


def check_robot(robot: object, where: str) -> None:
    """Raise TypeError if something else is given in place of the robot: it was left out, or arguments are
    exchanged. A robot that is not open reports that itself."""
    if not hasattr(type(robot), "__enter__"):
        call = f"{where.removesuffix(')')}robot, ...)"
        raise TypeError(f"{where} takes the robot first, not {robot!r}: write {call}")


def check_function(function: object, where: str, *of: str) -> None:
    """Raise TypeError if `function` is not a function of so many arguments. of: what the arguments are
    called."""
    if callable(function) and can_take(function, *of):
        if inspect.isgeneratorfunction(function) or inspect.iscoroutinefunction(function):
            name = getattr(function, "__name__", repr(function))
            raise TypeError(
                f"{where} takes a function that returns at once, but {name} has steps (it yields or is "
                f"async): write Action('{name}', {name}) to make an action of it"
            )
        return
    what = repr(function)
    if callable(function) and hasattr(function, "__name__"):
        what = f"{function.__name__}{inspect.signature(function)}"
    given = f"of the {' and '.join(of)}" if of else "without arguments"
    called = "give its name without (), which would call it at once, or " if function is None else ""
    raise TypeError(
        f"{where} takes a function {given}, not {what}: {called}write {' '.join(('lambda', *of))}: ..."
    )


def can_take(function: Callable[..., Any], *arguments: object) -> bool:
    """Whether `function` can be called with these arguments, as far as its signature shows."""
    try:
        inspect.signature(function).bind(*arguments)
    except TypeError:
        return False
    except ValueError:  # some functions written in C do not tell
        return True
    return True


def _refuse(name: str, value: float, allowed: str) -> None:
    if not math.isfinite(value):
        raise ValueError(f"{name} is {value}: it must be a finite number, {allowed}")
    raise ValueError(f"{name} is {value:g}: allowed are numbers {allowed}")
