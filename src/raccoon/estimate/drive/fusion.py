"""Sensor fusion of the drive: filter steps of wheels and gyro, slip, standstill, and late observations.

Every step of the last two seconds is kept, with the observations after it. A late observation updates the
state at its own time; then all later steps and observations are applied again.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from raccoon.estimate.drive.estimate import SLIPS, Observation
from raccoon.estimate.drive.filter_step import FilterStep, StepReading
from raccoon.estimate.drive.health import Reasons
from raccoon.estimate.drive.observations import GATES, PoseMeasurement, WheelTravel, check_observation
from raccoon.estimate.drive.scale_doubt import NO_DOUBT, ScaleDoubt
from raccoon.estimate.drive.slip import (
    RESTING_SPEED,
    SlipWatch,
    are_scales_plausible,
    can_scales_explain,
    is_slip_ambiguous,
)
from raccoon.estimate.drive.timing import believed_delay_motion
from raccoon.estimate.drive.wheels import LONGEST_GAP_S
from raccoon.estimate.ekf.filter import DriveFilter, variance_index
from raccoon.estimate.ekf.generated import Flat
from raccoon.estimate.ekf.model import Array
from raccoon.estimate.ekf.state import OdometrySettings, State
from raccoon.model.drive import DriveGeometry, arc_end

KEPT_STEPS = 115
"""Number of filter steps kept for late observations: two seconds of steps of 17.5 ms."""
DOUBTED_VARIANCE = 1e4
"""(rad/s)^2, variance added to the speed of a slipping wheel, so large that its reading has no weight."""
LOST_HEADING_STD = 0.4
"""rad, standard deviation of the heading after a gap above which the whole pose counts as unknown."""
LOST_POSE_STD = 2.0
"""m and rad, standard deviation of an unknown pose: anywhere on a table, with any heading."""
RELEARNT_SCALE_STD = 0.05
"""Relative standard deviation added to both wheel scales when they turn out to be wrong."""
WRONG_BLAME_SHARE = 0.3
"""Standard deviation of the distance while one wheel is distrusted, as a share of the difference that blaming
the other wheel would make: one choice in ten is wrong, as when a hand or another robot pushes this one."""
AMBIGUOUS_BLAME_SHARE = 0.5
"""The same share if it may be either wheel: the filter takes the mean of the two distances."""
MAX_RELEARNINGS = 5
"""Maximum number of such additions to the scales' variance: two or three suffice to find the true scales."""


class Fusion:
    """Applies steps and observations to the filter, and keeps the most recent ones to apply them again."""

    def __init__(self, drive: DriveFilter, settings: OdometrySettings) -> None:
        self.drive = drive
        self.geometry: DriveGeometry = drive.geometry
        self.slip, self._scale_doubt = SlipWatch(), ScaleDoubt(drive.flat)
        self.wheel_travel = WheelTravel()
        self.distance = 0.0
        self.may_be_held = False
        """Whether the robot may have stood still in the last step although its wheels turned."""
        self._settings = settings
        self._track = self.geometry.track_width / self.geometry.wheel_radius
        self._bridged_travel = self._blamed_way = 0.0
        self._relearnings = 0
        self._steps: deque[FilterStep] = deque(maxlen=KEPT_STEPS)

    def place(self, x: float, y: float, heading: float) -> None:
        """Set the pose (m, m, rad) as known exactly, and drop the kept steps."""
        self.drive.set_pose(x, y, heading, 1e-4)
        self._steps.clear()
        self.distance = 0.0
        self.wheel_travel = WheelTravel()

    def advance(self, reading: StepReading, reasons: Reasons, repeated_gyro: bool) -> None:
        """Apply a step. repeated_gyro: the gyro repeated a reading more often than its noise allows."""
        before = self.drive.flat
        innovations = self._apply(reading)
        self.may_be_held = reading.along_variance > 0.0
        if len(reading.values) == 3 and not (reading.still or reading.is_wheel_mute):
            reading = self._resolve_disagreement(reading, before, innovations, reasons, repeated_gyro)
        self._keep_scales_plausible(before)
        doubt = self._scale_doubt.added_deviations(self.drive.flat)
        if doubt != NO_DOUBT:
            self.drive.widen_way(*doubt)
            reading = replace(reading, way_doubt=doubt)
        bridged = reading.end_speeds is not None
        if bridged:
            self.slip.reset()
        if reading.still:
            self.slip.begin_rest()
            self._apply_standstill()
        flat, span = self.drive.flat, reading.span
        self.distance += self._bridged_travel if bridged else flat[State.WAY] * flat[State.VELOCITY] * span
        self.wheel_travel.add(reading.values[0], reading.values[1], span)
        self._steps.append(FilterStep(reading, flat))

    def _resolve_disagreement(
        self, reading: StepReading, before: Flat, innovations: Flat, reasons: Reasons, repeated_gyro: bool
    ) -> StepReading:
        """Apply the step again from the state `before` it, without the wheel or gyro that disagrees, if one
        does; returns the step as applied."""
        slip, time = self.slip, reading.time
        innovation, variance = innovations[4], innovations[5]
        if not slip.disagrees(innovation, variance):
            spins = slip.slipped or reading.may_slide
            if spins or slip.may_slip(innovation, variance, reading.gyro_variance):
                # The turn is taken from the gyro alone, and scales and delay are not updated.
                self.drive.flat = before
                half = innovation * 0.5 * self._track
                doubt = DOUBTED_VARIANCE if spins else half * half
                reading = reading.without_turn_of_wheels(doubt)
                self._apply(reading)
            slip.take_agreement(reading.span, max(map(abs, reading.values[:2])) > RESTING_SPEED)
            if slip.wheel is None:
                self._blamed_way = 0.0
            return reading
        self.drive.flat = before
        if repeated_gyro:
            reasons.tell("the gyro is frozen", time)
            values, variances = reading.values[:2], reading.variances[:2]
            reading = replace(reading, values=values, variances=variances, turn_timing_std=0.0)
        elif slip.scales_are_wrong and self._relearnings < MAX_RELEARNINGS:
            reasons.tell("the wheels' scales do not fit the gyro", time, 1.0)
            slip.reset()
            self._relearnings += 1
            reading = replace(reading, added_scale_std=RELEARNT_SCALE_STD)
        else:
            reading = self._distrust_wheel(reading, innovation)
            if slip.wheel is not None:
                reasons.tell(SLIPS[slip.wheel], time)
        self._apply(reading)
        return reading

    def _distrust_wheel(self, reading: StepReading, innovation: float) -> StepReading:
        """The step with a larger variance for the slipping wheel, or for both if either may slip."""
        flat, (left, right) = self.drive.flat, reading.values[:2]
        speeds = left - flat[State.LEFT_OFFSET], right - flat[State.RIGHT_OFFSET]
        turn = (reading.values[2] - flat[State.GYRO_BIAS]) / flat[State.GYRO_SCALE]
        may_be_scales = reading.along_variance == 0.0 and can_scales_explain(self._track * turn, *speeds)
        blamed = self.slip.take_disagreement(reading.span, innovation, *speeds, may_be_scales)
        of_left, of_right, of_gyro = reading.variances
        is_ambiguous, blamed_before = is_slip_ambiguous(innovation, *speeds), self._blamed_way
        share = AMBIGUOUS_BLAME_SHARE if is_ambiguous else WRONG_BLAME_SHARE
        self._blamed_way += share * self.geometry.track_width * abs(innovation) * reading.span
        along_variance = reading.along_variance + self._blamed_way**2 - blamed_before**2
        reading = replace(reading, along_variance=along_variance)
        if is_ambiguous:
            return reading.without_turn_of_wheels(DOUBTED_VARIANCE)
        if blamed == "left":
            return replace(reading, variances=(of_left + DOUBTED_VARIANCE, of_right, of_gyro))
        return replace(reading, variances=(of_left, of_right + DOUBTED_VARIANCE, of_gyro))

    def _apply(self, reading: StepReading) -> Flat:
        """Apply a step to the filter. Returns its innovations and their variances; () after a gap."""
        span, values, variances = reading.span, reading.values, reading.variances
        if reading.rest_doubt is not None:
            reading.rest_doubt.add_to(self.drive)
        if reading.added_scale_std > 0.0:
            self.drive.widen_scales(reading.added_scale_std)
        if reading.may_slide:
            self.drive.widen_along(reading.along_variance, reading.across_variance)
        if reading.end_speeds is not None:
            self._bridge(reading, reading.end_speeds)
            return ()
        found = self.drive.step(
            span, values, variances, reading.turn_acceleration, reading.differential_variance
        )
        if reading.turn_timing_std > 0.0:
            self.drive.widen((State.HEADING,), reading.turn_timing_std)
        if reading.way_doubt != NO_DOUBT:
            self.drive.widen_way(*reading.way_doubt)
        return found

    def _bridge(self, reading: StepReading, end_speeds: tuple[float, float]) -> None:
        """Move the filter over a gap in the readings by the counters alone."""
        flat, span, (left, right) = self.drive.flat, reading.span, reading.values
        speeds = end_speeds[0] - flat[State.LEFT_OFFSET], end_speeds[1] - flat[State.RIGHT_OFFSET]
        motion = self.geometry.body_motion(*speeds)
        angles, variances = (left * span, right * span), (reading.variances[0], reading.variances[1])
        shared = reading.differential_variance, reading.angle_covariance
        self._bridged_travel = self.drive.bridge(span, angles, variances, *shared, motion)
        if span >= LONGEST_GAP_S or self.deviation(State.HEADING) > LOST_HEADING_STD:
            # The filter is not linear over such uncertainty: later updates would move the pose erratically.
            x, y, heading = flat[: State.VELOCITY]
            self.drive.set_pose(x, y, heading, LOST_POSE_STD)
            self._bridged_travel = 0.0

    def _keep_scales_plausible(self, before: Flat) -> None:
        """Restore the scales of `before` if the new ones are beyond any plausible error of robot.toml."""
        if not are_scales_plausible(*self.drive.flat[State.WAY : State.GYRO_SCALE]):
            self.drive.copy_scales(before)

    def _apply_standstill(self) -> None:
        settings = self._settings
        self.drive.apply_standstill(settings.standstill_velocity**2, settings.standstill_turn_rate**2)

    def doubt_way(self, way: float) -> None:
        """Add a standard deviation of `way` m along the heading to the position, also to the last kept step,
        so that it remains when steps are applied again."""
        self.drive.widen_along(way * way)
        if self._steps:
            last = self._steps.pop()
            reading = replace(last.reading, along_variance=last.reading.along_variance + way * way)
            self._steps.append(replace(last, reading=reading, flat=self.drive.flat))

    def observe(
        self, measured: PoseMeasurement, shift: Array, span: float, time: float | None
    ) -> Observation:
        """Apply a measurement of the pose at `time` (s; None: now).

        shift: (3,) m, m, rad from the pose of the last step, `span` s ago, to the pose now.
        """
        if time is None:
            return self._observe_and_keep(partial(self._apply_measurement, measured, shift))
        steps = list(self._steps)
        after = next((n for n, step in enumerate(steps) if step.time > time), len(steps))
        if after == 0:
            stored = f"cycles are stored from {steps[0].time:.3f} s on" if steps else "no cycle is stored yet"
            return Observation(False, math.nan, f"seen at {time} s: {stored}")
        last = steps[after - 1]
        flat_now, steps_now = self.drive.flat, self._steps
        self.drive.flat = last.flat
        begin = self._shift_between(last.flat, last.flat)
        if after < len(steps):
            end = steps[after]
            shift, span = self._shift_between(end.flat, last.flat), end.reading.span
        share = (time - last.time) / span if span > 0.0 else 0.0
        shift = begin + share * (shift - begin)
        self._steps = deque(steps[:after], maxlen=KEPT_STEPS)
        found = self._observe_and_keep(partial(self._apply_measurement, measured, shift))
        if not found.accepted:
            self.drive.flat, self._steps = flat_now, steps_now
            return found
        for step in steps[after:]:
            before_step = self.drive.flat
            self._apply(step.reading)
            self._keep_scales_plausible(before_step)
            if step.reading.still:
                self._apply_standstill()
            for observe_again in step.observations:
                observe_again()
            self._steps.append(replace(step, flat=self.drive.flat))
        return found

    def _observe_and_keep(self, observe: Callable[[], Observation]) -> Observation:
        """Apply an observation; keep an accepted one with the last step, to apply both again later."""
        found = observe()
        if found.accepted and self._steps:
            last = self._steps.pop()
            kept = (*last.observations, observe)
            self._steps.append(replace(last, flat=self.drive.flat, observations=kept))
        return found

    def _shift_between(self, ahead: Flat, behind: Flat) -> Array:
        """(3,) m, m, rad from the pose of state `behind` to the robot in state `ahead`, delays included."""
        x, y, heading = ahead[: State.VELOCITY]
        pose = arc_end(x, y, heading, *believed_delay_motion(ahead, self._settings.timing))
        moved: Array = np.array(pose) - np.array(behind[: State.VELOCITY])
        return moved

    def _apply_measurement(self, measured: PoseMeasurement, shift: Array) -> Observation:
        functions = measured.functions_of_state(shift)
        before, noise = self.drive.flat, np.diag(measured.std**2)
        distance = self.drive.observe(measured.values, *functions, noise, residual=measured.residual)
        return self._gate(before, distance, measured.gate)

    def observe_way(self, distance: float, std: float) -> Observation:
        """Apply a taped distance of the robot's origin since the mark, m; negative: backwards."""
        check_observation(std, distance)
        return self._observe_and_keep(partial(self._apply_way, replace(self.wheel_travel), distance, std))

    def _apply_way(self, way: WheelTravel, distance: float, std: float) -> Observation:
        radius = self.geometry.wheel_radius
        slip = self._settings.slip_noise**2 * abs(distance)
        before = self.drive.flat
        mahalanobis = self.drive.observe(
            np.array([distance]),
            lambda state: way.expected(state, radius),
            lambda state: way.jacobian(state, radius),
            np.array([[std**2 + slip]]),
        )
        return self._gate(before, mahalanobis, GATES[1])

    def _gate(self, before: Flat, distance: float, gate: float) -> Observation:
        """Accept an observation at this Mahalanobis distance, or restore the state `before` it."""
        if distance <= gate:
            self._keep_scales_plausible(before)
            return Observation(True, distance)
        self.drive.flat = before
        return Observation(False, distance, f"{distance:.1f} standard deviations off: at most {gate:.1f}")

    def deviation(self, state: State) -> float:
        """Standard deviation of a state."""
        return math.sqrt(self.drive.flat[variance_index(state)])
