"""The angle of a motor that drives no wheel, as the controller counts it from its back-EMF."""

from __future__ import annotations

import math

from raccoon.core.config import MechanismConfig, RobotConfig
from raccoon.core.readings import Device, Fault, Inputs
from raccoon.estimate.drive.wheel_track import HOLD_S
from raccoon.estimate.drive.wheels import lag_seconds
from raccoon.model.bemf import radians_per_count
from raccoon.robot.parts.speed_limits import READ_SHARE, min_counted_rate

REST_COUNTS = 12.0
"""Back-EMF counts beyond the offset below which an unpowered motor counts as standing: motions are larger."""
MAX_STEADY_COUNTS, SETTLE_S = 15.0, 0.3
"""Largest scatter (counts) of the readings of a standing motor, and s of standing before its reading is taken
for the offset."""
SMOOTHING_S = 0.1
"""Time constant of the mean reading at rest, s."""
LARGEST_OFFSET = 120.0
"""Largest offset, counts; up to 77 were measured."""


class RestingOffset:
    """A motor's back-EMF reading at standstill, learnt while it is not powered: readings of a motor that is
    turned by hand change, an offset does not.

    known: counts, if robot.toml has them. Otherwise the very first reading is taken for the offset, and the
    first learnt value may be any; later ones may only drift. A value further off means that something turns
    the motor.
    """

    def __init__(self, known: float | None, nominal: float) -> None:
        self.counts = nominal if known is None else known
        self.is_known = known is not None
        self._is_first = True
        self._smooth_counts: float | None = None
        self._steady_seconds = 0.0
        self._counted_way = 0.0  # rad that were counted while it stood

    def restart(self) -> None:
        """Restart: the motor is driven, or gives no reading."""
        self._steady_seconds = self._counted_way = 0.0
        self._smooth_counts, self._is_first = None, False

    def take_resting_word(self, bemf: float, way: float, dt: float) -> float:
        """Take a reading of an unpowered motor and the rad counted with it; returns how many of these to take
        back."""
        if self._is_first and not self.is_known and abs(bemf) <= LARGEST_OFFSET:
            self.counts = bemf
        self._is_first = False
        smooth = bemf if self._smooth_counts is None else self._smooth_counts
        self._smooth_counts = smooth + min(dt / SMOOTHING_S, 1.0) * (bemf - smooth)
        if abs(bemf - smooth) > MAX_STEADY_COUNTS:
            self._steady_seconds = self._counted_way = 0.0
            return 0.0
        self._steady_seconds += min(dt, SMOOTHING_S)  # a pause shows one word
        self._counted_way += way
        if self._steady_seconds < SETTLE_S:
            return 0.0
        found, back = self._smooth_counts, 0.0
        if not self.is_known and abs(found) <= LARGEST_OFFSET:
            self.is_known, back = True, self._counted_way
        elif abs(found - self.counts) > REST_COUNTS:
            return 0.0
        self.counts = found
        return back


class CountedAngle:
    """Angle (rad) and rate (rad/s, as the board filtered it) of one mechanism's motor.

    The counter of a motor at rest is not believed, and its offset is learnt (`RestingOffset`), so it adds up
    to nothing. A controller that restarts loses what its filter held and counts nothing meanwhile; its motors
    coast then, and that way is guessed from the rate before.
    """

    def __init__(self, robot: RobotConfig, config: MechanismConfig, sign: float) -> None:
        self._robot = robot
        self._port = config.motor
        self._sign = sign
        known = robot.motor(config.motor).bemf_offset
        self._offset = RestingOffset(None if known is None else known.value, robot.model.bemf.offset.value)
        self._was_driven = False  # ever: before, it is taken to stand until its offset is known
        self._coast_deceleration = (
            robot.model.friction.coulomb.value / config.inertia
        )  # rad/s2 while it coasts
        self._device: Device | None = None
        self._scale = 0.0
        self._ticks: float | None = None
        self._seconds_since_counter = 0.0  # s since the counter was read
        self._silence = 0.0
        self.angle = 0.0
        self.rate = 0.0

    @property
    def max_readable_rate(self) -> float:
        """rad/s up to which its back-EMF is surely readable; the counter of a faster motor stands still."""
        reach = None if self._device is None else self._device.bemf_range
        return math.inf if reach is None else READ_SHARE * reach * abs(self._scale)

    @property
    def min_countable_rate(self) -> float:
        """rad/s from which it is surely counted; a slower motor turns further than its counter says."""
        return 0.0 if self._device is None else min_counted_rate(self._device, abs(self._scale))

    @property
    def is_unread(self) -> bool:
        """Whether it has not been read for so long that its speed is unknown."""
        return self._silence > HOLD_S

    def sense(self, inputs: Inputs, dt: float, powered: bool) -> None:
        """Take the readings of a cycle of `dt` s. powered: whether its motor was driven in it."""
        if inputs.device is not self._device:
            self._configure(inputs.device)
        bemf, ticks = inputs.bemf[self._port], inputs.position[self._port]
        self._silence = self._silence + dt if bemf is None and ticks is None else 0.0
        self._seconds_since_counter += dt
        way = self._guess_missed_way(inputs) if inputs.faults else 0.0
        # In its dead zone a controller counts nothing, not even the offset.
        blind = bemf == 0.0 and inputs.device.bemf_dead_zone > 0.0
        offset = 0.0 if blind else self._offset.counts
        if bemf is not None:
            self.rate = (bemf - offset) * self._scale
        if ticks is not None:
            if self._ticks is not None:
                counts = (ticks - self._ticks) * inputs.device.position_counts_seconds
                way += (counts - offset * self._seconds_since_counter) * self._scale
            self._ticks, self._seconds_since_counter = ticks, 0.0
        self._was_driven = self._was_driven or powered
        tells = self._was_driven or self._offset.is_known
        turns = powered or (tells and abs(self.rate) > REST_COUNTS * abs(self._scale))
        counted = way if turns else 0.0
        if powered or blind:
            self._offset.restart()
        elif bemf is not None:
            counted -= self._offset.take_resting_word(bemf, counted, dt)
        self.angle += counted

    def _configure(self, device: Device) -> None:
        constant = self._robot.model.left.back_emf_constant.value
        scale = radians_per_count(self._robot.motor(self._port), constant, device)
        self._device, self._scale = device, math.copysign(scale, self._sign)

    def _guess_missed_way(self, inputs: Inputs) -> float:
        """rad up to this cycle that the counter missed, estimated."""
        if Fault.RESET in inputs.faults:
            speed = abs(self.rate)
            lasted = (
                min(self._seconds_since_counter, speed / self._coast_deceleration)
                if self._coast_deceleration > 0.0
                else self._seconds_since_counter
            )
            way = (speed - 0.5 * self._coast_deceleration * lasted) * lasted
            return math.copysign(way + lag_seconds(self._robot, inputs.device) * speed, self.rate)
        return self.rate * self._seconds_since_counter if Fault.POSITION_JUMP in inputs.faults else 0.0
