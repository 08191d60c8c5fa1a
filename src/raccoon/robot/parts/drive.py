"""The drive base: turns the commands of motions into the duties of each tick."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from raccoon.control.feedforward import PLAUSIBLE_CONSTANT_SHARES, calibrated_constant, wheel_models
from raccoon.control.tuning import speed_loop_gains
from raccoon.control.wheel_watch import ODD_SHARE, describe_oddities
from raccoon.control.wheels import REST, WheelLoop, WheelTarget
from raccoon.core.config import RobotConfig
from raccoon.core.readings import MOTOR_PORTS, Device, Outputs
from raccoon.estimate.drive.estimate import HELD
from raccoon.estimate.drive.wheel_track import SPEED_SMOOTHING_S
from raccoon.robot.actions.limits import (
    FASTEST_SPEED,
    FASTEST_TURN,
    check_duties,
    check_finite,
    check_rate,
    check_speed,
)
from raccoon.robot.name_hints import Part
from raccoon.robot.parts.speed_limits import SpeedLimits, UnreadWheels

if TYPE_CHECKING:
    from raccoon.estimate.drive.estimate import DriveEstimate

Pair = tuple[float, float]
FIRMWARE_SAMPLE_S = 0.005
"""s between two samples of the back-EMF by the firmware."""
SHORT_DRIVE_S, MAX_SHORT_DRIVES = 0.1, 10
"""s, too short for a drive to reach its speed, and how many such drives in a row are a loop."""


def dead_time(config: RobotConfig) -> float:
    """Dead time from a reading to its effect, s: half a control period of hold plus one sample of the
    firmware."""
    return 0.5 / config.controller.rate_hz + FIRMWARE_SAMPLE_S


class Drive(Part):
    """The two driven wheels.

    Motions call `follow`, `duties` or `push` once in each tick, a program's own loop calls `velocity`.
    Without a command in a tick the wheels stop: nothing keeps running because it was forgotten.
    """

    called = "robot.run(drive(speed, turn_rate).until(...))"
    offers = "velocity and duties"

    def __init__(self, config: RobotConfig) -> None:
        model = config.model.drive
        self._config = config
        self._device: Device | None = None
        self.wheels = self._make_wheel_loop(None)
        self.speeds = SpeedLimits(config, self.wheels.models)
        """The limits with which motions are planned."""
        self._radius = model.wheel_radius.value
        self._half_track = 0.5 * model.track_width.value
        self._turn_inertia_share = model.inertia_turn.value / model.inertia_straight.value
        self._ports = (config.drive.left, config.drive.right)
        self._brake = tuple(port in self._ports for port in range(MOTOR_PORTS))
        self._signs = tuple(-1.0 if config.motor(port).inverted else 1.0 for port in self._ports)
        self._factors = tuple(config.motor(port).power_factor.value for port in self._ports)
        self.remarks: dict[str, str] = {}
        """Remarks made so far, the first of each kind."""
        self.followed = True
        """Whether the readings respond to the commands. Those of a recording do not respond to others, and
        show nothing of the motors."""
        self._target = REST
        self._open_loop: tuple[float, float] | None = None
        self._last_duties = (0.0, 0.0)  # duties of the last command, before the wiring sign
        self._unread_wheels = UnreadWheels()
        self._is_claimed = False
        self.cut = False
        """Whether the velocity requested in this tick was reduced because it could not be read."""
        self._last_begin, self._short_drives = -math.inf, 0

    def _make_wheel_loop(self, device: Device | None) -> WheelLoop:
        left, right = wheel_models(self._config, device)
        late = dead_time(self._config)
        gains = tuple(speed_loop_gains(wheel, SPEED_SMOOTHING_S, late) for wheel in (left, right))
        voltage = self._config.model.battery.open_circuit_voltage.value
        cycle = 1.0 / self._config.controller.rate_hz
        return WheelLoop(left, right, (gains[0], gains[1]), SPEED_SMOOTHING_S, voltage, cycle, late)

    def configure(self, device: Device) -> None:
        """Take the K_E of calibrated motors from the meaning of this device's counters, and the highest wheel
        speed that it reads; once for each device."""
        if device is not self._device:
            self._device = device
            self.wheels = self._make_wheel_loop(device)
            self.speeds.configure(device, self.wheels.models)

    def resume(self) -> None:
        """Continue after a pause in which nothing was controlled."""
        self.wheels.resume()

    def velocity(
        self,
        forward: float,
        turn_rate: float = 0.0,
        acceleration: float = 0.0,
        turn_acceleration: float = 0.0,
    ) -> None:
        """Drive at `forward` m/s and `turn_rate` rad/s in this tick, for a program's own loop.

        acceleration (m/s2) and turn_acceleration (rad/s2) help the wheels to follow a changing speed. If the
        controller could not read a wheel at that speed, both are reduced by the same factor. Raises as
        `drive` does.
        """
        plain = type(forward) is type(turn_rate) is type(acceleration) is type(turn_acceleration) is float
        if not (plain and abs(forward) <= FASTEST_SPEED and abs(turn_rate) <= FASTEST_TURN):
            check_speed(forward=forward)
            check_rate(turn_rate=turn_rate)
            check_finite(forward=forward, turn_rate=turn_rate)  # None is no default here
            check_finite(acceleration=acceleration, turn_acceleration=turn_acceleration)
        self.follow(forward, turn_rate, acceleration, turn_acceleration)

    def follow(
        self,
        forward: float,
        turn_rate: float = 0.0,
        acceleration: float = 0.0,
        turn_acceleration: float = 0.0,
    ) -> None:
        """`velocity` for a motion, which has checked its arguments and adds its corrections. Raises
        ValueError for a number that is not finite: as a duty it would be full power."""
        # Numbers of NumPy stop here: the wheels' loops and the recordings have plain ones.
        forward, turn_rate = float(forward), float(turn_rate)
        acceleration, turn_acceleration = float(acceleration), float(turn_acceleration)
        if not math.isfinite(forward + turn_rate + acceleration + turn_acceleration):
            asked = f"{forward} m/s, {turn_rate} rad/s, {acceleration} m/s2 and {turn_acceleration} rad/s2"
            raise ValueError(f"velocity is {asked}: all of them must be finite numbers")
        self._claim()
        turn = turn_rate * self._half_track
        gain = acceleration / self._radius
        spin = turn_acceleration * self._half_track / self._radius * self._turn_inertia_share
        self._open_loop = None
        left, right = (forward - turn) / self._radius, (forward + turn) / self._radius
        share = self.speeds.readable_share(left, right)
        self.cut = share < 1.0
        self._target = WheelTarget(left * share, right * share, (gain - spin) * share, (gain + spin) * share)

    def duties(self, left: float, right: float) -> None:
        """Apply these duties (-1..1) to the wheels in this tick, without any control: driving by time."""
        check_duties(left, right)
        self._claim()
        self._open_loop = (float(left), float(right))

    def push(self, forward: float, battery_voltage: float | None, speeds: Pair, torques: Pair) -> Pair:
        """In this tick give both motors the voltage for `forward` m/s, whatever they do, limited to what
        presses with `torques` N m at the left and right wheel's speed in rad/s (inf: not limited). Returns
        these V."""
        self._claim()
        voltage = self.wheels.battery if battery_voltage is None else battery_voltage
        wanted = self.wheel_speed(float(forward))
        wanted *= self.speeds.readable_share(wanted, wanted)
        left, right = (
            max(-voltage, min(voltage, wheel.pressing_voltage(wanted, speed, torque)))
            for wheel, speed, torque in zip(self.wheels.models, speeds, torques, strict=True)
        )
        self._open_loop = left / voltage, right / voltage
        return left, right

    @property
    def asked(self) -> bool:
        """Whether a command was given in this tick already."""
        return self._is_claimed

    def is_looping(self, time: float) -> bool:
        """Whether drives without a goal have begun so often by `time` s, one after the other, that none
        reaches its speed. True once."""
        self._short_drives = self._short_drives + 1 if time - self._last_begin < SHORT_DRIVE_S else 0
        self._last_begin = time
        return self._short_drives == MAX_SHORT_DRIVES

    def wheel_speed(self, forward: float) -> float:
        """rad/s of the wheels at `forward` m/s straight ahead."""
        return forward / self._radius

    def stop(self) -> None:
        """Stop the wheels from this tick on."""
        self._target = REST
        self._open_loop = None
        self._is_claimed = self.cut = False

    def _claim(self) -> None:
        """Claim the one command of a tick: of two actions that drive at once one would be lost, and neither
        would arrive."""
        if self._is_claimed:
            raise RuntimeError(
                "two actions drive the wheels at the same time, in parallel or in the background: "
                "put them into a seq, or end one before the other begins; in your own loop call "
                "robot.tick() after each"
            )
        self._is_claimed = True

    def outputs(
        self,
        estimate: DriveEstimate,
        dt: float,
        battery_voltage: float | None,
        silent: tuple[bool, bool] = (False, False),
    ) -> Outputs:
        """The command of this tick. The request is cleared and must be repeated in the next tick.

        silent: whether the left and the right wheel are not read (`Odometry.silent_wheels`). A wheel of
        unknown speed gets its model's voltage without correction: a loop that took it for standing would give
        it full power. Nor may it be commanded more than before: see `UnreadWheels`.
        """
        if self._open_loop is not None:
            left, right = self._open_loop
            self.wheels.reset()
        else:
            if HELD in estimate.reasons:
                self.wheels.hold()
            left_speed = None if silent[0] else estimate.left_speed
            right_speed = None if silent[1] else estimate.right_speed
            target = self._unread_wheels.limit_target(self._target, silent)
            left, right = self.wheels.step(target, left_speed, right_speed, dt, battery_voltage)
        left = max(-1.0, min(1.0, self._factors[0] * left))
        right = max(-1.0, min(1.0, self._factors[1] * right))
        self._last_duties = (left, right)
        self.stop()
        duty = [0.0] * MOTOR_PORTS
        duty[self._ports[0]] = self._signs[0] * left
        duty[self._ports[1]] = self._signs[1] * right
        return Outputs(duty=tuple(duty), brake=self._brake)

    def current(self, left_speed: float, right_speed: float, battery_voltage: float) -> float:
        """Current (A) that the motors draw from the battery under the last command, by their models."""
        total = 0.0
        for duty, speed, wheel in zip(
            self._last_duties, (left_speed, right_speed), self.wheels.models, strict=True
        ):
            total += duty * (duty * battery_voltage - wheel.back_emf_constant * speed) / wheel.resistance
        return total

    def find_oddities(self) -> tuple[str, ...]:
        """What is odd about the motors, each with its port: a weak magnet, a high resistance."""
        if not self.followed:
            return ()
        found = []
        odd = describe_oddities(*self.wheels.states)
        wheels = zip(("left", "right"), self._ports, self.wheels.models, odd, strict=True)
        for side, port, model, said in wheels:
            nominal = getattr(self._config.model, side).back_emf_constant.value
            share = model.back_emf_constant / nominal
            if abs(share - 1.0) > ODD_SHARE:
                said = f"has {share:.2f} times the nominal K_E by its calibration"
            if said:
                found.append(f"the {side} motor (port {port}) {said}")
        return tuple(found)

    def describe_state(self) -> str:
        """Why the wheels may not do what is commanded, in words."""
        if not self.followed:
            return "the readings are from a recording and do not follow these commands"
        if stalled := self.wheels.stalled:
            ports = dict(zip(("left", "right"), self._ports, strict=True))
            named = " and ".join(f"{side} (motor port {ports[side]})" for side in stalled)
            return f"power but no motion at {named}: blocked, unplugged, or a tripped fuse"
        if self.wheels.missing_speed > 0.0:
            return self._describe_missing_speed()
        if self.wheels.saturated:
            return "a wheel is at full power and falls behind"
        return "the wheels follow" if any(self._last_duties) else "the wheels are not driven"

    def _describe_missing_speed(self) -> str:
        """Why a wheel is slower than commanded at full power."""
        missing, volts = self.wheels.missing_speed * self._radius, self.wheels.battery
        if volts < self._config.battery.weakest:  # with this one all that is planned can be driven
            return f"the battery is too weak, {volts:.2f} V: {missing:.3f} m/s are missing"
        said = f"a wheel at full power falls behind by {missing:.3f} m/s though the battery has {volts:.2f} V"
        for side, port in zip(("left", "right"), self._ports, strict=True):
            told = None if self._device is None else calibrated_constant(self._config, side, self._device)
            share = 1.0 if told is None else told / getattr(self._config.model, side).back_emf_constant.value
            if not PLAUSIBLE_CONSTANT_SHARES[0] < share < PLAUSIBLE_CONSTANT_SHARES[1]:
                wrong = f"radians_per_tick of motor {port} makes its K_E {share:.2g} times that of [model]"
                return f"{said}: {wrong}"
        return f"{said}: something holds the robot or a wheel, or a number of robot.toml is wrong"

    def speed_of(self, voltage: float) -> float:
        """Speed (m/s) that so many V more at the motors would add."""
        return min(wheel.gain for wheel in self.wheels.models) * voltage * self._radius

    @property
    def missing_speed(self) -> float:
        """Speed (m/s) that the faster wheel lacks because the battery cannot give more."""
        return self.wheels.missing_speed * self._radius

    @property
    def half_track(self) -> float:
        """Half the track width, m."""
        return self._half_track
