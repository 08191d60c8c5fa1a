"""Hints for names that raccoon does not have: what other libraries, or habit, call something."""

from __future__ import annotations

import inspect
import re
from dataclasses import fields, is_dataclass
from importlib import import_module
from types import FrameType, TracebackType
from typing import TYPE_CHECKING, NoReturn

from raccoon.core.near_names import did_you_mean, nearest_name

if TYPE_CHECKING:
    from raccoon.core.config import RobotConfig
    from raccoon.core.readings import Inputs
    from raccoon.robot.robot import Robot

_DUTIES = "robot.run(motors(left, right).until(...)) or, for a known distance, robot.run(straight(m))"
_MOVE, _SERVO = "robot.run(move(name, rad))", "robot.run(servo(name, place))"
KIPR_NAMES = {
    **dict.fromkeys(("motor", "motor_power", "fd", "bk"), _DUTIES),
    **dict.fromkeys(("mav", "move_at_velocity"), "robot.run(drive(speed, turn_rate).until(...))"),
    **dict.fromkeys(("mtp", "move_to_position", "bmd", "block_motor_done"), _MOVE),
    **dict.fromkeys(("mrp", "move_relative_position"), "robot.run(move_by(name, rad))"),
    **dict.fromkeys(("gmpc", "get_motor_position_counter"), "robot.mechanism(name).angle or robot.pose"),
    **dict.fromkeys(("cmpc", "clear_motor_position_counter"), "robot.run(zero(name))"),
    **dict.fromkeys(("off", "freeze"), "robot.run(release(name))"),
    **dict.fromkeys(("ao", "alloff"), "robot.stop(), from a thread: motors stop with their action"),
    **dict.fromkeys(("msleep", "sleep"), "robot.run(wait(seconds))"),
    "seconds": "robot.time",
    **dict.fromkeys(("enable_servos", "enable_servo", "set_servo_position"), _SERVO),
    **dict.fromkeys(("disable_servos", "disable_servo"), "robot.run(servo_off(name))"),
    "get_servo_position": "robot.servo(name).pulse",
    "analog": "robot.analog(port)",
    "digital": "robot.digital(port)",
    **dict.fromkeys(("push_button", "side_button", "any_button", "a_button"), "robot.button"),
    **dict.fromkeys(("gyro_x", "gyro_y", "gyro_z", "gyro"), "robot.estimate.turn_rate"),
    "power_level": "robot.battery_voltage",
    "shut_down_in": "run_match(robot, program, seconds=119)",
    "create_connect": 'port = "create" under [controller] in robot.toml',
}
"""What to use for each function of KIPR's library."""
NAMES_ELSEWHERE = {
    **KIPR_NAMES,
    **{name: f"robot.pose.{name}" for name in ("x", "y", "heading")},
    **{name: f"robot.estimate.{name}" for name in ("distance", "velocity", "turn_rate", "status")},
    "name": "robot.config.name",
    **dict.fromkeys(("reset", "reset_pose", "set_pose"), "robot.odometry.reset(x, y, heading)"),
    "position": "robot.pose",
    "angle": "robot.pose.heading",
    "voltage": "robot.battery_voltage",
    **dict.fromkeys(("elapsed", "match_time"), "robot.time, less the time at which it began"),
    **dict.fromkeys(("stop_motors", "brake"), KIPR_NAMES["ao"]),
    **dict.fromkeys(("forward", "backward"), "robot.run(straight(m)), negative backwards"),
    "log": "robot.note(text)",
}
"""Where to find what other libraries, or habit, call by these names."""
_UNKNOWN_KEYWORD = re.compile(r"(?P<function>\w+)\(\) got an unexpected keyword argument '(?P<name>\w+)'")
PARTS = ("tophat", "servo", "mechanism")
"""Sections of robot.toml whose names a program may take for attributes."""


def hint_for_name(name: str, config: RobotConfig | None) -> str:
    """What to write instead of an attribute that a robot does not have; "" if nothing is similar, or if it is
    similar to an attribute that a robot has, which Python suggests itself. config: the robot's, whose own
    names may be meant."""
    near = name if _hint_elsewhere(name, config) else nearest_name(name, import_module("raccoon").__all__)
    hint = _hint_elsewhere(near, config)
    return hint if near == name or not hint else f" (did you mean {near}?){hint}"


def _hint_elsewhere(name: str, config: RobotConfig | None) -> str:
    """What to write for a name of something other than a robot's attribute; "" for unknown names."""
    package = import_module("raccoon")
    function = getattr(package, name) if name in package.__all__ else None
    if inspect.isfunction(function):
        gives = str(function.__annotations__["return"])
        if gives.startswith("Action"):
            return f": write robot.run({name}(...))"
        if gives == "Condition":
            return f": it is a condition, as in robot.run(wait_for({name}(...)))"
        if "robot" in function.__annotations__:
            return f": write {name}(robot, ...)"
    for part in PARTS:
        if config is not None and name in getattr(config, f"{part}s"):
            return f": write robot.{part}({name!r})"
    return f": write {NAMES_ELSEWHERE[name]}" if name in NAMES_ELSEWHERE else ""


def hint_for_setting(name: str, robot: Robot) -> str:
    """What to write instead of setting `name`, which a robot does not have; "" for a name that resembles
    nothing: it is the program's own."""
    from raccoon.core.sections import MotionConfig

    setting = re.sub("^(max|top|drive)_", "", name)
    key = nearest_name(setting, [each.name for each in fields(MotionConfig)])
    if hasattr(type(robot), name):
        return "it is a function"
    if key and abs(len(key) - len(setting)) <= 1:
        return f"write {key} under [motion] of robot.toml; motions also take speeds as arguments"
    known = [each for each in dir(robot) if not each.startswith("_") and each != name]
    similar = did_you_mean(name, known)
    return f"a robot has none{similar}; keep a value of your own in a variable" if similar else ""


def refuse_name(name: str, asking: FrameType) -> NoReturn:
    """Raise an error that the package `raccoon` has no `name`, with what to write instead. asking: the frame
    that asked for it. In an `import` Python would replace the text of an AttributeError, so an ImportError is
    raised."""
    from opcode import opmap

    hint = _kipr_hint(name)
    if asking.f_code.co_code[asking.f_lasti] == opmap["IMPORT_FROM"]:
        hint = hint or did_you_mean(name, import_module("raccoon").__all__)
        raise ImportError(f"raccoon has no {name}{hint}", name="raccoon")
    raise AttributeError(f"raccoon has no {name}{hint}")


def _kipr_hint(name: str) -> str:
    """What to write for a function of KIPR's library; "" for other names."""
    return f": write {KIPR_NAMES[name]} (docs/from-kipr.md)" if name in KIPR_NAMES else ""


def add_hints(error: BaseException | None) -> None:
    """Add to a program's error what to write instead, if that is known; once."""
    for add in (_add_value_hint, _add_index_hint, _add_names_hint, _add_missing_name_hint, _add_keyword_hint):
        add(error)


def _add_note(error: BaseException, note: str) -> None:
    if note not in getattr(error, "__notes__", ()):
        error.add_note(note)


def _failing_step(error: BaseException) -> TracebackType | None:
    """Where the program or library was that raised the error."""
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    return trace


def _add_value_hint(error: BaseException | None) -> None:
    """Add a hint to the error of `robot.pose()`, which calls a value like a function."""
    if not (isinstance(error, TypeError) and str(error).endswith("object is not callable")):
        return
    from dis import get_instructions

    trace = _failing_step(error)
    if trace is None:
        return
    called = ""
    for each in get_instructions(trace.tb_frame.f_code):
        if each.opname in ("LOAD_ATTR", "LOAD_METHOD"):
            called = each.argval
        elif each.opname == "CALL" and each.offset == trace.tb_lasti and each.argval == 0 and called:
            _add_note(error, f"{called} is a value, not a function: write .{called} without ()")
        elif each.opname not in ("PRECALL", "PUSH_NULL", "CACHE"):
            called = ""


def _add_index_hint(error: BaseException | None) -> None:
    """Add a hint to the error of `robot.analog[0]`, which takes a function for a list."""
    trace = _failing_step(error) if isinstance(error, TypeError) else None
    if trace is None or str(error) != "'method' object is not subscriptable":
        return
    from dis import get_instructions

    asked = ""
    for each in get_instructions(trace.tb_frame.f_code):
        on_line = each.positions is not None and each.positions.lineno == trace.tb_lineno
        if on_line and each.offset < trace.tb_lasti and each.argval in ("analog", "digital", *PARTS):
            asked = each.argval
    if asked and error is not None:
        _add_note(error, f"{asked} is a function: write .{asked}(...)")


def _add_names_hint(error: BaseException | None) -> None:
    """Add to the error of `result.distance`, a name that a record of raccoon does not have, the names that it
    has."""
    if not isinstance(error, AttributeError) or not is_dataclass(error.obj):
        return
    kind = type(error.obj)
    if kind.__module__.startswith("raccoon."):
        names = [each for each in dir(kind) if not each.startswith("_")]
        _add_note(error, f"a {kind.__name__} has {', '.join(names)}")


def _add_missing_name_hint(error: BaseException | None) -> None:
    """Add to the error of `straght(0.5)` the name that is meant, if the program did not import it; otherwise
    Python suggests it itself."""
    trace = _failing_step(error) if isinstance(error, NameError) else None
    if not isinstance(error, NameError) or trace is None:
        return
    public = import_module("raccoon").__all__
    near = nearest_name(error.name, public)
    if error.name in KIPR_NAMES:
        _add_note(error, f"raccoon has no {error.name}{_kipr_hint(error.name)}")
    elif near and near not in trace.tb_frame.f_globals:
        asked = "" if near == error.name else f"did you mean {near}? "
        _add_note(error, f"{asked}It takes: from raccoon import {near}")


def _add_keyword_hint(error: BaseException | None) -> None:
    """Add to the error of `straight(0.5, sped=0.1)` the arguments that exist."""
    found = _UNKNOWN_KEYWORD.match(str(error)) if isinstance(error, TypeError) else None
    package = import_module("raccoon")
    if error is None or found is None or found["function"] not in package.__all__:
        return
    names = list(inspect.signature(getattr(package, found["function"])).parameters)
    meant = did_you_mean(found["name"], names)
    _add_note(error, f"{found['function']}() takes {', '.join(names)}{meant}")


def add_unread_hint(error: TypeError, inputs: Inputs | None) -> None:
    """Add to the error of a program that computes with readings before there are any how to get some. inputs:
    the robot's."""
    if inputs is None and "NoneType" in str(error):
        error.add_note(
            "no sensor has been read yet, so every reading is None: write robot.run(wait(0.1)) first"
        )


class Part:
    """A part of a robot that programs read and motions move. called: what to write if a program calls it, or
    asks it to act. offers: what programs may read."""

    called = ""
    offers = ""

    if not TYPE_CHECKING:  # a type checker knows that it has nothing else

        def __call__(self, *_: object, **__: object) -> NoReturn:
            raise TypeError(f"a {type(self).__name__} cannot be called: write {self.called}")

        def __getattr__(self, name: str) -> object:
            if name.startswith("_") or hasattr(type(self), name):  # and it failed: with its own error
                return object.__getattribute__(self, name)
            raise AttributeError(
                f"a {type(self).__name__} has no {name}: it has {self.offers}; else write {self.called}"
            )
