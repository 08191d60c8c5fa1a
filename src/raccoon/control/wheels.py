"""The speed loop of the two driven wheels: from wanted speeds to duties.

Each wheel has a feedforward from its model and a PID loop on its measured speed, both in volts. Volts become
duty by the present battery voltage, so the same command makes the same motion on every battery.

The PID loop compares the measurement not with the target but with the expected reading of a nominal wheel:
the motor lags its voltage, and the back-EMF filter lags the motor. So a nominal wheel has no error and
follows by feedforward alone, without overshoot, and the loop corrects only differences from the model.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from raccoon.control.feedforward import WheelModel
from raccoon.control.pid import Pid, PidGains
from raccoon.control.tuning import SlowCycleGains
from raccoon.control.voltage import MIN_VOLTAGE
from raccoon.control.wheel_watch import WheelState, WheelWatch

MAX_DUTY = 1.0
CYCLE_S, DEAD_TIME_S = 0.005, 0.0075
"""s, defaults of a cycle's length and of the dead time from a reading to its effect."""
STRAIGHT_SHARE, STRAIGHT_SPEED = 0.15, 0.3
"""Differences of the wheels' target speeds up to which the robot drives straight: as a share of the faster
one, and rad/s."""
STANDING_SHARE = 0.05
"""Target speed as a share of the other wheel's, below which a wheel is to stand, as in a pivot: friction may
hold it."""
SETTLE_AFTER_TURN_S = 0.3
"""s after a turn until the robot drives straight."""


@dataclass(frozen=True, slots=True)
class WheelTarget:
    """Wanted wheel speed rad/s and its rate of change rad/s2, left and right."""

    left: float = 0.0
    right: float = 0.0
    left_acceleration: float = 0.0
    right_acceleration: float = 0.0


REST = WheelTarget()


class ExpectedSpeed:
    """The expected reading of a nominal wheel, driven by the feedforward alone.

    The feedforward for target w and acceleration a settles at w + tau a, so the wheel follows tau dw'/dt = w
    + tau a - w', and the reading follows the wheel with the filter's time constant.
    """

    __slots__ = ("_drive", "_filter", "_lag", "reading", "wheel")

    def __init__(self, motor_time_constant: float, filter_time_constant: float) -> None:
        self._lag = motor_time_constant
        self._filter = max(filter_time_constant, 1e-6)
        self._drive = 0.0
        self.wheel = 0.0
        self.reading = 0.0

    def advance(self, dt: float) -> float:
        """The reading after `dt` s more of the last command."""
        middle = self.wheel
        self.wheel += (1.0 - math.exp(-dt / self._lag)) * (self._drive - self.wheel)
        middle = 0.5 * (middle + self.wheel)
        self.reading += (1.0 - math.exp(-dt / self._filter)) * (middle - self.reading)
        return self.reading

    def command(self, target: float, acceleration: float) -> None:
        """Set the command that holds from now on."""
        self._drive = target + self._lag * acceleration

    def reset(self, speed: float = 0.0) -> None:
        """Start from a wheel that turns at `speed` rad/s."""
        self._drive = self.wheel = self.reading = speed


class Wheel:
    """Feedforward and feedback of one wheel, in volts.

    cycle, dead_time: s, nominal length of a cycle, and the dead time that the gains were designed for.
    """

    __slots__ = (
        "_active",
        "_applied",
        "_limit",
        "_per_speed",
        "_slow",
        "_static",
        "expected",
        "model",
        "pid",
        "watch",
    )

    def __init__(
        self,
        model: WheelModel,
        gains: PidGains,
        filter_time_constant: float,
        cycle: float = CYCLE_S,
        dead_time: float = DEAD_TIME_S,
    ) -> None:
        self.model = model
        self._slow = SlowCycleGains(cycle, dead_time + filter_time_constant)
        self.pid = Pid(gains)
        self.expected = ExpectedSpeed(model.time_constant, filter_time_constant)
        self.watch = WheelWatch(model)
        self._static, self._per_speed = model.static_voltage, 1.0 / model.gain
        self._active = False
        self._applied = 0.0
        self._limit: float | None = None  # V, of the cycle before

    def voltage(
        self, target: float, acceleration: float, speed: float | None, dt: float, limit: float
    ) -> float:
        """V within -limit..limit for `target` rad/s; `speed` is the reading, None if there is none."""
        if not self._active:  # start from the wheel's speed, to avoid a jerk
            self._active = True
            self.expected.reset(speed or 0.0)
        sagged, self._limit = 0.0 if self._limit is None else limit / self._limit - 1.0, limit
        self.watch.update(self._applied, speed, dt, sagged)
        reading = self.expected.advance(dt)
        self.expected.command(target, acceleration)
        feedforward = self.model.voltage(target, acceleration)
        share = self._slow.share(dt)
        if speed is None:
            self._applied = max(-limit, min(limit, feedforward + self.pid.integral))
        else:
            self._applied = self.pid.step(reading, speed, dt, feedforward, limit, share)
        return self._applied

    def resume(self) -> None:
        """Start from the wheel's speed, after a pause in which its motion is unknown. What was learnt
        stays."""
        self._active = False
        self.watch.stop_learning()
        self.pid.reset(self.pid.integral)

    def top_speed(self, voltage: float) -> float:
        """rad/s at steady state with `voltage` V at the motor; called in every cycle."""
        return max(0.0, (voltage - self._static) / self._per_speed)

    def rest(self) -> None:
        """Reset the loop."""
        self._active = False
        self._applied = 0.0
        self.watch.stop_learning()
        self.pid.reset()


class WheelLoop:
    """Both wheels' loops with a common ratio: if one wheel cannot follow, the other slows down with it.

    left, right: models of the wheels. gains: of both loops or of each, in V per rad/s. filter_time_constant:
    s, of the back-EMF filter. nominal_voltage: V, used until the battery has been measured. cycle, dead_time:
    see `Wheel`.
    """

    __slots__ = ("_battery", "_held", "_left", "_right", "_straight", "missing_speed", "saturated")

    def __init__(
        self,
        left: WheelModel,
        right: WheelModel,
        gains: PidGains | tuple[PidGains, PidGains],
        filter_time_constant: float,
        nominal_voltage: float,
        cycle: float = CYCLE_S,
        dead_time: float = DEAD_TIME_S,
    ) -> None:
        if not nominal_voltage > MIN_VOLTAGE:
            raise ValueError(f"nominal_voltage is {nominal_voltage} V: it must be above {MIN_VOLTAGE}")
        both = (gains, gains) if isinstance(gains, PidGains) else gains
        self._left = Wheel(left, both[0], filter_time_constant, cycle, dead_time)
        self._right = Wheel(right, both[1], filter_time_constant, cycle, dead_time)
        self._battery = nominal_voltage
        self._held = False
        self._straight = SETTLE_AFTER_TURN_S
        self.saturated = False
        """Whether the battery cannot supply the wanted voltage."""
        self.missing_speed = 0.0
        """rad/s by which the faster wheel misses its target because of saturation."""

    def reset(self) -> None:
        """Reset the integrals, as after a stop."""
        self._left.rest()
        self._right.rest()
        self.saturated = False
        self.missing_speed = 0.0

    def hold(self) -> None:
        """Both wheels push against something: their voltages say nothing about the motors until they have
        come to rest, even if the load watch takes it for a heavy floor after a while."""
        if not self._held:
            self._held = True
            self._left.watch.drop_recent()
            self._right.watch.drop_recent()

    def resume(self) -> None:
        """Continue after a pause without control."""
        self._left.resume()
        self._right.resume()

    def step(
        self,
        target: WheelTarget,
        left_speed: float | None,
        right_speed: float | None,
        dt: float,
        battery_voltage: float | None,
    ) -> tuple[float, float]:
        """Duties (left, right) for this cycle. A wheel with a speed of None uses its feedforward alone."""
        if battery_voltage is not None and battery_voltage > MIN_VOLTAGE:
            self._battery = battery_voltage
        if target == REST:
            self._straight += dt
            self._held = False
            self.reset()
            return 0.0, 0.0
        # Scrubbing in a turn loads the outer wheel and pushes the inner one, and a turn has another inertia:
        # only wheels that drive straight characterise their motors. Turns on the spot load both alike, but
        # not on a slope or along a wall. In simulated ones, a motor of 1.5 times the resistance takes 1.2 to
        # 1.5 times the voltage of the other; a good one takes up to 1.45 times on a ramp of 10 degrees, and
        # 1.6 to 3.6 times at a wall.
        apart = abs(target.left - target.right)
        turns = apart > max(STRAIGHT_SPEED, STRAIGHT_SHARE * max(abs(target.left), abs(target.right)))
        self._straight = 0.0 if turns else self._straight + dt
        self._left.watch.held = self._right.watch.held = self._held or self._straight < SETTLE_AFTER_TURN_S
        self._left.watch.stands = abs(target.left) < STANDING_SHARE * abs(target.right)
        self._right.watch.stands = abs(target.right) < STANDING_SHARE * abs(target.left)
        limit = MAX_DUTY * self._battery
        share = self._attainable_share(target, limit)
        left = self._left.voltage(target.left * share, target.left_acceleration, left_speed, dt, limit)
        right = self._right.voltage(target.right * share, target.right_acceleration, right_speed, dt, limit)
        self.saturated = share < 1.0 or bool(self._left.pid.saturated or self._right.pid.saturated)
        return left / self._battery, right / self._battery

    @property
    def stalled(self) -> tuple[str, ...]:
        """The sides ("left", "right") whose wheel is driven and does not turn."""
        return tuple(side for side, watch in self._watches() if watch.stalled)

    @property
    def standing(self) -> tuple[str, ...]:
        """The sides whose target speed is (almost) 0 while the other wheel turns."""
        return tuple(side for side, watch in self._watches() if watch.stands)

    def _watches(self) -> tuple[tuple[str, WheelWatch], tuple[str, WheelWatch]]:
        return ("left", self._left.watch), ("right", self._right.watch)

    @property
    def states(self) -> tuple[WheelState, WheelState]:
        """Results of the watches on the left and the right wheel."""
        return self._left.watch.state, self._right.watch.state

    @property
    def battery(self) -> float:
        """V, the last plausible reading."""
        return self._battery

    @property
    def models(self) -> tuple[WheelModel, WheelModel]:
        """The models of the wheels."""
        return self._left.model, self._right.model

    def _attainable_share(self, target: WheelTarget, limit: float) -> float:
        """The share of the target that both wheels can reach, keeping the ratio of their speeds."""
        share = 1.0
        self.missing_speed = 0.0
        for speed, wheel in ((target.left, self._left), (target.right, self._right)):
            top = wheel.top_speed(limit)
            if abs(speed) > top:
                share = min(share, top / abs(speed))
                self.missing_speed = max(self.missing_speed, abs(speed) - top)
        return share
