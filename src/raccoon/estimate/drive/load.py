"""Do both wheels carry far more than they roll with? Then the robot stands at something, or pushes it.

By the motor equation (control/feedforward.py) the current beyond what a speed-up takes carries the wheel:

    R I = s (U - K_E w),   load = R I - R J / K_E dw/dt

in volts, from the duty, the battery and the back-EMF, so that neither K_E nor the wheel's radius matters; s
is the share of the time in which the firmware powers a motor. What friction, a slope and a carpet take is
learnt while the robot rolls; tyres that spin at a wall take what they grip with, at once and on both sides:
0.76 V of the default robot, where a ramp of 10 degrees takes 0.15 and a friction that doubles 0.30.
"""

from __future__ import annotations

from dataclasses import dataclass

from raccoon.core.config import RobotConfig
from raccoon.core.readings import Device, Inputs, Outputs
from raccoon.core.schema import BATTERY_VOLTAGE
from raccoon.estimate.drive.wheel_track import GAP
from raccoon.model.bemf import counts_scale

LEAST_LOAD = 0.55
"""V beyond what it rolled with, on each wheel."""
JERKED = 0.5
"""Of what the wheels' change of speed takes, and of a change of the voltage: that much may be wrong about the
inertia, or of another time."""
STEADY = 0.2
"""V for a change of speed up to which most is learnt."""
SMOOTHING = 0.04
"""s of the loads that are compared."""
HELD_AFTER = 0.06
"""s of it before the robot is said to be held."""
LASTS, EVEN = 0.15, 0.4
"""s of more than LEAST_LOAD, and V for a change of speed and voltage up to which that says it, too: no
inertia that is half wrong makes as much of so little."""
HEAVY, HEAVY_LASTS = 0.38, 0.25
"""V, and s of it at an even speed, that say it as well: a light robot, or one with little grip, spins its
wheels with no more. Friction that doubles stays below."""
LEARN_TIME, LEARN_TIME_HELD = 1.0, 10.0
"""s in which what it rolls with is learnt; far slower while it seems to be held, so that a floor that is only
heavy is forgiven."""
KNOWN_AFTER = 0.3
"""s of rolling before anything is said."""
LEAST_SPEED, LEAST_VOLTS = 0.5, 0.3
"""rad/s and V, both ahead: slower wheels stick, and brakes are no drive."""
LEAST_BATTERY, MOST_BATTERY = BATTERY_VOLTAGE.low, BATTERY_VOLTAGE.high
"""V between which a reading is a battery's, as the filter of its voltage has it."""
BATTERY_SHARE = 0.1
"""Of a new battery reading that counts."""


@dataclass(frozen=True, slots=True)
class _Side:
    """A wheel in volts: port and sign of its motor, share of the time in which that is powered, V of a rad/s
    as back-EMF and by friction, V of a rad/s2."""

    port: int
    sign: float
    driven: float
    back_emf: float
    viscous: float
    acceleration: float

    def load(self, given: float, speed: float, change: float) -> float:
        """V that carry the wheel at `given` V and rad/s, of which `change` V speed it up."""
        return self.driven * (given - self.back_emf * speed) - self.viscous * speed - change


class LoadWatch:
    """Watches both wheels. `drive` takes the command of every cycle, `update` what they did in each step.

    held: whether they carry too much. doubt: m^2 by which the way of the last step adds to the variance of
    the place: all that the wheels turned since they carry too much may be no way at all.
    """

    __slots__ = (
        "_battery",
        "_change",
        "_counted",
        "_direction",
        "_excess",
        "_free",
        "_given",
        "_heavy",
        "_known",
        "_last",
        "_lasted",
        "_left",
        "_radius",
        "_right",
        "_robot",
        "_rolls",
        "_seconds",
        "_suspicious",
        "_time",
        "_volts",
        "_way",
        "doubt",
        "held",
    )

    def __init__(self, robot: RobotConfig, device: Device) -> None:
        self._robot = robot
        self._radius = robot.model.drive.wheel_radius.value
        self._rolls = self._free = (0.0, 0.0)  # V; all of the first step is learnt
        self.held = False
        self._known = self._battery = self._time = 0.0
        self.configure(device)
        self.interrupt()

    def configure(self, device: Device) -> None:
        """Go on with the words of this device."""
        self._left, self._right = _side(self._robot, "left", device), _side(self._robot, "right", device)

    def interrupt(self) -> None:
        """Nobody looked for a while. What it rolls with stays learnt."""
        self._volts = (0.0, 0.0)
        self._seconds = self._direction = 0.0
        self._last = self._given = (0.0, 0.0)
        self._release()

    def _release(self) -> None:
        """It is not driven on.

        Where it was held to the end that was no heavy floor, and nothing is kept of it: the third push
        against a wall would pass for rolling.
        """
        if self.held:
            self._rolls = self._free
        self._excess = self._change = self._suspicious = self._lasted = self._heavy = 0.0
        self._way = self._counted = self.doubt = 0.0
        self.held = False

    def drive(self, inputs: Inputs, command: Outputs | None) -> None:
        """Take the command that was in force until these readings; None where it is not known."""
        dt, self._time = inputs.time - self._time, inputs.time
        if not 0.0 < dt < GAP:
            return
        reading = inputs.battery_voltage
        if reading is not None and LEAST_BATTERY < reading < MOST_BATTERY:
            share = BATTERY_SHARE if self._battery else 1.0
            self._battery += share * (reading - self._battery)
        if command is None:
            return
        left, right, volts = self._left, self._right, self._battery * dt
        given = self._volts
        self._volts = (
            given[0] + left.sign * command.duty[left.port] * volts,
            given[1] + right.sign * command.duty[right.port] * volts,
        )
        self._seconds += dt

    def update(self, span: float, left: float, right: float) -> None:
        """Take a step of `span` s with the wheels' mean speeds, rad/s at nominal scale without offsets."""
        seconds, (last_left, last_right) = self._seconds, self._last
        given_left, given_right = self._volts
        self._volts, self._seconds, self._last = (0.0, 0.0), 0.0, (left, right)
        direction = 0.0
        if min(left, right) > LEAST_SPEED and min(given_left, given_right) > LEAST_VOLTS * seconds:
            direction = 1.0
        elif max(left, right) < -LEAST_SPEED and max(given_left, given_right) < -LEAST_VOLTS * seconds:
            direction = -1.0
        if direction == 0.0 or direction != self._direction or seconds <= 0.0:
            self._direction = direction
            self._release()
            return
        given_left, given_right = given_left / seconds, given_right / seconds
        jump = max(abs(given_left - self._given[0]), abs(given_right - self._given[1]))
        self._given = given_left, given_right
        change_left = self._left.acceleration * (left - last_left) / span
        change_right = self._right.acceleration * (right - last_right) / span
        self._judge(
            span,
            direction * self._left.load(given_left, left, change_left),
            direction * self._right.load(given_right, right, change_right),
            # Of each wheel: in a turn the two may change against each other.
            max(abs(change_left), abs(change_right), jump),
            0.5 * (left + right) * self._radius * span,
        )

    def _judge(self, span: float, left: float, right: float, change: float, way: float) -> None:
        """Compare loads, V, with those it rolled with."""
        smooth = span / (SMOOTHING + span)
        rolls_left, rolls_right = self._rolls
        self._change += smooth * (change - self._change)
        excess = min(left - rolls_left, right - rolls_right)
        self._excess += smooth * (excess - self._excess)
        limit = LEAST_LOAD + JERKED * self._change
        lasts = self._excess > LEAST_LOAD and self._change < EVEN
        self._lasted = self._lasted + span if lasts else 0.0
        if self._excess > HEAVY and self._change < STEADY:
            self._heavy += span
        elif self._excess < 0.5 * LEAST_LOAD:
            self._heavy = 0.0
        lasted = self._lasted > LASTS or self._heavy > HEAVY_LASTS
        if self._excess > limit or lasted:
            self._suspicious += span
            long = self._suspicious > HELD_AFTER or lasted
            if not self.held and long and self._known > KNOWN_AFTER:
                self.held, self._free = True, self._rolls
        elif self._excess < 0.5 * LEAST_LOAD or not self.held:
            self._suspicious = 0.0
            self.held = False
        self._count(way, self.held or max(excess, self._excess) > 0.5 * LEAST_LOAD)
        steady = span / (1.0 + (self._change / STEADY) ** 2)
        self._known += steady
        self._rolls = self._learnt(rolls_left, left, steady), self._learnt(rolls_right, right, steady)

    def _learnt(self, rolls: float, load: float, steady: float) -> float:
        """What a wheel rolls with after `steady` s of a load, V. One wheel alone may be at a wall, too."""
        held = self._suspicious > 0.0 or load - rolls > HEAVY
        usual = min(self._known, LEARN_TIME)
        if held and self._known > KNOWN_AFTER:
            usual = LEARN_TIME_HELD
        return rolls + min(1.0, steady / usual) * (load - rolls)

    def _count(self, way: float, heavy: bool) -> None:
        """Add to the doubted way, from the first step that was heavy, long before it is said."""
        self._way = self._way + way if heavy else 0.0
        counted = self._counted
        self._counted = self._way if self.held else 0.0
        self.doubt = max(0.0, self._counted**2 - counted**2)

    @property
    def held_way(self) -> float:
        """m that both wheels turned, from the first heavy step on, while it is held; 0 while it is not."""
        return abs(self._counted)


def _side(robot: RobotConfig, side: str, device: Device) -> _Side:
    port = getattr(robot.drive, side)
    motor, model = robot.motor(port), getattr(robot.model, side)
    constant = model.back_emf_constant.value
    per_speed = device.bemf_volts / counts_scale(robot, side, device)
    viscous = model.armature_resistance.value * robot.model.friction.viscous.value / constant
    if motor.speed_voltage is not None:
        viscous = max(0.0, motor.speed_voltage.value - per_speed)
    inertia = model.armature_resistance.value * robot.model.drive.inertia_straight.value / constant
    if motor.acceleration_voltage is not None:
        inertia = motor.acceleration_voltage.value
    sign = -1.0 if motor.inverted else 1.0
    return _Side(port, sign, device.driven_share, per_speed, viscous, inertia)
