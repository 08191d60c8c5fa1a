"""What was meant by a name that is not here: by habit, or as other libraries call it."""

from __future__ import annotations

import inspect
from dataclasses import is_dataclass
from importlib import import_module
from types import FrameType
from typing import TYPE_CHECKING, NoReturn

if TYPE_CHECKING:
    from raccoon.core.config import RobotConfig
    from raccoon.core.readings import Inputs

_DUTIES = "robot.run(motors(left, right).until(...)) or, by the way to go, robot.run(straight(m))"
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
"""What stands here for the functions of KIPR's library."""
NAMES_ELSEWHERE = {
    **KIPR_NAMES,
    **{name: f"robot.pose.{name}" for name in ("x", "y", "heading")},
    **{name: f"robot.estimate.{name}" for name in ("distance", "velocity", "turn_rate", "status")},
    "name": "robot.config.name",
}
"""What other libraries, and habit, call something that has another place here."""
PARTS = ("tophat", "servo", "mechanism")
"""Sections of robot.toml whose names somebody may take for attributes."""


def hint_for_name(name: str, config: RobotConfig | None) -> str:
    """What to write instead of an attribute that a robot does not have; "" where nothing is like it.

    config: of the robot, whose own names may be meant.
    """
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


def refuse_name(name: str, asking: FrameType) -> NoReturn:
    """Raise what says that the package `raccoon` has no `name`, and what to write instead.

    asking: the frame that asked. An `import` in it would hide the words of an AttributeError, so it gets an
    ImportError.
    """
    from opcode import opmap

    if name not in KIPR_NAMES:
        raise AttributeError(f"module 'raccoon' has no attribute {name!r}")
    said = f"raccoon has no {name}: write {KIPR_NAMES[name]} (docs/from-kipr.md)"
    if asking.f_code.co_code[asking.f_lasti] == opmap["IMPORT_FROM"]:
        raise ImportError(said, name="raccoon")
    raise AttributeError(said)


def add_value_hint(error: BaseException | None) -> None:
    """Add to the error of `robot.pose()`, which calls a value like a function, what to write."""
    if not (isinstance(error, TypeError) and str(error).endswith("object is not callable")):
        return
    from dis import get_instructions

    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    if trace is None:
        return
    called = ""
    for each in get_instructions(trace.tb_frame.f_code):
        if each.opname in ("LOAD_ATTR", "LOAD_METHOD"):
            called = each.argval
        elif each.opname == "CALL" and each.offset == trace.tb_lasti and each.argval == 0 and called:
            error.add_note(f"{called} is a value, no function: write .{called} without ()")
        elif each.opname not in ("PRECALL", "PUSH_NULL", "CACHE"):
            called = ""


def add_names_hint(error: BaseException | None) -> None:
    """Add to the error of `result.distance`, a name that a record of raccoon does not have, those it has."""
    if not isinstance(error, AttributeError) or not is_dataclass(error.obj):
        return
    kind = type(error.obj)
    if kind.__module__.startswith("raccoon."):
        names = [each for each in dir(kind) if not each.startswith("_")]
        error.add_note(f"of a {kind.__name__} a program asks {', '.join(names)}")


def add_unread_hint(error: TypeError, inputs: Inputs | None) -> None:
    """Add to the error of a program that reckons with readings before there are any how to get some.

    inputs: the robot's.
    """
    if inputs is None and "NoneType" in str(error):
        error.add_note("nothing was read yet, so every reading is None: write robot.run(wait(0.1)) first")


class Part:
    """A part of a robot that programs look at and motions move.

    called: what to write where somebody calls it, or asks it to do something. offers: what programs ask it.
    """

    called = ""
    offers = ""

    if not TYPE_CHECKING:  # a type checker knows that it has nothing else

        def __call__(self, *_: object, **__: object) -> NoReturn:
            raise TypeError(f"a {type(self).__name__} is not called: write {self.called}")

        def __getattr__(self, name: str) -> object:
            if name.startswith("_") or hasattr(type(self), name):  # and it failed: with its own error
                return object.__getattribute__(self, name)
            raise AttributeError(
                f"a {type(self).__name__} has no {name}: it has {self.offers}; else write {self.called}"
            )
