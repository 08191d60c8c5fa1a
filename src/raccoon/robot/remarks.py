"""Remarks about odd motors and wheels, for a motion's result, the recording and the log."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

from raccoon.core.config import REAL_CONTROLLERS
from raccoon.core.readings import GRAVITY, Fault
from raccoon.estimate.drive.estimate import AT_REST, HELD, SLIPS
from raccoon.robot.name_hints import hint_for_setting

if TYPE_CHECKING:
    from raccoon.core.readings import Inputs
    from raccoon.robot.robot import Robot
    from raccoon.robot.robot_state import RobotState

MIN_MISMATCH = 0.01
"""Relative deviation of the ratio of the wheels' scales, or of the gyro's scale, from robot.toml, from which
it is reported."""
MISMATCH_SIGMAS = 4.0
"""The same in its standard deviations."""

FAULT_REMARKS = {
    Fault.RESET: "the controller restarted: charge the battery, look for a loose battery plug",
    Fault.BROWN_OUT: "the battery is so low that the controller may restart: charge it",
    Fault.IMU_FROZEN: "the IMU is missing or repeats one reading: headings come from the wheels alone",
    Fault.IMU_IMPLAUSIBLE: "the IMU gives impossible readings, or the controller stands on edge: headings "
    "come from the wheels alone",
    Fault.BEMF_FROZEN: "a motor turns but its back-EMF repeats one reading, so the speed of its wheel is "
    "unknown and motions end: switch the controller off and on",
    Fault.SENSOR_LOST: "an added sensor does not answer: check its plug and its supply",
}
"""Remarks on faults that the port does not correct by itself. Faults of motors are reported by motions."""

DRIVEN_DUTY, STANDING_SPEED, STUCK_AFTER_S = 0.2, 0.1, 1.0
"""Duty that turns any motor, speed (rad/s) below which it stands, and s after which that is reported: motions
to a goal have given up by then, other code may go on for ever."""

PUSHING_AFTER_S = 3.0
"""s of slipping or pushing after which it is reported for a motion without a goal; who pushes on purpose is
done by then."""
PUSHING_REASONS = frozenset({HELD, *SLIPS.values()})
"""Reasons of an estimate of a robot that slips or pushes."""

ENDLESS_AFTER_S = 120.0
"""s of a motion without a goal, a whole match, after which it is reported that nothing ends it."""

NUMBER_PATTERN = re.compile(r"(?<![\w.])(?<!port )(?<!analog )[-+]?\d[.\d]*(?:e[-+]\d+)?")
"""A number in a remark that is not part of a name (arm2) or a port."""

OFFSET_REMARK = (
    "a motor at rest reads motion that its bemf_offset in robot.toml does not explain, which makes the "
    "pose wrong: calibrate again, or remove the offset and let the robot stand before it drives"
)


def find_oddities(robot: Robot) -> tuple[str, ...]:
    """Sentences, naming side and port, about motors that are not as they should be and scales that do not
    match.

    A disagreement of wheels and gyro goes first, since remarks about motors then only follow from it.
    """
    if robot.odometry.turn_share != 1.0:
        return (_describe_turn_mismatch(robot),)
    off, found = scale_mismatch(robot), robot.drive.find_oddities()
    if off != 0.0:
        found = (*found, _describe_scale_mismatch(robot, off))
    found = (*found, *_describe_gyro_scale(robot))
    return (*found, OFFSET_REMARK) if AT_REST in robot.estimate.reasons else found


def scale_mismatch(robot: Robot) -> float:
    """Relative deviation of the ratio of the wheels' scales from their calibration, 0 if it is small.

    The gyro measures the ratio, so it shows that a motor or wheel was changed, but not which of the two: a
    distance is then uncertain by half of it.
    """
    drive = robot.config.drive
    stored = [robot.config.motor(port).radians_per_tick for port in (drive.left, drive.right)]
    known = [each.std / each.value for each in stored if each is not None]
    if len(known) < 2:
        return 0.0
    left, right = robot.odometry.wheel_scales
    off = right / left - 1.0
    return off if abs(off) >= max(MIN_MISMATCH, MISMATCH_SIGMAS * math.hypot(*known)) else 0.0


def _describe_turn_mismatch(robot: Robot) -> str:
    return (
        f"in turns the gyro reads {robot.odometry.turn_share:.2f} times what the wheels say: check its "
        "scale (a full turn by hand must read 360 degrees; gyro_scale under [model.imu] in robot.toml), "
        "and track_width and wheel_radius under [model.drive]"
    )


def _describe_gyro_scale(robot: Robot) -> tuple[str, ...]:
    """The remark about a gyro's scale that walls, lines and poses have shown to differ from robot.toml's."""
    (scale, std), known = robot.odometry.gyro_scale, robot.config.model.imu.gyro_scale.value
    if abs(scale - known) < max(MIN_MISMATCH * known, MISMATCH_SIGMAS * std):
        return ()
    return (
        f"compared with walls and lines, the gyro reads {scale:.3f} times what the robot turns, but "
        f"gyro_scale in robot.toml is {known:.3f}: turn the robot by hand through ten full turns and "
        "correct gyro_scale",
    )


def _describe_scale_mismatch(robot: Robot, off: float) -> str:
    drive, share, percent = robot.config.drive, 1.0 / (1.0 + off), 100.0 * abs(off)
    return (
        f"compared with the gyro, the right wheel (motor port {drive.right}) turns {share:.3f} times what "
        f"its calibration says, relative to the left one (port {drive.left}): was a motor or wheel changed? "
        f"distances may be off by {percent:.1f} %: calibrate again"
    )


def describe_miswiring(robot: Robot) -> str:
    """What the gyro shows to be plugged in other than robot.toml says; "" if nothing."""
    wiring = robot.odometry.wiring
    if not wiring.suspects:
        return ""
    if not wiring.turned:
        return (
            "the wheels turn but the robot does not: one motor is plugged in the other way round, or the "
            "robot is stuck, or it does not stand on its wheels"
        )
    if len(wiring.turned) == 2:
        return f"the robot turns in the opposite direction to its wheels: {_describe_opposite_turn(robot)}"
    side = wiring.turned[0]
    port = robot.config.drive.left if side == "left" else robot.config.drive.right
    other = "false" if robot.config.motor(port).inverted else "true"
    return (
        f"the robot turns as if the {side} motor (port {port}) were plugged in the other way round: turn "
        f"its plug round, or write inverted = {other} under [motor.{port}] in robot.toml"
    )


def _describe_opposite_turn(robot: Robot) -> str:
    """What turns a robot against both wheels. Which way up the gyro is shows the accelerometer beside it."""
    accel = None if robot.inputs is None else robot.inputs.accel
    up = 0.0 if robot.inputs is None or accel is None else accel[2] * robot.inputs.device.accel_m_s2
    if up < -0.5 * GRAVITY:
        return (
            "the gyro is upside down, as the accelerometer beside it shows: mount the controller the right "
            "way up, or correct the axes of an added IMU"
        )
    wheels = (
        "left and right are exchanged (drive.left and drive.right in robot.toml){} both motors are plugged "
        "in the other way round"
    )
    which = "; raccoon doctor says how to find out which"
    if up > 0.5 * GRAVITY:
        return wheels.format(", or") + which
    return wheels.format(",") + ", or the gyro is upside down" + which


def remark_oddities(robot: Robot) -> tuple[str, ...]:
    """The oddities. New ones also go into the recording and the log "raccoon"."""
    found = find_oddities(robot)
    for said in found:
        add_remark(robot, said)
    return found


def remark_cycle(robot: Robot, inputs: Inputs) -> None:
    """Report what this cycle shows to be wrong and the program cannot know otherwise."""
    for fault in inputs.faults:
        if fault in FAULT_REMARKS and fault not in robot.drive.remarks:
            add_remark(robot, FAULT_REMARKS[fault] + _describe_guessed_angle(robot, fault), fault)
    if robot.odometry.wiring.turned:
        add_remark(robot, describe_miswiring(robot))
    if any(robot.outputs.duty):
        stuck = stuck_motors(robot)
        robot.stuck = {name: robot.stuck.get(name, 0.0) + robot.dt for name in stuck} if stuck else {}
        if stuck and max(robot.stuck.values()) > STUCK_AFTER_S:
            add_remark(
                robot, f"power but no motion at {' and '.join(stuck)}: blocked, unplugged, or a tripped fuse"
            )
    else:
        robot.stuck = {}


def stuck_motors(robot: Robot) -> tuple[str, ...]:
    """Wheels and mechanisms, with their motor ports, that have power and do not turn now."""
    if not robot.drive.followed:
        return ()
    drive, here = robot.config.drive, robot.estimate
    wheels = zip(
        (("left", drive.left, here.left_speed), ("right", drive.right, here.right_speed)),
        robot.odometry.silent_wheels,
        strict=True,
    )
    standing = robot.drive.wheels.standing
    turning = [each for each, silent in wheels if not silent and each[0] not in standing]
    for name, each in robot.attachments.mechanisms.items():
        if each.moved_by is not None:  # one that only holds has power and stands
            turning.append((name, each.config.motor, each.rate))
    return tuple(
        f"{name} (motor port {port})"
        for name, port, speed in turning
        if abs(robot.outputs.duty[port]) > DRIVEN_DUTY and abs(speed) < STANDING_SPEED
    )


def _describe_guessed_angle(robot: Robot, fault: Fault) -> str:
    """The addition to a remark if a restart of the controller made the angle of a mechanism a guess."""
    held = " and ".join(robot.attachments.held) if fault is Fault.RESET else ""
    return held and f"; how far {held} turned meanwhile is unknown: drive it against its end stop"


def remark_undriven(robot: Robot, times: int) -> None:
    """Report that speeds set before a `run` drive nothing. times: in a row, without a `tick` between them; a
    loop that was left before its own tick sets one once."""
    if times == 2:
        add_remark(
            robot,
            "a speed set by robot.drive lasts for one robot.tick() only, and run() stops the robot first: "
            "set it again before each tick(), or write robot.run(drive(speed, turn_rate).until(...))",
        )


class PushingRemark:
    """Reports once that something holds the robot in a motion without a goal. Call `tell` in each tick.
    label: what drives."""

    def __init__(self, robot: Robot, label: str) -> None:
        self._robot, self._label, self._lasted = robot, label, 0.0

    def tell(self) -> None:
        """Take one more tick."""
        robot = self._robot
        pushes = not PUSHING_REASONS.isdisjoint(robot.estimate.reasons)
        self._lasted = self._lasted + robot.dt if pushes else 0.0
        if self._lasted > PUSHING_AFTER_S:
            self._lasted = -math.inf
            add_remark(
                robot,
                f"{self._label}: for {PUSHING_AFTER_S:g} s the wheels have slipped or pushed as at a wall: "
                "end the motion there with .until(bumped()) or .timeout(seconds)",
            )


class EndlessRemark:
    """Reports once that nothing ends what has lasted for a whole match. Call `tell` in each tick. label: what
    lasts. append: what ends it."""

    def __init__(self, robot: Robot, label: str, append: str) -> None:
        self._robot, self._label, self._append = robot, label, append
        self._due = robot.time + ENDLESS_AFTER_S

    def tell(self) -> None:
        """Take one more tick."""
        if self._robot.time > self._due:
            self._due = math.inf
            simulated = self._robot.config.controller.port not in REAL_CONTROLLERS
            waits = (
                " (in simulation a switch is pressed only when its [bumper] touches something)"
                if simulated
                else ""
            )
            lasts = f"{self._label} has run for {ENDLESS_AFTER_S:g} s and nothing has ended it"
            add_remark(self._robot, f"{lasts}: append {self._append}{waits}")


def remark_settings(robot: Robot, names: set[str]) -> None:
    """Tell a program that has set an attribute which resembles one of a robot, or a setting: before the first
    cycle by an AttributeError, later by a remark. names: the robot's own attributes, to which others are
    added; empty if any may be set."""
    if len(robot.__dict__) == len(names) or not names:
        return
    for name in [each for each in robot.__dict__ if each not in names]:
        names.add(name)
        hint = hint_for_setting(name, robot)
        if hint and not robot.ticks:
            raise AttributeError(f"robot.{name} cannot be set: {hint}")
        if hint:
            add_remark(robot, f"robot.{name} was set, which changes nothing: {hint}")


def add_remark(robot: RobotState, said: str, kind: str | None = None) -> None:
    """Add a remark to the recording, the log and the match report, unless one of its kind was made before.
    kind: if None, the text without measured numbers (names and ports stay)."""
    import logging

    kind = NUMBER_PATTERN.sub("", said) if kind is None else kind
    if kind not in robot.drive.remarks:
        robot.drive.remarks[kind] = said
        robot.note(f"remark: {said}")
        logging.getLogger("raccoon").warning("%s", said)
