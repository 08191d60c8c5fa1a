"""The drive filter at work: steps of wheels and gyro, doubt about a wheel, standing still, and things seen
late.

Every step is kept for two seconds, with what was seen after it. What was seen at an earlier time is applied
to the belief of that time, and all that came since then is taken again, so it counts where it belongs.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from raccoon.estimate.drive.estimate import Observation
from raccoon.estimate.drive.health import Reasons
from raccoon.estimate.drive.observations import GATES, Seen, Way, checked, of_state
from raccoon.estimate.drive.scales import NOTHING, ScaleDoubt
from raccoon.estimate.drive.slip import (
    RESTING_SPEED,
    SlipWatch,
    could_be_either,
    scales_explain,
    scales_possible,
)
from raccoon.estimate.drive.taken import Reading, Step
from raccoon.estimate.drive.timing import beyond
from raccoon.estimate.drive.wheels import LONGEST_GAP
from raccoon.estimate.ekf.filter import DriveFilter, variance_index
from raccoon.estimate.ekf.generated import Flat
from raccoon.estimate.ekf.model import Array
from raccoon.estimate.ekf.state import OdometrySettings, State
from raccoon.model.drive import DriveGeometry, arc_end

KEPT_STEPS = 115
"""Of 17.5 ms, two seconds."""
DOUBTED = 1e4
"""(rad/s)^2, variance of a wheel that slips: it counts for nothing beside the others."""
LOST_HEADING = 0.4
"""rad, deviation after a gap beyond which nothing is known of the pose."""
LOST = 2.0
"""m and rad: anywhere on a table, facing anywhere."""
RELEARN = 0.05
"""Deviation that both scales get where they turn out wrong."""
WRONG_BLAME = 0.3
"""Deviation of the way while a wheel is not believed, of what the other choice would make it: one in ten such
choices is wrong, as where somebody turns the robot by hand or another robot pushes it."""
EITHER = 0.5
"""The same where it could be either wheel: the way lies in the middle, and each choice is so far from it."""
MOST_RELEARNT = 5
"""How often they get it: the truth is found in two or three."""


class Fusion:
    """Moves the filter on, step by step, and remembers how."""

    def __init__(self, drive: DriveFilter, settings: OdometrySettings) -> None:
        self.drive = drive
        self.geometry: DriveGeometry = drive.geometry
        self.slip, self._scales = SlipWatch(), ScaleDoubt(drive.flat)
        self.way = Way()
        self.distance = 0.0
        self.held = False
        """Whether the robot may have stood in the last step though its wheels turned."""
        self._settings = settings
        self._half_a_turn = 0.5 * self.geometry.track_width / self.geometry.wheel_radius
        self._travel = self._blamed = 0.0
        self._relearnt = 0
        self._steps: deque[Step] = deque(maxlen=KEPT_STEPS)

    def place(self, x: float, y: float, heading: float) -> None:
        """Take the pose to be known; forget how it came about."""
        self.drive.place(x, y, heading, 1e-4)
        self._steps.clear()
        self.distance = 0.0
        self.way = Way()

    def advance(self, reading: Reading, reasons: Reasons, repeated_gyro: bool) -> None:
        """Take a step. repeated_gyro: the gyro's last words were equal, which noise never gives for long."""
        before = self.drive.flat
        innovations = self._take(reading)
        self.held = reading.held > 0.0
        if len(reading.values) == 3 and not (reading.still or reading.mute):
            reading = self._judged(reading, before, innovations, reasons, repeated_gyro)
        self._keep_possible(before)
        doubt = self._scales.more(self.drive.flat)
        if doubt != NOTHING:
            self.drive.doubt_way(*doubt)
            reading = replace(reading, way=doubt)
        bridged = reading.now is not None
        if bridged:
            self.slip.start_again()
        if reading.still:
            self.slip.rest()
            self._hold_still()
        flat, span = self.drive.flat, reading.span
        self.distance += self._travel if bridged else flat[State.WAY] * flat[State.VELOCITY] * span
        way = self.way
        way.left += reading.values[0] * span
        way.right += reading.values[1] * span
        way.seconds += span
        self._steps.append(Step(reading, flat))

    def _judged(
        self, reading: Reading, before: Flat, innovations: Flat, reasons: Reasons, repeated_gyro: bool
    ) -> Reading:
        """The step as it stands after doubt: taken again without the wheel, or the gyro, that does not
        fit.
        """
        slip, time = self.slip, reading.time
        innovation, variance = innovations[4], innovations[5]
        if not slip.disagrees(innovation, variance):
            spins = slip.slipped or reading.slides
            if spins or slip.is_unsure(innovation, variance, reading.of_gyro):
                # The gyro tells the turn, and nothing is learnt of scales and delays.
                self.drive.flat = before
                half = innovation * self._half_a_turn
                doubt = DOUBTED if spins else half * half
                reading = replace(reading, swing=0.0, wobble=reading.wobble + doubt)
                self._take(reading)
            slip.calm(reading.span, max(map(abs, reading.values[:2])) > RESTING_SPEED)
            if slip.wheel is None:
                self._blamed = 0.0
            return reading
        self.drive.flat = before
        if repeated_gyro:
            reasons.tell("the gyro is frozen", time)
            reading = replace(
                reading, values=reading.values[:2], variances=reading.variances[:2], undated=0.0
            )
        elif slip.scales_are_wrong and self._relearnt < MOST_RELEARNT:
            reasons.tell("the wheels' scales do not fit the gyro", time, 1.0)
            slip.start_again()
            self._relearnt += 1
            reading = replace(reading, scales=RELEARN)
        else:
            reading = self._without_a_wheel(reading, innovation)
            if slip.wheel is not None:
                reasons.tell(f"the {slip.wheel} wheel slips", time)
        self._take(reading)
        return reading

    def _without_a_wheel(self, reading: Reading, innovation: float) -> Reading:
        flat, (left, right) = self.drive.flat, reading.values[:2]
        speeds = left - flat[State.LEFT_OFFSET], right - flat[State.RIGHT_OFFSET]
        turn = (reading.values[2] - flat[State.GYRO_BIAS]) / flat[State.GYRO_SCALE]
        scales = reading.held == 0.0 and scales_explain(2.0 * self._half_a_turn * turn, *speeds)
        blamed = self.slip.blame(reading.span, innovation, *speeds, scales)
        of_left, of_right, of_gyro = reading.variances
        either, before = could_be_either(innovation, *speeds), self._blamed
        share = EITHER if either else WRONG_BLAME
        self._blamed += share * self.geometry.track_width * abs(innovation) * reading.span
        held = reading.held + self._blamed**2 - before**2
        if either:
            return replace(reading, swing=0.0, wobble=reading.wobble + DOUBTED, held=held)
        if blamed == "left":
            return replace(reading, variances=(of_left + DOUBTED, of_right, of_gyro), held=held)
        return replace(reading, variances=(of_left, of_right + DOUBTED, of_gyro), held=held)

    def _take(self, reading: Reading) -> Flat:
        span, values, variances = reading.span, reading.values, reading.variances
        if reading.rest is not None:
            reading.rest.add_to(self.drive)
        if reading.scales > 0.0:
            self.drive.doubt_scales(reading.scales)
        if reading.now is not None:
            self._bridge(reading, reading.now)
            return ()
        if reading.slides:
            self.drive.widen_along(reading.held, reading.aside)
        found = self.drive.step(span, values, variances, reading.swing, reading.wobble)
        if reading.undated > 0.0:
            self.drive.widen((State.HEADING,), reading.undated)
        if reading.way != NOTHING:
            self.drive.doubt_way(*reading.way)
        return found

    def _bridge(self, reading: Reading, now: tuple[float, float]) -> None:
        """Move on by the counters over a time in which nobody looked."""
        flat, span, (left, right) = self.drive.flat, reading.span, reading.values
        speeds = now[0] - flat[State.LEFT_OFFSET], now[1] - flat[State.RIGHT_OFFSET]
        motion = self.geometry.body_motion(*speeds)
        angles, variances = (left * span, right * span), (reading.variances[0], reading.variances[1])
        self._travel = self.drive.bridge(span, angles, variances, reading.wobble, reading.together, motion)
        if span >= LONGEST_GAP or self.deviation(State.HEADING) > LOST_HEADING:
            # No straight line goes through so much doubt: what is learnt later would throw the pose about.
            x, y, heading = flat[: State.VELOCITY]
            self.drive.place(x, y, heading, LOST)
            self._travel = 0.0

    def _keep_possible(self, before: Flat) -> None:
        """No robot.toml is that wrong about scales: something else was taken for it."""
        if not scales_possible(*self.drive.flat[State.WAY : State.GYRO_SCALE]):
            self.drive.take_scales(before)

    def _hold_still(self) -> None:
        settings = self._settings
        self.drive.still(settings.standstill_velocity**2, settings.standstill_turn_rate**2)

    def doubt_way(self, way: float) -> None:
        """Add `way` m, along the heading, to what is not known of the place: to the last step, so that it
        stays where steps are taken again."""
        self.drive.widen_along(way * way)
        if self._steps:
            last = self._steps.pop()
            reading = replace(last.reading, held=last.reading.held + way * way)
            self._steps.append(replace(last, reading=reading, flat=self.drive.flat))

    def observe(self, seen: Seen, shift: Array, span: float, time: float | None) -> Observation:
        """Take something seen. shift: (3,) how far the robot is now beyond the pose of the last step, which
        was `span` s ago.

        time: when it was seen; None is now.
        """
        if time is None:
            return self._remembered(partial(self._observe_here, seen, shift))
        steps = list(self._steps)
        after = next((n for n, step in enumerate(steps) if step.time > time), len(steps))
        if after == 0:
            oldest = steps[0].time if steps else math.nan
            return Observation(False, math.nan, f"seen at {time} s: nothing is kept from before {oldest} s")
        here = steps[after - 1]
        now = self.drive.flat
        self.drive.flat = here.flat
        begin = self._beyond(here.flat, here.flat)
        if after < len(steps):
            end = steps[after]
            shift, span = self._beyond(end.flat, here.flat), end.reading.span
        share = (time - here.time) / span if span > 0.0 else 0.0
        shift = begin + share * (shift - begin)
        before, self._steps = self._steps, deque(steps[:after], maxlen=KEPT_STEPS)
        found = self._remembered(partial(self._observe_here, seen, shift))
        if not found.accepted:
            self.drive.flat, self._steps = now, before
            return found
        for step in steps[after:]:
            before_step = self.drive.flat
            self._take(step.reading)
            self._keep_possible(before_step)
            if step.reading.still:
                self._hold_still()
            for again in step.seen:
                again()
            self._steps.append(replace(step, flat=self.drive.flat))
        return found

    def _remembered(self, observe: Callable[[], Observation]) -> Observation:
        """Take something seen; where it is believed it belongs to the last step, which may be taken again."""
        found = observe()
        if found.accepted and self._steps:
            last = self._steps.pop()
            self._steps.append(replace(last, flat=self.drive.flat, seen=(*last.seen, observe)))
        return found

    def _beyond(self, there: Flat, here: Flat) -> Array:
        """How far the robot at a belief, by the delays of its readings too, is beyond the pose of another."""
        x, y, heading = there[: State.VELOCITY]
        pose = arc_end(x, y, heading, *beyond(there, self._settings.timing))
        moved: Array = np.array(pose) - np.array(here[: State.VELOCITY])
        return moved

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
        return self._remembered(partial(self._observe_way_here, replace(self.way), distance, std))

    def _observe_way_here(self, way: Way, distance: float, std: float) -> Observation:
        radius = self.geometry.wheel_radius
        slip = self._settings.slip_noise**2 * abs(distance)
        before = self.drive.flat
        found = self.drive.observe(
            np.array([distance]),
            lambda state: way.expected(state, radius),
            lambda state: way.jacobian(state, radius),
            np.array([[std**2 + slip]]),
        )
        return self._gated(before, found, GATES[1])

    def _gated(self, before: Flat, distance: float, gate: float) -> Observation:
        if distance <= gate:
            self._keep_possible(before)
            return Observation(True, distance)
        self.drive.flat = before
        return Observation(False, distance, f"{distance:.1f} standard deviations off: at most {gate:.1f}")

    def deviation(self, state: State) -> float:
        """Standard deviation of a state."""
        return math.sqrt(self.drive.flat[variance_index(state)])
