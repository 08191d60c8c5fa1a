"""Arms and grippers on motors of their own: move to an angle and hold it, turn until something happens.

The angle is counted by the controller from its back-EMF, like the wheels'. It is 0 where the mechanism stood
when the robot was opened, or where `zero` was said: an arm that has to be exact is driven against its end
stop first. Over a mechanism at rest the counter is not believed, so its offset adds up to nothing.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from raccoon.control.feedforward import WheelModel
from raccoon.control.profile import ProfileState, profile
from raccoon.control.tuning import speed_loop_gains
from raccoon.control.wheels import LEAST_BATTERY_VOLTAGE, Wheel
from raccoon.core.config import MechanismConfig, RobotConfig
from raccoon.core.errors import MotionTimeout
from raccoon.core.readings import Device, Inputs
from raccoon.estimate.drive.wheel_track import HOLD
from raccoon.estimate.drive.wheels import resting_counts
from raccoon.model.bemf import radians_per_count
from raccoon.robot.actions.actions import Action, Steps
from raccoon.robot.actions.functions import do
from raccoon.robot.actions.limits import check_angle, check_finite, check_limits, check_rate
from raccoon.robot.parts.drive import dead_time
from raccoon.robot.parts.holding import held, require_free

if TYPE_CHECKING:
    from raccoon.robot.robot import Robot

__all__ = ["Mechanism", "move", "move_by", "release", "spin", "zero"]

REST_COUNTS = 12.0
"""Back-EMF counts below which an unpowered motor stands still: offsets are smaller, motions larger."""
PULL = 8.0
"""1/s: rad/s asked for each rad that the mechanism is off its place."""
MARGIN_TIME = 2.0
"""S beyond twice its profile that a move may take."""


class Mechanism:
    """One named motor of robot.toml that is not a wheel."""

    def __init__(self, name: str, config: MechanismConfig, robot: RobotConfig) -> None:
        motor = robot.motor(config.motor)
        constant = robot.model.left.back_emf_constant.value
        self.name = name
        self.config = config
        self.angle = 0.0
        """Rad, as counted."""
        self.rate = 0.0
        """Rad/s, as measured."""
        self.goal: ProfileState | None = None
        """What it is held at; None while it is released."""
        self.moved_by: str | None = None
        """The action that moves it now."""
        self._sign = (-1.0 if motor.inverted else 1.0) * motor.power_factor.value
        self._motor = motor
        self._offset = resting_counts(robot, config.motor)
        self._constant = constant
        friction = robot.model.friction
        model = WheelModel(
            robot.model.left.armature_resistance.value,
            constant,
            friction.coulomb.value,
            friction.viscous.value,
            config.inertia,
        )
        lag = robot.model.bemf.filter_time_constant.value
        late = dead_time(robot)
        cycle = 1.0 / robot.controller.rate_hz
        self._loop = Wheel(model, speed_loop_gains(model, lag, late), lag, cycle, late)
        self._battery = robot.model.battery.open_circuit_voltage.value
        self._ticks: float | None = None
        self._silent = 0.0  # s in which it was not read
        self._asked_when_read = 0.0  # rad/s
        self._duty = 0.0

    @property
    def stalled(self) -> bool:
        """Power and no motion."""
        return self._loop.watch.stalled

    def forget_stall(self) -> None:
        """What blocked it before is in the way no more, until it shows anew: a move may lead away from it."""
        self._loop.watch.rest()

    def release(self) -> None:
        """Let it go; what it was driven against is forgotten."""
        self.goal = None
        self._loop.rest()

    @property
    def settled(self) -> bool:
        """At rest where it is held."""
        near = self.goal is not None and abs(self.goal.position - self.angle) < self.config.tolerance
        return near and abs(self.rate) < PULL * self.config.tolerance

    def sense(self, inputs: Inputs, dt: float) -> None:
        """Take the readings of a cycle."""
        bemf, ticks = inputs.bemf[self.config.motor], inputs.position[self.config.motor]
        scale = self._scale(inputs.device)
        self._silent = self._silent + dt if bemf is None and ticks is None else 0.0
        if bemf is not None:
            self.rate = (bemf - self._offset) * scale
        if ticks is None:
            return
        moved = 0.0 if self._ticks is None else (ticks - self._ticks) * inputs.device.position_counts_seconds
        self._ticks = ticks
        if self._duty != 0.0 or abs(self.rate) > REST_COUNTS * abs(scale):
            self.angle += (moved - self._offset * dt) * scale

    def resume(self) -> None:
        """Go on after a pause in which nothing was controlled; what it takes to hold is remembered."""
        self._loop.resume()

    def duty(self, dt: float, battery_voltage: float | None, *, resting: bool = False) -> float:
        """The duty of this tick, in the sign of the board.

        resting: no tick may follow for long. A duty that nobody watches turns it away from where it is held,
        so it gets none then, and brakes.
        """
        if battery_voltage is not None and battery_voltage > LEAST_BATTERY_VOLTAGE:
            self._battery = battery_voltage
        wanted = self._wanted()
        if not self._unread:
            self._asked_when_read = abs(wanted[0])
        if wanted == (0.0, 0.0):
            self._loop.rest()
            self._duty = 0.0
        elif resting:
            self._loop.resume()
            self._duty = 0.0
        else:
            voltage = self._loop.voltage(*wanted, None if self._unread else self.rate, dt, self._battery)
            self._duty = max(-1.0, min(1.0, self._sign * voltage / self._battery))
        return self._duty

    @property
    def _unread(self) -> bool:
        """Whether it has said nothing for so long that nobody knows how fast it turns."""
        return self._silent > HOLD

    def _wanted(self) -> tuple[float, float]:
        """Speed and acceleration; nothing where it stands where it should."""
        goal = self.goal
        if goal is None:
            return 0.0, 0.0
        off = goal.position - self.angle
        if goal.velocity == goal.acceleration == 0.0 and abs(off) < 0.5 * self.config.tolerance:
            return 0.0, 0.0
        # Where it is not read it seems to stand, and would be asked to catch up.
        top = self._asked_when_read if self._unread else max(self.config.speed, abs(goal.velocity))
        speed = max(-top, min(top, goal.velocity + PULL * off))
        return float(speed), float(goal.acceleration)  # NumPy's stop here, as in Drive.velocity

    def _scale(self, device: Device) -> float:
        """Rad in one back-EMF count * second."""
        return math.copysign(radians_per_count(self._motor, self._constant, device), self._sign)


def move(name: str, to: float, speed: float | None = None, *, timeout: float | None = None) -> Action[float]:
    """Turn the mechanism `name` to the angle `to` (rad from its zero) and hold it there.

    speed: rad/s, its `speed` of robot.toml when None. timeout: s. The result is the angle it came to. Raises
    ValueError before it moves for more full turns than its `turns` of robot.toml; MotionTimeout, naming the
    motor port, where it is blocked or too slow; it is released then. RuntimeError where another action still
    moves it.
    """
    check_finite(to=to)
    check_rate(speed=speed)
    check_limits(speed=speed, timeout=timeout)

    label = f"move {name} to {math.degrees(to):g} deg"

    def steps(robot: Robot) -> Steps[float]:
        with held(robot.mechanism(name), label):
            return (yield from _move(robot, name, lambda here: to - here, speed, timeout))

    return Action(label, steps, lambda robot: _check_turns(robot, name, to=to))


def move_by(
    name: str, angle: float, speed: float | None = None, *, timeout: float | None = None
) -> Action[float]:
    """Turn the mechanism `name` by `angle` rad from where it is, and hold it there. See `move`."""
    check_finite(angle=angle)
    check_rate(speed=speed)
    check_limits("the sign belongs to the angle", speed=speed)
    check_limits(timeout=timeout)

    label = f"move {name} by {math.degrees(angle):g} deg"

    def steps(robot: Robot) -> Steps[float]:
        with held(robot.mechanism(name), label):
            return (yield from _move(robot, name, lambda _: angle, speed, timeout))

    return Action(label, steps, lambda robot: _check_turns(robot, name, angle=angle))


def spin(name: str, speed: float) -> Action[None]:
    """Turn the mechanism `name` at `speed` rad/s until ended from outside (`.until`, `.timeout`, `race`).

    Then it is released. `spin("arm", -2.0).until(blocked("arm"))` drives it against its end stop. Raises
    RuntimeError where another action still moves it.
    """
    check_rate(speed=speed)
    check_finite(speed=speed)  # None is no default here

    label = f"spin {name} at {speed:g} rad/s"

    def steps(robot: Robot) -> Steps[None]:
        turned = robot.mechanism(name)
        with held(turned, label):
            try:
                while True:
                    turned.goal = ProfileState(turned.angle, speed, 0.0)
                    yield
            finally:
                turned.release()

    return Action(label, steps, lambda robot: robot.mechanism(name))


def release(name: str) -> Action[None]:
    """Let the mechanism `name` go: its motor is switched off. RuntimeError where an action moves it."""
    label = f"release {name}"

    def let_go(robot: Robot) -> None:
        free = robot.mechanism(name)
        require_free(free, label)
        free.release()

    return Action(label, do(let_go).start, lambda robot: robot.mechanism(name))


def zero(name: str, angle: float = 0.0) -> Action[None]:
    """From now on, where the mechanism `name` is counts as `angle` rad; it is released.

    Raises RuntimeError where an action still moves it.
    """
    check_finite(angle=angle)
    label = f"zero {name}"

    def set_angle(robot: Robot) -> None:
        here = robot.mechanism(name)
        require_free(here, label)
        here.release()
        here.angle = float(angle)

    return Action(label, do(set_angle).start, lambda robot: _check_turns(robot, name, angle=angle))


def _check_turns(robot: Robot, name: str, **angles: float) -> None:
    """Raise ValueError for an angle that this mechanism is not said to turn by."""
    turns = robot.mechanism(name).config.turns
    check_angle(turns, f"mechanism.{name}.turns of robot.toml allows more", **angles)


def _move(
    robot: Robot, name: str, way: Callable[[float], float], speed: float | None, timeout: float | None
) -> Steps[float]:
    moved = robot.mechanism(name)
    start, config = moved.angle, moved.config
    walk = profile(way(start), config.speed if speed is None else speed, config.acceleration, 0.0)
    goal, sign = start + walk.distance, math.copysign(1.0, walk.distance)
    allowed = 2.0 * walk.duration + MARGIN_TIME if timeout is None else timeout
    begin = walked = robot.time
    arrived = False
    moved.forget_stall()
    try:
        while not arrived:
            elapsed = robot.time - begin
            behind = sign * (start + walk.at(robot.time - walked).position - moved.angle)
            if robot.paused and behind > config.tolerance:
                # Its motor was stopped meanwhile: it speeds up anew, and makes up for nothing.
                start, walked = moved.angle, robot.time
                walk = walk.over(goal - start)
            state = walk.at(robot.time - walked)
            moved.goal = ProfileState(start + state.position, state.velocity, state.acceleration)
            if moved.stalled or elapsed > allowed:
                raise MotionTimeout(_explain(moved, goal, elapsed))
            arrived = robot.time - walked >= walk.duration and moved.settled
            yield
    finally:
        if not arrived:
            moved.release()
    return moved.angle


def _explain(moved: Mechanism, goal: float, elapsed: float) -> str:
    cause = "power and no motion: blocked, unplugged or a fuse" if moved.stalled else "too slow"
    return (
        f"{moved.name} (motor port {moved.config.motor}) not done after {elapsed:.1f} s: at"
        f" {math.degrees(moved.angle):.0f} of {math.degrees(goal):.0f} deg; {cause}"
    )
