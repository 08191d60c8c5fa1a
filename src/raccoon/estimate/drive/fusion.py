"""The drive filter at work: steps of wheels and gyro, doubt about a wheel, standing still, and things seen
late.

Every step is kept for two seconds. What was seen at an earlier time is applied to the belief of that time
and the steps since then are taken again, so it counts where it belongs.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from raccoon.estimate.drive.estimate import Observation
from raccoon.estimate.drive.health import Reasons
from raccoon.estimate.drive.observations import Seen, Way, checked, of_state
from raccoon.estimate.drive.slip import SlipWatch
from raccoon.estimate.ekf.filter import DriveFilter, variance_index
from raccoon.estimate.ekf.generated import Flat
from raccoon.estimate.ekf.model import Array
from raccoon.estimate.ekf.state import OdometrySettings, State
from raccoon.model.drive import DriveGeometry

TURNING_TIME = 0.1
"""s over which the motion is averaged that shows the scales."""
SLOW, SLOW_TURN = 0.01, 0.1
"""m/s and rad/s below which a scale does not show beside an offset."""
KEPT_STEPS = 100
DOUBTED = 100.0
"""(rad/s)^2, variance of a wheel that slips: it counts for nothing beside the others."""
RELEARN = 0.05
"""Deviation that both scales get where they turn out wrong."""


@dataclass(frozen=True, slots=True)
class Step:
    """One step of the filter: what was read over `span` s until `time`, and the belief after it."""

    time: float
    span: float
    read: tuple[float, ...]
    variances: tuple[float, ...]
    turning: tuple[float, float]
    still: bool
    flat: Flat
    distance: float


class Fusion:
    """Moves the filter on, step by step, and remembers how."""

    def __init__(self, drive: DriveFilter, settings: OdometrySettings) -> None:
        self.drive = drive
        self.geometry: DriveGeometry = drive.geometry
        self.slip = SlipWatch()
        self.way = Way()
        self.distance = 0.0
        self._settings = settings
        self._mean_velocity = self._mean_turn_rate = 0.0
        self._steps: deque[Step] = deque(maxlen=KEPT_STEPS)

    def place(self, x: float, y: float, heading: float) -> None:
        """Take the pose to be known; forget how it came about."""
        self.drive.place(x, y, heading, 1e-4)
        self._steps.clear()
        self.distance = 0.0
        self.way = Way()

    def advance(
        self,
        time: float,
        span: float,
        read: tuple[float, ...],
        variances: tuple[float, ...],
        still: bool,
        reasons: Reasons,
        repeated_gyro: bool,
    ) -> None:
        """Take a step: left and right wheel (rad/s, nominal scale) and, where it is there, the gyro
        (rad/s).
        """
        turning = (0.0, 0.0) if still else self._turning(span)
        before = self.drive.flat
        innovations = self._take(span, read, variances, turning)
        if len(read) == 3 and not still:
            read, variances = self._judged(
                time, span, read, variances, turning, before, innovations, reasons, repeated_gyro
            )
        if still:
            self._hold_still()
        velocity = self.drive.flat[State.VELOCITY]
        self.distance += velocity * span
        way = self.way
        way.left += read[0] * span
        way.right += read[1] * span
        way.seconds += span
        self._steps.append(Step(time, span, read, variances, turning, still, self.drive.flat, self.distance))

    def _judged(
        self,
        time: float,
        span: float,
        read: tuple[float, ...],
        variances: tuple[float, ...],
        turning: tuple[float, float],
        before: Flat,
        innovations: Flat,
        reasons: Reasons,
        repeated_gyro: bool,
    ) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """The step as it stands after doubt: taken again without the wheel, or the gyro, that does not
        fit.
        """
        slip = self.slip
        innovation, variance = innovations[4], innovations[5]
        if not slip.disagrees(innovation, variance):
            slip.calm(span)
            return read, variances
        self.drive.flat = before
        if repeated_gyro:
            reasons.tell("the gyro is frozen", time)
            read, variances = read[:2], variances[:2]
        elif slip.scales_are_wrong:
            reasons.tell("the wheels' scales do not fit the gyro", time, 1.0)
            slip.start_again()
            self.drive.widen((State.LEFT_SCALE, State.RIGHT_SCALE), RELEARN)
        else:
            flat = before
            speeds = read[0] - flat[State.LEFT_OFFSET], read[1] - flat[State.RIGHT_OFFSET]
            left = slip.blame(span, innovation, *speeds) == "left"
            variances = (
                variances[0] + (DOUBTED if left else 0.0),
                variances[1] + (0.0 if left else DOUBTED),
                variances[2],
            )
            if slip.wheel is not None:
                reasons.tell(f"the {slip.wheel} wheel slips", time)
        self._take(span, read, variances, turning)
        return read, variances

    def _take(
        self, span: float, read: tuple[float, ...], variances: tuple[float, ...], turning: tuple[float, float]
    ) -> Flat:
        if len(read) == 3:
            return self.drive.step(span, read, variances, turning)  # type: ignore[arg-type]
        return self.drive.step_wheels(span, read, variances, turning)  # type: ignore[arg-type]

    def _hold_still(self) -> None:
        settings = self._settings
        self.drive.still(settings.standstill_velocity**2, settings.standstill_turn_rate**2)

    def _turning(self, span: float) -> tuple[float, float]:
        """How fast the wheels turn, for seeing their scales: the motion, averaged while it is steady.

        With the newest motion, its noise times itself would move both scales together, which nothing measures
        when driving straight.
        """
        flat, share = self.drive.flat, span / (TURNING_TIME + span)
        velocity, turn_rate = flat[State.VELOCITY], flat[State.TURN_RATE]
        if abs(velocity - self._mean_velocity) > 0.01 or abs(turn_rate - self._mean_turn_rate) > 0.03:
            share = 1.0
        self._mean_velocity += (velocity - self._mean_velocity) * share
        self._mean_turn_rate += (turn_rate - self._mean_turn_rate) * share
        if abs(self._mean_velocity) < SLOW and abs(self._mean_turn_rate) < SLOW_TURN:
            return 0.0, 0.0
        return self.geometry.wheel_speeds(self._mean_velocity, self._mean_turn_rate)

    def observe(self, seen: Seen, shift: Array, time: float | None) -> Observation:
        """Take something seen. shift: (3,) how far the pose has moved on since the last step.

        time: when it was seen; None is now.
        """
        if time is None:
            return self._observe_here(seen, shift)
        steps = list(self._steps)
        after = next((n for n, step in enumerate(steps) if step.time > time), len(steps))
        if after == 0:
            oldest = steps[0].time if steps else math.nan
            return Observation(False, math.nan, f"seen at {time} s: nothing is kept from before {oldest} s")
        here = steps[after - 1]
        now = self.drive.flat
        self.drive.flat = here.flat
        found = self._observe_here(seen, self._between(here, steps[after:], time))
        if not found.accepted:
            self.drive.flat = now
            return found
        self._steps = deque(steps[: after - 1], maxlen=KEPT_STEPS)
        self._keep(here)
        for step in steps[after:]:
            self._take(step.span, step.read, step.variances, step.turning)
            if step.still:
                self._hold_still()
            self._keep(step)
        return found

    def _keep(self, step: Step) -> None:
        self._steps.append(
            Step(
                step.time,
                step.span,
                step.read,
                step.variances,
                step.turning,
                step.still,
                self.drive.flat,
                step.distance,
            )
        )

    def _between(self, here: Step, later: list[Step], time: float) -> Array:
        """How far the pose moves from a step to a time before the next."""
        if not later:
            return np.zeros(3)
        share = (time - here.time) / later[0].span
        moved: Array = np.array(later[0].flat[: State.VELOCITY]) - np.array(here.flat[: State.VELOCITY])
        return share * moved

    def _observe_here(self, seen: Seen, shift: Array) -> Observation:
        expected, jacobian = of_state(seen, shift)
        before = self.drive.flat
        distance = self.drive.observe(
            seen.measured, expected, jacobian, np.diag(seen.std**2), residual=seen.residual
        )
        return self._gated(before, distance, seen.gate)

    def observe_way(self, distance: float, std: float) -> Observation:
        """Take a taped way of the robot's middle since the mark, m; negative where it went back."""
        checked(std, distance)
        radius = self.geometry.wheel_radius
        slip = self._settings.slip_noise**2 * abs(distance)
        before, way = self.drive.flat, self.way
        found = self.drive.observe(
            np.array([distance]),
            lambda state: way.expected(state, radius),
            lambda state: way.jacobian(state, radius),
            np.array([[std**2 + slip]]),
        )
        return self._gated(before, found, 3.291)

    def _gated(self, before: Flat, distance: float, gate: float) -> Observation:
        if distance <= gate:
            return Observation(True, distance)
        self.drive.flat = before
        return Observation(False, distance, f"{distance:.1f} standard deviations off: at most {gate:.1f}")

    def deviation(self, state: State) -> float:
        """Standard deviation of a state."""
        return math.sqrt(self.drive.flat[variance_index(state)])
