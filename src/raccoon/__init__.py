"""raccoon: the same drive on every battery, with every motor and in every light.

A team program needs only this module::

    from raccoon import after_distance, deg, drive, open_robot, pressed, turn

    with open_robot("robot.toml") as robot:
        robot.run(drive(0.15).until(pressed(0) | after_distance(0.40)))
        robot.run(turn(deg(90)))

Names are loaded when they are first used: importing raccoon costs next to nothing.
"""

from __future__ import annotations

from importlib import import_module
from math import radians as deg

# As typing has it, whose import would take longer than all of this. Without the type, jedi, which completes
# names in Thonny and Jupyter, would rely on the value and skip what follows.
TYPE_CHECKING: bool = False
if TYPE_CHECKING:
    from raccoon.core.config import RobotConfig, load_robot
    from raccoon.core.errors import (
        CalibrationError,
        ConfigError,
        HardwareError,
        MotionTimeout,
        RaccoonError,
        ReplayDiverged,
        Stopped,
        TraceError,
    )
    from raccoon.core.port import Port
    from raccoon.core.readings import Inputs, Outputs, Status
    from raccoon.model.pose import Pose
    from raccoon.robot.actions.actions import (
        Action,
        background,
        parallel,
        race,
        repeat,
        wait,
        wait_for,
    )
    from raccoon.robot.actions.condition import Condition
    from raccoon.robot.actions.conditions import (
        after_angle,
        after_distance,
        after_time,
        analog_above,
        analog_below,
        blocked,
        bumped,
        button_pressed,
        on_black,
        on_white,
        over_line,
        pressed,
        stalled,
        when,
    )
    from raccoon.robot.actions.functions import do
    from raccoon.robot.actions.sequences import mission, seq, timed
    from raccoon.robot.calibration.battery_check import check_battery
    from raccoon.robot.calibration.by_hand import calibrate_tophats_by_hand
    from raccoon.robot.calibration.light import calibrate_light, rehearse_light
    from raccoon.robot.calibration.tophats import calibrate_tophats, load_tophats
    from raccoon.robot.calibration.wheels import calibrate_drive
    from raccoon.robot.match import MatchReport, run_match, wait_for_light
    from raccoon.robot.motions.crossings import at_crossing
    from raccoon.robot.motions.driving import drive, motors
    from raccoon.robot.motions.following import follow_line
    from raccoon.robot.motions.goals import MotionResult, arc, pivot, straight, turn, turn_to
    from raccoon.robot.motions.lines import align_on_line
    from raccoon.robot.motions.paths import drive_to, follow_path
    from raccoon.robot.motions.walls import align_on_wall
    from raccoon.robot.opening import open_robot, replay
    from raccoon.robot.parts.mechanisms import move, move_by, release, spin, zero
    from raccoon.robot.parts.servos import servo, servo_off
    from raccoon.robot.robot import Robot

__version__ = "0.1.0"

_HOMES = {
    "raccoon.core.config": ("RobotConfig", "load_robot"),
    "raccoon.core.errors": (
        "CalibrationError",
        "ConfigError",
        "HardwareError",
        "MotionTimeout",
        "RaccoonError",
        "ReplayDiverged",
        "Stopped",
        "TraceError",
    ),
    "raccoon.core.port": ("Port",),
    "raccoon.core.readings": ("Inputs", "Outputs", "Status"),
    "raccoon.model.pose": ("Pose",),
    "raccoon.robot.actions.actions": (
        "Action",
        "background",
        "parallel",
        "race",
        "repeat",
        "wait",
        "wait_for",
    ),
    "raccoon.robot.calibration.by_hand": ("calibrate_tophats_by_hand",),
    "raccoon.robot.calibration.tophats": ("calibrate_tophats", "load_tophats"),
    "raccoon.robot.calibration.wheels": ("calibrate_drive",),
    "raccoon.robot.actions.condition": ("Condition",),
    "raccoon.robot.actions.conditions": (
        "after_angle",
        "after_distance",
        "after_time",
        "analog_above",
        "analog_below",
        "blocked",
        "bumped",
        "button_pressed",
        "on_black",
        "on_white",
        "over_line",
        "pressed",
        "stalled",
        "when",
    ),
    "raccoon.robot.motions.driving": ("drive", "motors"),
    "raccoon.robot.motions.goals": (
        "MotionResult",
        "arc",
        "pivot",
        "straight",
        "turn",
        "turn_to",
    ),
    "raccoon.robot.opening": ("open_robot", "replay"),
    "raccoon.robot.motions.paths": (
        "drive_to",
        "follow_path",
    ),
    "raccoon.robot.calibration.light": ("calibrate_light", "rehearse_light"),
    "raccoon.robot.motions.lines": ("align_on_line",),
    "raccoon.robot.motions.walls": ("align_on_wall",),
    "raccoon.robot.motions.following": ("follow_line",),
    "raccoon.robot.motions.crossings": ("at_crossing",),
    "raccoon.robot.actions.functions": ("do",),
    "raccoon.robot.actions.sequences": ("mission", "seq", "timed"),
    "raccoon.robot.calibration.battery_check": ("check_battery",),
    "raccoon.robot.match": (
        "MatchReport",
        "run_match",
        "wait_for_light",
    ),
    "raccoon.robot.robot": ("Robot",),
    "raccoon.robot.parts.mechanisms": ("move", "move_by", "release", "spin", "zero"),
    "raccoon.robot.parts.servos": ("servo", "servo_off"),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "Action",
    "CalibrationError",
    "Condition",
    "ConfigError",
    "HardwareError",
    "Inputs",
    "MatchReport",
    "MotionResult",
    "MotionTimeout",
    "Outputs",
    "Port",
    "Pose",
    "RaccoonError",
    "ReplayDiverged",
    "Robot",
    "RobotConfig",
    "Status",
    "Stopped",
    "TraceError",
    "after_angle",
    "after_distance",
    "after_time",
    "align_on_line",
    "align_on_wall",
    "analog_above",
    "analog_below",
    "arc",
    "at_crossing",
    "background",
    "blocked",
    "bumped",
    "button_pressed",
    "calibrate_drive",
    "calibrate_light",
    "calibrate_tophats",
    "calibrate_tophats_by_hand",
    "check_battery",
    "deg",
    "do",
    "drive",
    "drive_to",
    "follow_line",
    "follow_path",
    "load_robot",
    "load_tophats",
    "mission",
    "motors",
    "move",
    "move_by",
    "on_black",
    "on_white",
    "open_robot",
    "over_line",
    "parallel",
    "pivot",
    "pressed",
    "race",
    "rehearse_light",
    "release",
    "repeat",
    "replay",
    "run_match",
    "seq",
    "servo",
    "servo_off",
    "spin",
    "stalled",
    "straight",
    "timed",
    "turn",
    "turn_to",
    "wait",
    "wait_for",
    "wait_for_light",
    "when",
    "zero",
]


if not TYPE_CHECKING:  # a checker that saw it would take every name, also a mistyped one, for an object

    def __getattr__(name: str) -> object:
        from sys import _getframe

        from raccoon.robot.tracebacks import install_hook_for

        asking = _getframe(1)
        install_hook_for(asking)
        home = _HOME_OF.get(name)
        if home is None:
            from raccoon.robot.name_hints import refuse_name

            refuse_name(name, asking)
        value = getattr(import_module(home), name)
        globals()[name] = value
        return value


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
