"""Squaring up to a wall by pressing against it until both wheels stand."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from raccoon.core.errors import MotionTimeout
from raccoon.model.pose import Pose
from raccoon.robot.actions.actions import Action, Steps
from raccoon.robot.actions.limits import (
    check_finite,
    check_heading,
    check_heading_tolerance,
    check_limit,
    check_positive,
    check_speed,
)
from raccoon.robot.motions.pacing import MotionResult
from raccoon.robot.remarks import STANDING_SPEED, add_remark

if TYPE_CHECKING:
    from raccoon.control.feedforward import WheelModel
    from raccoon.robot.robot import Robot

WALL_SPEED_SHARE = 0.2
WALL_TIME_S = 0.3
PRESS_FORCE_N, MIN_FORCE_N, EASING_S = 12.0, 2.0, 0.08
"""N per wheel beyond rolling resistance: at first, and once both wheels are held; time constant (s) of the
decrease. A heavy robot needs the first to slide a corner along the wall. Tyres with a friction coefficient of
0.55 under a light robot carry less than 3 N, and wheels that spin do not show that they are at a wall."""
LADEN_FORCE_N = 1.5
"""N beyond rolling resistance from which something holds a wheel."""
ROLLING_TIME_S, ROLLING_SMOOTHING_S = 0.2, 0.03
"""s after which a wheel has reached its speed, and s over which its torque is smoothed."""
MAX_FRICTION_ERROR = 0.5
"""Largest difference of a rolling wheel's friction from the model's, as a share of it, that is believed."""
TURN_TIME_S, TURN_RATE = 0.08, 0.15
"""s over which the turn rate is averaged, and the rate (rad/s) from which the robot squares up: its corner
slides along the wall, so both wheels carry load although it is not square yet."""
SLOWED_SHARE, SQUARING_SHARE = 0.9, 0.15
"""Shares of the highest speed on the way: slower wheels are at a wall; wheels that differ by twice the second
turn the robot."""


def align_on_wall(
    speed: float = 0.06,
    *,
    heading: float | None = None,
    heading_std: float = math.radians(1.0),
    timeout: float = 5.0,
) -> Action[MotionResult]:
    """Push against a wall until both wheels stand, so that the robot is square to it.

    speed: m/s of the approach, negative backwards. The robot presses with 12 N per wheel beyond rolling
    resistance until both wheels are held and it does not turn any more, then with 2 N: most motors are
    stronger than the grip, and would spin the wheels for ever. heading: rad of the field that the robot has
    at the wall, if known: the odometry takes it over, with `heading_std` rad, or reports that it is too far
    off to be believed (`remarks` of the result). Raises MotionTimeout if the wheels still turn after
    `timeout` s: there is no wall, or they spin at it.
    """
    check_speed(speed=speed)
    check_finite(speed=speed)  # None is no default here
    check_heading(heading=0.0 if heading is None else heading)
    check_positive("heading_std", heading_std)
    check_heading_tolerance(heading_std=heading_std)
    check_limit(timeout=timeout)
    if speed == 0.0:
        raise ValueError("speed is 0: allowed are numbers above or below it")

    def steps(robot: Robot) -> Steps[MotionResult]:
        begin, before, quiet = robot.time, robot.estimate.distance, 0.0
        wheel_speed = robot.drive.wheel_speed(speed)
        at_wall = _WallWay(robot.drive.half_track)
        press = _PressForce(robot.drive.wheels.models, speed / wheel_speed, speed)
        try:
            while quiet < WALL_TIME_S:
                if robot.time - begin > timeout:
                    way = abs(robot.estimate.distance - before)
                    raise MotionTimeout(f"no wall after {timeout:g} s: {_describe_no_wall(robot, way)}")
                here = robot.estimate
                turns = max(abs(here.left_speed), abs(here.right_speed)) > WALL_SPEED_SHARE * abs(wheel_speed)
                started = robot.time - begin > WALL_TIME_S
                unread = any(robot.odometry.silent_wheels)  # they say nothing, not that they stand
                moving = turns or press.is_turning or unread or not started
                quiet = 0.0 if moving else quiet + robot.dt
                at_wall.update(here.velocity, here.turn_rate, robot.dt, started)
                # At first all of it: a robot that stands sticks.
                most = press.max_torques if started else (math.inf, math.inf)
                turning_at = here.left_speed, here.right_speed
                volts = robot.drive.push(speed, robot.battery_voltage, turning_at, most)
                if robot.time - begin > ROLLING_TIME_S:
                    press.update(volts, turning_at, here.heading, robot.dt)
                yield
        finally:
            robot.drive.stop()
            robot.odometry.doubt_way(at_wall.way)
            robot.replan()
        return _wall_result(robot, robot.time - begin, heading, heading_std)

    return Action("align on a wall", steps)


def _wall_result(robot: Robot, took: float, heading: float | None, heading_std: float) -> MotionResult:
    """The result for a robot that stands at a wall after `took` s."""
    heading_error = 0.0
    said: tuple[str, ...] = ()
    if heading is not None:
        heading_error = math.remainder(robot.estimate.heading - heading, math.tau)
        said = _observe_wall_heading(robot, heading_error, heading, heading_std)
    here = robot.estimate
    robot.plan = Pose(here.x, here.y, here.heading)
    std = math.hypot(here.x_std, here.y_std)
    return MotionResult(0.0, 0.0, heading_error, took, std, False, here.heading_std, remarks=said)


def _describe_no_wall(robot: Robot, way: float) -> str:
    """What the wheels do if they do not both stand. way: m that they turned."""
    here, drive = robot.estimate, robot.config.drive
    if any(robot.odometry.silent_wheels):  # what they do is a guess
        return "; ".join(here.reasons)
    for side, port, speed, other in (
        ("left", drive.left, here.left_speed, here.right_speed),
        ("right", drive.right, here.right_speed, here.left_speed),
    ):
        if abs(speed) < STANDING_SPEED < abs(other):
            return (
                f"only the {side} wheel stands still (motor port {port}): blocked, unplugged, or a "
                "tripped fuse"
            )
    on_the_way = f"after {way:.2f} m, on the way to the wall (allow a longer timeout=)"
    return f"the wheels still turn {on_the_way} or spinning at it"


class _RollingTorque:
    """Learns the torque with which a wheel rolls, which an untuned model may have half wrong: the least that
    it took. other: N m of it beyond the model's friction. beyond: N m that the wheel takes now beyond both.
    way: direction of turning, 1 or -1."""

    def __init__(self, model: WheelModel, way: float) -> None:
        self._model, self._way = model, way
        self._smooth_torque = self._least_torque = math.inf
        self.friction_error = self.excess_torque = 0.0

    def update(self, volts: float, speed: float, dt: float) -> None:
        """Take a cycle: voltage of the motor (V), speed of its wheel (rad/s) and duration (s)."""
        model = self._model
        over = self._way * (volts - model.voltage(speed))
        torque = over * model.back_emf_constant / model.resistance
        before = torque if self._smooth_torque == math.inf else self._smooth_torque
        self._smooth_torque = before + min(dt / ROLLING_SMOOTHING_S, 1.0) * (torque - before)
        self._least_torque = min(self._least_torque, self._smooth_torque)
        most = MAX_FRICTION_ERROR * model.coulomb
        self.friction_error = max(-most, min(self._least_torque, most))
        self.excess_torque = self._smooth_torque - self.friction_error


class _PressForce:
    """The largest pressing force of the wheels, which decreases while something holds both of them."""

    def __init__(self, models: tuple[WheelModel, WheelModel], radius: float, speed: float) -> None:
        self._wheels = [_RollingTorque(model, math.copysign(1.0, speed)) for model in models]
        self._radius, self._force = radius, PRESS_FORCE_N
        self._slow_heading: float | None = None
        self.is_turning = False
        """Whether the wall turns the robot."""

    @property
    def max_torques(self) -> tuple[float, float]:
        """Largest torque of the left and the right wheel beyond their models' friction, N m."""
        left, right = self._wheels
        torque = self._force * self._radius
        return torque + left.friction_error, torque + right.friction_error

    def update(
        self, volts: tuple[float, float], speeds: tuple[float, float], heading: float, dt: float
    ) -> None:
        """Take a cycle: voltages (V) and speeds (rad/s) of both wheels, the robot's heading (rad) and the
        duration (s)."""
        slow = heading if self._slow_heading is None else self._slow_heading
        self._slow_heading = slow + min(dt / TURN_TIME_S, 1.0) * (heading - slow)
        self.is_turning = abs(heading - slow) > TURN_RATE * TURN_TIME_S
        for wheel, given, speed in zip(self._wheels, volts, speeds, strict=True):
            wheel.update(given, speed, dt)
        rolls = min(wheel.excess_torque for wheel in self._wheels) < LADEN_FORCE_N * self._radius
        if rolls or self.is_turning:  # one of them turns the robot square
            self._force = PRESS_FORCE_N
        else:
            self._force += min(dt / EASING_S, 1.0) * (MIN_FORCE_N - self._force)


class _WallWay:
    """Sums in `way` (m) what the wheels turn from where the wall slows them until they stand: tyres slip
    while they press, so the robot may have stood. While the robot turns, it rolls up to the wall."""

    def __init__(self, half_track: float) -> None:
        self.way = 0.0
        self._half_track, self._fastest = half_track, 0.0

    def update(self, velocity: float, turn_rate: float, dt: float, started: bool) -> None:
        """Take a cycle: speed (m/s), turn rate (rad/s) and duration (s). started: whether the robot has had
        time to reach its speed."""
        speed = abs(velocity)
        self._fastest = max(self._fastest, speed)
        squares_up = abs(turn_rate) * self._half_track > SQUARING_SHARE * self._fastest
        if started and speed < SLOWED_SHARE * self._fastest and not squares_up:
            self.way += speed * dt


def _observe_wall_heading(robot: Robot, heading_error: float, heading: float, std: float) -> tuple[str, ...]:
    """Give the odometry the heading of a wall, from which it is `off` rad; returns the remark about that."""
    found = robot.odometry.observe_heading(heading, std)
    if found.accepted:
        return ()
    remark = (
        f"align_on_wall: heading={math.degrees(heading):.1f} deg is not used, the odometry is "
        f"{math.degrees(heading_error):.1f} deg from it: {found.reason}; it is another wall, the gyro's "
        "scale is wrong (check with ten turns by hand), or the robot was moved or pushed (give its pose to "
        "robot.odometry.reset)"
    )
    add_remark(robot, remark)
    return (remark,)
