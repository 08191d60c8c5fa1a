"""Detection of a robot that stands at something, or pushes it, by the load on both wheels.

By the motor equation (control/feedforward.py) the current beyond that of the acceleration carries the load:

    R I = s (U - K_E w),   load = R I - R J / K_E dw/dt

in volts, from duty, battery voltage and back-EMF, so that neither K_E nor the wheel radius matters; s is the
share of the time in which the firmware powers a motor. The load of friction, a slope and a carpet is learnt
while the robot rolls. Tyres that spin at a wall add the load of their grip, at once and on both sides: 0.76 V
for the default robot, while a ramp of 10 degrees adds 0.15 V and a doubled friction 0.30 V.
"""

from __future__ import annotations

from dataclasses import dataclass

from raccoon.core.config import RobotConfig
from raccoon.core.readings import Device, Inputs, Outputs
from raccoon.core.schema import BATTERY_VOLTAGE
from raccoon.estimate.drive.wheel_track import CYCLE_GAP_S
from raccoon.model.bemf import counts_scale

MIN_LOAD_V = 0.55
"""V, threshold on the load of each wheel beyond its rolling load."""
CHANGE_SHARE = 0.5
"""Share of the voltage of an acceleration, and of a change of the voltage, that is added to the threshold:
the inertia may be wrong by so much, or the change may be of another time."""
STEADY_CHANGE_V = 0.2
"""V of acceleration up to which most of the rolling load is learnt."""
SMOOTHING_S = 0.04
"""s, time constant of the loads that are compared."""
HELD_AFTER_S = 0.06
"""s above the threshold after which the robot counts as held."""
LASTING_LOAD_S, EVEN_CHANGE_V = 0.15, 0.4
"""s above MIN_LOAD_V, and V of acceleration and voltage change up to which they count, after which the robot
counts as held, too: no inertia that is half wrong makes so much load of so small a change."""
HEAVY_LOAD_V, HEAVY_LOAD_S = 0.38, 0.25
"""V, and s above it at a steady speed, after which the robot counts as held, too: a light robot, or one with
little grip, spins its wheels with no more load. Friction that doubles stays below."""
LEARN_TIME_S, LEARN_TIME_HELD_S = 1.0, 10.0
"""s, time constant of learning the rolling load; far slower while the robot seems to be held, so that a floor
that is only heavy is learnt after all."""
LEARNT_AFTER_S = 0.3
"""s of rolling before the robot can count as held."""
MIN_SPEED, MIN_VOLTS = 0.5, 0.3
"""rad/s and V in the direction of motion below which nothing is judged: slower wheels stick, and braking is
no drive."""
MIN_BATTERY, MAX_BATTERY = BATTERY_VOLTAGE.low, BATTERY_VOLTAGE.high
"""V, bounds on a plausible battery reading, the same as in the filter of the battery voltage."""
BATTERY_SHARE = 0.1
"""Weight of a new battery reading."""


@dataclass(frozen=True, slots=True)
class _WheelVolts:
    """Voltages of a wheel: port and sign of its motor, share of the time in which that is powered, back-EMF
    and friction in V per rad/s, and acceleration in V per rad/s2."""

    port: int
    sign: float
    driven: float
    back_emf: float
    viscous: float
    acceleration: float

    def load(self, volts: float, speed: float, change: float) -> float:
        """V that carry the wheel's load at this voltage and speed (rad/s); `change` V of it accelerate the
        wheel."""
        return self.driven * (volts - self.back_emf * speed) - self.viscous * speed - change


class LoadWatch:
    """Watches both wheels. `take_command` takes the command of every cycle, `update` the speeds of each step.

    held: whether the load is too high. place_variance: m^2 that the last step adds to the variance of the
    position: the robot may not have moved at all since the load became too high.
    """

    __slots__ = (
        "_battery",
        "_direction",
        "_excess_load",
        "_heavy_seconds",
        "_heavy_way",
        "_held_way",
        "_last_speeds",
        "_last_volts",
        "_lasting_seconds",
        "_learnt_seconds",
        "_left",
        "_radius",
        "_right",
        "_robot",
        "_rolling_loads",
        "_rolling_loads_before",
        "_suspicious_seconds",
        "_time",
        "_volt_seconds",
        "_volt_time",
        "_voltage_change",
        "held",
        "place_variance",
    )

    def __init__(self, robot: RobotConfig, device: Device) -> None:
        self._robot = robot
        self._radius = robot.model.drive.wheel_radius.value
        self._rolling_loads = self._rolling_loads_before = (0.0, 0.0)  # V; the first step sets them
        self.held = False
        self._learnt_seconds = self._battery = self._time = 0.0
        self.configure(device)
        self.restart()

    def configure(self, device: Device) -> None:
        """Continue with the words of this device."""
        self._left = _wheel_volts(self._robot, "left", device)
        self._right = _wheel_volts(self._robot, "right", device)

    def restart(self) -> None:
        """Start again after a gap in the readings; the learnt rolling load stays."""
        self._volt_seconds = (0.0, 0.0)
        self._volt_time = self._direction = 0.0
        self._last_speeds = self._last_volts = (0.0, 0.0)
        self._reset_load()

    def _reset_load(self) -> None:
        """Forget the present load: the robot is no longer driven in the same direction.

        If the robot was held to the end, that was no heavy floor, and what was learnt meanwhile is dropped;
        otherwise the third push against a wall would count as rolling.
        """
        if self.held:
            self._rolling_loads = self._rolling_loads_before
        self._excess_load = self._voltage_change = self._suspicious_seconds = self._lasting_seconds = (
            self._heavy_seconds
        ) = 0.0
        self._heavy_way = self._held_way = self.place_variance = 0.0
        self.held = False

    def take_command(self, inputs: Inputs, command: Outputs | None) -> None:
        """Take the command that was in force until these readings; None if it is unknown."""
        dt, self._time = inputs.time - self._time, inputs.time
        if not 0.0 < dt < CYCLE_GAP_S:
            return
        reading = inputs.battery_voltage
        if reading is not None and MIN_BATTERY < reading < MAX_BATTERY:
            share = BATTERY_SHARE if self._battery else 1.0
            self._battery += share * (reading - self._battery)
        if command is None:
            return
        left, right, volts = self._left, self._right, self._battery * dt
        volt_seconds = self._volt_seconds
        self._volt_seconds = (
            volt_seconds[0] + left.sign * command.duty[left.port] * volts,
            volt_seconds[1] + right.sign * command.duty[right.port] * volts,
        )
        self._volt_time += dt

    def update(self, span: float, left: float, right: float) -> None:
        """Take a step of `span` s with the wheels' mean speeds, rad/s at nominal scale without offsets."""
        seconds, (last_left, last_right) = self._volt_time, self._last_speeds
        volts_left, volts_right = self._volt_seconds
        self._volt_seconds, self._volt_time, self._last_speeds = (0.0, 0.0), 0.0, (left, right)
        direction = 0.0
        if min(left, right) > MIN_SPEED and min(volts_left, volts_right) > MIN_VOLTS * seconds:
            direction = 1.0
        elif max(left, right) < -MIN_SPEED and max(volts_left, volts_right) < -MIN_VOLTS * seconds:
            direction = -1.0
        if direction == 0.0 or direction != self._direction or seconds <= 0.0:
            self._direction = direction
            self._reset_load()
            return
        volts_left, volts_right = volts_left / seconds, volts_right / seconds
        jump = max(abs(volts_left - self._last_volts[0]), abs(volts_right - self._last_volts[1]))
        self._last_volts = volts_left, volts_right
        change_left = self._left.acceleration * (left - last_left) / span
        change_right = self._right.acceleration * (right - last_right) / span
        self._judge(
            span,
            direction * self._left.load(volts_left, left, change_left),
            direction * self._right.load(volts_right, right, change_right),
            # For each wheel alone: in a turn the two changes may be opposite.
            max(abs(change_left), abs(change_right), jump),
            0.5 * (left + right) * self._radius * span,
        )

    def _judge(self, span: float, left: float, right: float, voltage_change: float, way: float) -> None:
        """Compare the wheels' loads, V, with their rolling loads."""
        smooth = span / (SMOOTHING_S + span)
        rolls_left, rolls_right = self._rolling_loads
        self._voltage_change += smooth * (voltage_change - self._voltage_change)
        excess = min(left - rolls_left, right - rolls_right)
        self._excess_load += smooth * (excess - self._excess_load)
        limit = MIN_LOAD_V + CHANGE_SHARE * self._voltage_change
        is_lasting = self._excess_load > MIN_LOAD_V and self._voltage_change < EVEN_CHANGE_V
        self._lasting_seconds = self._lasting_seconds + span if is_lasting else 0.0
        if self._excess_load > HEAVY_LOAD_V and self._voltage_change < STEADY_CHANGE_V:
            self._heavy_seconds += span
        elif self._excess_load < 0.5 * MIN_LOAD_V:
            self._heavy_seconds = 0.0
        has_lasted = self._lasting_seconds > LASTING_LOAD_S or self._heavy_seconds > HEAVY_LOAD_S
        if self._excess_load > limit or has_lasted:
            self._suspicious_seconds += span
            is_long = self._suspicious_seconds > HELD_AFTER_S or has_lasted
            if not self.held and is_long and self._learnt_seconds > LEARNT_AFTER_S:
                self.held, self._rolling_loads_before = True, self._rolling_loads
        elif self._excess_load < 0.5 * MIN_LOAD_V or not self.held:
            self._suspicious_seconds = 0.0
            self.held = False
        self._count_way(way, self.held or max(excess, self._excess_load) > 0.5 * MIN_LOAD_V)
        learn_seconds = span / (1.0 + (self._voltage_change / STEADY_CHANGE_V) ** 2)
        self._learnt_seconds += learn_seconds
        self._rolling_loads = (
            self._learnt_rolling_load(rolls_left, left, learn_seconds),
            self._learnt_rolling_load(rolls_right, right, learn_seconds),
        )

    def _learnt_rolling_load(self, rolling_load: float, load: float, learn_seconds: float) -> float:
        """A wheel's rolling load, V, after `learn_seconds` s of a load. A single wheel may be at a wall,
        too."""
        held = self._suspicious_seconds > 0.0 or load - rolling_load > HEAVY_LOAD_V
        time_constant = min(self._learnt_seconds, LEARN_TIME_S)
        if held and self._learnt_seconds > LEARNT_AFTER_S:
            time_constant = LEARN_TIME_HELD_S
        return rolling_load + min(1.0, learn_seconds / time_constant) * (load - rolling_load)

    def _count_way(self, way: float, heavy: bool) -> None:
        """Add to the uncertain distance, from the first step with a high load, long before `held` is set."""
        self._heavy_way = self._heavy_way + way if heavy else 0.0
        counted = self._held_way
        self._held_way = self._heavy_way if self.held else 0.0
        self.place_variance = max(0.0, self._held_way**2 - counted**2)

    @property
    def held_way(self) -> float:
        """m that both wheels turned since the first step with a high load, while the robot is held; otherwise
        0."""
        return abs(self._held_way)


def _wheel_volts(robot: RobotConfig, side: str, device: Device) -> _WheelVolts:
    port = getattr(robot.drive, side)
    motor, model = robot.motor(port), getattr(robot.model, side)
    back_emf_constant = model.back_emf_constant.value
    per_speed = device.bemf_volts / counts_scale(robot, side, device)
    viscous = model.armature_resistance.value * robot.model.friction.viscous.value / back_emf_constant
    if motor.speed_voltage is not None:
        viscous = max(0.0, motor.speed_voltage.value - per_speed)
    inertia = model.armature_resistance.value * robot.model.drive.inertia_straight.value / back_emf_constant
    if motor.acceleration_voltage is not None:
        inertia = motor.acceleration_voltage.value
    sign = -1.0 if motor.inverted else 1.0
    return _WheelVolts(port, sign, device.driven_share, per_speed, viscous, inertia)
