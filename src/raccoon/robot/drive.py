"""The drive base: what the motions ask of it, and the duties that come out each tick."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING

from raccoon.control.feedforward import wheel_models
from raccoon.control.tuning import speed_loop_gains
from raccoon.control.voltage import SpeedBudget
from raccoon.control.watch import ODD_SHARE, oddities
from raccoon.control.wheels import REST, WheelLoop, WheelTarget
from raccoon.core.config import RobotConfig
from raccoon.core.readings import MOTOR_PORTS, Device, Outputs
from raccoon.core.sections import MotionConfig
from raccoon.estimate.drive.estimate import HELD
from raccoon.estimate.drive.wheel_track import SPEED_SMOOTHING

if TYPE_CHECKING:
    from raccoon.estimate.drive.estimate import DriveEstimate

FIRMWARE_SAMPLE = 0.005
"""S between two samples of the back-EMF."""
# A wheel is never planned slower than this share of its speed without load, however little is said to be left
# for it by the battery and the wished acceleration.
LEAST_SHARE = 0.3
SHORT_DRIVE, SHORT_DRIVES = 0.1, 10
"""S in which a drive does not come to its speed, and how many of them in a row are a loop."""
USUAL = MotionConfig()
"""Accelerations that a robot.toml without any has."""


def _eased(speed_at: Callable[[float], float], wished: float, usual: float) -> tuple[float, float]:
    """Speed and the most acceleration, up to `wished`, that leaves what the usual one does."""
    if wished <= usual or speed_at(wished) >= speed_at(usual):
        return speed_at(wished), wished
    low, high, speed = usual, wished, speed_at(usual)
    for _ in range(20):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if speed_at(middle) >= speed else (low, middle)
    return speed, low


def dead_time(config: RobotConfig) -> float:
    """S from a reading to its effect: half a control period of hold plus one sample of the firmware."""
    return 0.5 / config.controller.rate_hz + FIRMWARE_SAMPLE


class Drive:
    """Two driven wheels. Motions call `velocity`, `duties` or `push` once in each tick they want something.

    Without a command in a tick the wheels stop: nothing runs on by being forgotten.
    """

    def __init__(self, config: RobotConfig) -> None:
        model = config.model.drive
        self._config = config
        self._device: Device | None = None
        self.wheels = self._loop(None)
        battery = config.model.battery
        self.budget = SpeedBudget(config.battery.weakest, battery.internal_resistance.value)
        """What motions are planned with: the weakest battery of the match."""
        self._radius = model.wheel_radius.value
        self._half_track = 0.5 * model.track_width.value
        self._turn_inertia_share = model.inertia_turn.value / model.inertia_straight.value
        self._ports = (config.drive.left, config.drive.right)
        self._brake = tuple(port in self._ports for port in range(MOTOR_PORTS))
        self._signs = tuple(
            (-1.0 if config.motor(port).inverted else 1.0) * config.motor(port).power_factor.value
            for port in self._ports
        )
        self.remarks: dict[str, str] = {}
        """What was said to be strange so far, the first of each kind."""
        self.followed = True
        """Whether the readings follow the commands. Those of a recording do not follow others, and tell
        nothing of the motors."""
        self._target = REST
        self._open_loop: tuple[float, float] | None = None
        self._given = (0.0, 0.0)
        self._claimed = False
        self._begun, self._begins = -math.inf, 0

    def _loop(self, device: Device | None) -> WheelLoop:
        left, right = wheel_models(self._config, device)
        late = dead_time(self._config)
        gains = tuple(speed_loop_gains(wheel, SPEED_SMOOTHING, late) for wheel in (left, right))
        voltage = self._config.model.battery.open_circuit_voltage.value
        cycle = 1.0 / self._config.controller.rate_hz
        return WheelLoop(left, right, (gains[0], gains[1]), SPEED_SMOOTHING, voltage, cycle, late)

    def know(self, device: Device) -> None:
        """Take the K_E of calibrated motors from what this device's counters mean; once a device."""
        if device is not self._device:
            self._device = device
            self.wheels = self._loop(device)

    def resume(self) -> None:
        """Go on after a pause in which nothing was controlled."""
        self.wheels.resume()

    def velocity(
        self,
        forward: float,
        turn_rate: float = 0.0,
        acceleration: float = 0.0,
        turn_acceleration: float = 0.0,
    ) -> None:
        """Drive at `forward` m/s turning at `turn_rate` rad/s in this tick.

        acceleration m/s2 and turn_acceleration rad/s2 help the wheels to follow a changing speed.
        """
        self._claim()
        turn = turn_rate * self._half_track
        gain = acceleration / self._radius
        spin = turn_acceleration * self._half_track / self._radius * self._turn_inertia_share
        self._open_loop = None
        self._target = WheelTarget(
            (forward - turn) / self._radius, (forward + turn) / self._radius, gain - spin, gain + spin
        )

    def duties(self, left: float, right: float) -> None:
        """Put these duties (-1..1) on the wheels in this tick, without any control: time-based driving."""
        for name, duty in (("left", left), ("right", right)):
            if not -1.0 <= duty <= 1.0:
                raise ValueError(f"{name} duty is {duty}: allowed are numbers from -1 to 1")
        self._claim()
        self._open_loop = (left, right)

    def push(
        self, forward: float, battery_voltage: float | None, speeds: tuple[float, float], force: float
    ) -> None:
        """In this tick, give both motors the voltage for `forward` m/s and no more, whatever they do; and of
        that no more than presses with `force` N a wheel at the rad/s that the left and the right one turn
        with (inf: all of it).
        """
        self._claim()
        voltage = self.wheels.battery if battery_voltage is None else battery_voltage
        wanted, torque = self.wheel_speed(forward), force * self._radius
        left, right = (
            max(-1.0, min(1.0, wheel.pressing(wanted, speed, torque) / voltage))
            for wheel, speed in zip(self.wheels.models, speeds, strict=True)
        )
        self._open_loop = (left, right)

    @property
    def asked(self) -> bool:
        """Whether something was asked for in this tick already."""
        return self._claimed

    def begins_anew(self, time: float) -> bool:
        """Whether drives without a goal have begun so often by `time` s, one after the other, that none of
        them comes to its speed. True once.
        """
        self._begins = self._begins + 1 if time - self._begun < SHORT_DRIVE else 0
        self._begun = time
        return self._begins == SHORT_DRIVES

    def wheel_speed(self, forward: float) -> float:
        """Rad/s of the wheels at `forward` m/s straight ahead."""
        return forward / self._radius

    def stop(self) -> None:
        """No motion from this tick on."""
        self._target = REST
        self._open_loop = None
        self._claimed = False

    def _claim(self) -> None:
        """One command a tick: of two actions that drive at once one would be lost, and neither arrive."""
        if self._claimed:
            raise RuntimeError(
                "two actions drive the wheels at the same time, in parallel or in the background: "
                "put them into a seq, or end one before the other begins"
            )
        self._claimed = True

    def outputs(self, estimate: DriveEstimate, dt: float, battery_voltage: float | None) -> Outputs:
        """The command of this tick; forgets what was asked, so it must be asked again in the next."""
        if self._open_loop is not None:
            left, right = self._open_loop
            self.wheels.reset()
        else:
            self.wheels.hold(HELD in estimate.reasons)
            left, right = self.wheels.step(
                self._target, estimate.left_speed, estimate.right_speed, dt, battery_voltage
            )
        self._given = (left, right)
        self.stop()
        duty = [0.0] * MOTOR_PORTS
        duty[self._ports[0]] = max(-1.0, min(1.0, self._signs[0] * left))
        duty[self._ports[1]] = max(-1.0, min(1.0, self._signs[1] * right))
        return Outputs(duty=tuple(duty), brake=self._brake)

    def top_speed(self, battery_voltage: float) -> float:
        """M/s straight ahead that the weaker wheel can give at `battery_voltage` V."""
        return self.wheels.top_speed(battery_voltage) * self._radius

    def top_turn_rate(self, battery_voltage: float) -> float:
        """Rad/s on the spot that the weaker wheel can give at `battery_voltage` V."""
        return self.top_speed(battery_voltage) / self._half_track

    def planned_speed(self, wanted: float, acceleration: float, outer: float = 1.0) -> float:
        """M/s, at most `wanted`, that the weakest battery of the match can still give.

        acceleration: m/s2 while it speeds up. outer: speed of the faster wheel over the robot's. Kept for the
        whole match, so that a run is the same on a fresh battery.
        """
        gain = acceleration * outer / self._radius
        top = min(
            max(
                LEAST_SHARE * self.budget.weakest / wheel.back_emf_constant,
                self.budget.top_wheel_speed(wheel, gain),
            )
            for wheel in self.wheels.models
        )
        return min(wanted, top * self._radius / outer)

    def planned(self, wanted: float, acceleration: float, outer: float = 1.0) -> tuple[float, float]:
        """Speed (m/s, see `planned_speed`) and acceleration (m/s2) to plan with, at most these.

        Speeding up hard takes voltage that the speed is then short of. So of an acceleration above the
        default only as much is planned as leaves the speed of the default: more never makes a robot slower.
        """
        return _eased(lambda gain: self.planned_speed(wanted, gain, outer), acceleration, USUAL.acceleration)

    def planned_turn(self, wanted: float, acceleration: float) -> tuple[float, float]:
        """The same of a turn on the spot: rad/s and rad/s2."""
        return _eased(
            lambda gain: self.planned_turn_rate(wanted, gain), acceleration, USUAL.turn_acceleration
        )

    def planned_turn_rate(self, wanted: float, acceleration: float) -> float:
        """Rad/s on the spot, at most `wanted`, that the weakest battery of the match can still give."""
        share = self._half_track * self._turn_inertia_share
        speed = self.planned_speed(wanted * self._half_track, acceleration * share)
        return speed / self._half_track

    def current(self, left_speed: float, right_speed: float, battery_voltage: float) -> float:
        """A that the motors draw from the battery under the last command, by their models."""
        total = 0.0
        for duty, speed, wheel in zip(
            self._given, (left_speed, right_speed), self.wheels.models, strict=True
        ):
            total += duty * (duty * battery_voltage - wheel.back_emf_constant * speed) / wheel.resistance
        return total

    def oddities(self) -> tuple[str, ...]:
        """What is strange about the motors, each with its port: a weak magnet, a high resistance."""
        if not self.followed:
            return ()
        found = []
        odd = oddities(*self.wheels.states)
        wheels = zip(("left", "right"), self._ports, self.wheels.models, odd, strict=True)
        for side, port, model, said in wheels:
            nominal = getattr(self._config.model, side).back_emf_constant.value
            share = model.back_emf_constant / nominal
            if abs(share - 1.0) > ODD_SHARE:
                said = f"has {share:.2f} times the nominal K_E by its calibration"
            if said:
                found.append(f"the {side} motor (port {port}) {said}")
        return tuple(found)

    def complaint(self) -> str:
        """Why the wheels may not do what is asked, in words."""
        if not self.followed:
            return "the readings are recorded, and do not follow these commands"
        if stalled := self.wheels.stalled:
            ports = dict(zip(("left", "right"), self._ports, strict=True))
            named = " and ".join(f"{side} (motor port {ports[side]})" for side in stalled)
            return f"power and no motion at {named}: blocked, unplugged or a fuse"
        if self.wheels.missing_speed > 0.0:
            missing = self.wheels.missing_speed * self._radius
            return f"the battery is too weak: {missing:.3f} m/s are missing"
        if self.wheels.saturated:
            return "a wheel is at full power and falls behind"
        return "the wheels follow" if any(self._given) else "the wheels are not driven"

    def speed_of(self, voltage: float) -> float:
        """M/s that so many V more at the motors are worth."""
        return min(wheel.gain for wheel in self.wheels.models) * voltage * self._radius

    @property
    def missing_speed(self) -> float:
        """M/s that the faster wheel is short of because the battery cannot give more."""
        return self.wheels.missing_speed * self._radius

    @property
    def half_track(self) -> float:
        """Half the track width, m."""
        return self._half_track

    def is_finite(self) -> bool:
        """False when something asked for a speed that is not a number."""
        return math.isfinite(self._target.left) and math.isfinite(self._target.right)
