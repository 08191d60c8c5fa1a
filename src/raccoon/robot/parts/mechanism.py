"""One arm or gripper on a motor of its own: its angle, the goal at which it is held, and the duty for
that."""

from __future__ import annotations

from typing import TYPE_CHECKING, NoReturn

from raccoon.control.feedforward import WheelModel
from raccoon.control.profile import ProfileState
from raccoon.control.tuning import speed_loop_gains
from raccoon.control.voltage import MIN_VOLTAGE
from raccoon.control.wheels import Wheel
from raccoon.core.config import MechanismConfig, RobotConfig
from raccoon.core.readings import Inputs
from raccoon.robot.name_hints import Part
from raccoon.robot.parts.counted_angle import CountedAngle
from raccoon.robot.parts.drive import dead_time

POSITION_GAIN = 8.0
"""1/s: rad/s commanded per rad of position error."""


class Mechanism(Part):
    """One named motor of robot.toml that is not a wheel."""

    called = "robot.run(move(name, rad))"
    offers = "angle and rate"

    def __init__(self, name: str, config: MechanismConfig, robot: RobotConfig) -> None:
        motor = robot.motor(config.motor)
        self.name = name
        self.config = config
        self.goal: ProfileState | None = None
        """The state at which it is held; None while it is released."""
        self.moved_by: str | None = None
        """The action that is moving it."""
        self._sign = (-1.0 if motor.inverted else 1.0) * motor.power_factor.value
        friction = robot.model.friction
        model = WheelModel(
            robot.model.left.armature_resistance.value,
            robot.model.left.back_emf_constant.value,
            friction.coulomb.value,
            friction.viscous.value,
            config.inertia,
        )
        lag = robot.model.bemf.filter_time_constant.value
        late = dead_time(robot)
        cycle = 1.0 / robot.controller.rate_hz
        self._loop = Wheel(model, speed_loop_gains(model, lag, late), lag, cycle, late)
        self._battery = robot.model.battery.open_circuit_voltage.value
        self._counted_angle = CountedAngle(robot, config, self._sign)
        self._asked_when_read = 0.0  # rad/s
        self._duty = 0.0

    def __repr__(self) -> str:
        held = "released" if self.goal is None else "held"
        return f"<mechanism {self.name}: {self.angle:.3f} rad, {self.rate:.2f} rad/s, {held}>"

    @property
    def angle(self) -> float:
        """rad, as counted."""
        return self._counted_angle.angle

    if not TYPE_CHECKING:  # a type checker knows that it is not set

        @angle.setter
        def angle(self, angle: object) -> NoReturn:
            raise AttributeError(
                f"an angle cannot be set directly: robot.run(move({self.name!r}, {angle!r})) turns the "
                f"mechanism there, robot.run(zero({self.name!r}, {angle!r})) declares that it is there"
            )

    def count_from(self, angle: float) -> None:
        """Set the present angle to `angle` rad."""
        self._counted_angle.angle = angle

    @property
    def rate(self) -> float:
        """rad/s, as measured."""
        return self._counted_angle.rate

    @property
    def place(self) -> float:
        """rad at which it is held, so that the next move corrects the error there; else the present angle."""
        return self.angle if self.goal is None else float(self.goal.position)

    def planned_speed(self, wanted: float) -> float:
        """The speed (rad/s) nearest to `wanted` at which its angle is readable; at 0 it stands."""
        return (
            min(max(wanted, self._counted_angle.min_countable_rate), self._counted_angle.max_readable_rate)
            if wanted
            else 0.0
        )

    @property
    def stalled(self) -> bool:
        """Whether it has power and does not move."""
        return self._loop.watch.stalled

    @property
    def stall_reason(self) -> str:
        """Why it counts as stalled, in words."""
        if self._counted_angle.is_unread:
            return (
                "its back-EMF is not read, so it is unknown whether it turns: check the link and the "
                "controller"
            )
        return "power but no motion: blocked, unplugged, or a tripped fuse"

    def forget_stall(self) -> None:
        """Forget what blocked it before, since a move may lead away from it."""
        self._loop.watch.stop_learning()

    def release(self) -> None:
        """Release it, and forget what it was driven against."""
        self.goal = None
        self._loop.rest()

    @property
    def settled(self) -> bool:
        """Whether it is at rest at its goal."""
        near = self.goal is not None and abs(self.goal.position - self.angle) < self.config.tolerance
        return near and abs(self.rate) < POSITION_GAIN * self.config.tolerance

    def sense(self, inputs: Inputs, dt: float) -> None:
        """Take the readings of a cycle."""
        self._counted_angle.sense(inputs, dt, powered=self._duty != 0.0)

    def resume(self) -> None:
        """Continue after a pause in which nothing was controlled; the duty needed to hold is remembered."""
        self._loop.resume()

    def duty(self, dt: float, battery_voltage: float | None, *, resting: bool) -> float:
        """The duty of this tick, in the board's sign.

        resting: no tick may follow for long. A duty without supervision would turn it away from its goal, so
        it brakes instead.
        """
        if battery_voltage is not None and battery_voltage > MIN_VOLTAGE:
            self._battery = battery_voltage
        wanted = self._target_rate()
        if not self._counted_angle.is_unread:
            self._asked_when_read = abs(wanted[0])
        if wanted == (0.0, 0.0):
            self._loop.rest()
            self._duty = 0.0
        elif resting:
            self._loop.resume()
            self._duty = 0.0
        else:
            rate = None if self._counted_angle.is_unread else self.rate
            voltage = self._loop.voltage(*wanted, rate, dt, self._battery)
            self._duty = max(-1.0, min(1.0, self._sign * voltage / self._battery))
        return self._duty

    def _target_rate(self) -> tuple[float, float]:
        """Target speed and acceleration; 0 if it stands at its goal."""
        goal = self.goal
        if goal is None:
            return 0.0, 0.0
        off = goal.position - self.angle
        if goal.velocity == goal.acceleration == 0.0 and abs(off) < 0.5 * self.config.tolerance:
            return 0.0, 0.0
        # Where it is not read it seems to stand, and would be asked to catch up.
        top = (
            self._asked_when_read
            if self._counted_angle.is_unread
            else max(self.config.speed, abs(goal.velocity))
        )
        top = min(top, self._counted_angle.max_readable_rate)
        speed = max(-top, min(top, goal.velocity + POSITION_GAIN * off))
        return float(speed), float(goal.acceleration)  # NumPy's stop here, as in Drive.velocity
