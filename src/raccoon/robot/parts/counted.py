"""The angle of a motor that drives no wheel, as the controller counts it from its back-EMF."""

from __future__ import annotations

import math

from raccoon.core.config import MechanismConfig, RobotConfig
from raccoon.core.readings import Device, Fault, Inputs
from raccoon.estimate.drive.wheel_track import HOLD
from raccoon.estimate.drive.wheels import lag_seconds, resting_counts
from raccoon.model.bemf import radians_per_count

REST_COUNTS = 12.0
"""Back-EMF counts below which an unpowered motor stands still: offsets are smaller, motions larger."""


class CountedAngle:
    """Angle and rate of one mechanism's motor.

    angle: rad. rate: rad/s, as the board filtered it. Over a motor at rest the counter is not believed, so
    its offset adds up to nothing. A controller that restarts forgets what its filter still held and counts
    nothing meanwhile; its motors coast then, and that way is guessed from the rate before.
    """

    def __init__(self, robot: RobotConfig, config: MechanismConfig, sign: float) -> None:
        self._robot = robot
        self._port = config.motor
        self._sign = sign
        self._offset = resting_counts(robot, config.motor)
        self._slowing = robot.model.friction.coulomb.value / config.inertia  # rad/s2 while it coasts
        self._device: Device | None = None
        self._scale = 0.0
        self._ticks: float | None = None
        self._since = 0.0  # s since the counter was read
        self._silent = 0.0
        self.angle = 0.0
        self.rate = 0.0

    @property
    def unread(self) -> bool:
        """Whether it has said nothing for so long that nobody knows how fast it turns."""
        return self._silent > HOLD

    def sense(self, inputs: Inputs, dt: float, powered: bool) -> None:
        """Take the readings of a cycle of `dt` s. powered: whether its motor was driven in it."""
        if inputs.device is not self._device:
            self._know(inputs.device)
        bemf, ticks = inputs.bemf[self._port], inputs.position[self._port]
        self._silent = self._silent + dt if bemf is None and ticks is None else 0.0
        self._since += dt
        way = self._guessed(inputs) if inputs.faults else 0.0
        if bemf is not None:
            self.rate = (bemf - self._offset) * self._scale
        if ticks is None:
            return
        if self._ticks is not None:
            counts = (ticks - self._ticks) * inputs.device.position_counts_seconds
            way += (counts - self._offset * self._since) * self._scale
        self._ticks, self._since = ticks, 0.0
        if powered or abs(self.rate) > REST_COUNTS * abs(self._scale):
            self.angle += way

    def _know(self, device: Device) -> None:
        constant = self._robot.model.left.back_emf_constant.value
        scale = radians_per_count(self._robot.motor(self._port), constant, device)
        self._device, self._scale = device, math.copysign(scale, self._sign)

    def _guessed(self, inputs: Inputs) -> float:
        """Rad that no counter tells of, up to this cycle."""
        if Fault.RESET in inputs.faults:
            speed = abs(self.rate)
            lasted = min(self._since, speed / self._slowing) if self._slowing > 0.0 else self._since
            way = (speed - 0.5 * self._slowing * lasted) * lasted
            return math.copysign(way + lag_seconds(self._robot, inputs.device) * speed, self.rate)
        return self.rate * self._since if Fault.POSITION_JUMP in inputs.faults else 0.0
