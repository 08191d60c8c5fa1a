"""Common parts of all motions: following a profile in time, limits, the end of a motion and its result."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from raccoon.control.profile import Profile, ProfileState
from raccoon.control.stages import StagedProfile
from raccoon.core.errors import MotionTimeout
from raccoon.model.pose import Pose
from raccoon.robot.remarks import add_remark, describe_miswiring, remark_oddities, scale_mismatch

if TYPE_CHECKING:
    from raccoon.robot.parts.tophats import TophatSensor
    from raccoon.robot.robot import Robot

# The profile waits for a robot that falls this far behind it, instead of running away.
LAG_LIMIT = 0.02
LAG_LIMIT_TURN = 0.15
# Fast enough to end on the mark, slow enough that the wheels stop within a tick or two.
REST_SPEED = 0.02
REST_RATE = 0.12
# s that a wheel may be driven without turning before the motion gives up.
STALL_PATIENCE_S = 0.4
# s that the profile waits for a robot that stays where it is, such as one that spins a wheel at a wall and
# would have to turn; and which part of what it may be behind is away from there (also backwards, where it was
# pushed: it comes again).
HELD_PATIENCE_S, MOVED_SHARE = 2.0, 0.25

CLOSING_IN_S, TOLERANCE_GROWTH_S, MAX_TOLERANCE_FACTOR = 1.0, 0.25, 4.0
"""s after its profile in which a motion keeps to the default tolerance; s in which the tolerance then grows
by its own size; and its largest factor."""

RESET_HINT = (
    "the odometry was reset on the way: do so between two motions, or use robot.odometry.observe_pose"
)
SLOWER_SHARE = 0.95
"""Share of the requested speed below which the lower planned speed is reported."""


@dataclass(frozen=True, slots=True)
class MotionResult:
    """Where a motion ended relative to its goal.

    along, across: m beyond the goal and left of the path. heading: rad left of the goal's heading. duration:
    s. std: m, of the position by the odometry (larger if the wheels turn out to be off their calibration).
    heading_std: rad. saturated: whether the battery could not give the needed voltage. missing_speed: m/s
    that a saturated wheel lacked at the worst moment. planned: share of the requested speed that the weakest
    battery of the match allows (1: all; above 1: a slower motion would not have been counted completely).
    remarks: in words, doubts of the odometry on the way and motors that differ from robot.toml. held: m of
    the way that the robot may not have driven, because both wheels carried the torque of tyres that spin at a
    wall; it may stand this far before its goal.
    """

    along: float
    across: float
    heading: float
    duration: float
    std: float
    saturated: bool
    heading_std: float = 0.0
    missing_speed: float = 0.0
    planned: float = 1.0
    remarks: tuple[str, ...] = ()
    held: float = 0.0

    @property
    def arrived(self) -> bool:
        """Whether nothing held the robot on its way. False if its wheels turned as far as the goal, but it
        may stand at a wall or has pushed something nearly as heavy."""
        return self.held == 0.0

    def __str__(self) -> str:
        """The errors in mm and degrees, and the remarks, as text."""
        wall = () if self.arrived else (f"may stand {self.held:.3f} m before its goal",)
        along, across, std = 1e3 * self.along, 1e3 * self.across, 1e3 * self.std
        share = f"planned at {100 * self.planned:.0f} % of the wished speed"
        slow = () if self.planned > SLOWER_SHARE else (share,)
        off = f"{along:+z.1f} mm along, {across:+z.1f} mm across (+- {std:.1f})"
        turned = f"{math.degrees(self.heading):+z.2f} deg, in {self.duration:.2f} s"
        return "; ".join((f"{off}, {turned}", *slow, *wall, *self.remarks))


class HeldWay:
    """Sums the part of a motion's way that a wall may have kept the robot from driving."""

    def __init__(self, robot: Robot) -> None:
        self.metres = 0.0
        self._robot = robot
        self._last_held = robot.odometry.held_way  # of the motion before, which may have ended at a wall

    def update(self) -> None:
        """Take a cycle."""
        held = self._robot.odometry.held_way
        self.metres += max(0.0, held - self._last_held)
        self._last_held = held

    def remark(self, what: str, seen: str = "") -> float:
        """Add a remark that the motion `what`, which came to its goal, may have ended before it; returns by
        how many m. seen: how the program can see that."""
        if self.metres > 0.0:
            add_remark(
                self._robot,
                f"{what} may have ended {self.metres:.3f} m before its goal: the wheels turned, but with "
                f"as much load as when tyres spin at a wall{seen}",
            )
        return self.metres


def wall_hint(held: float, who: str = "the robot") -> str:
    """The addition to the error of a drive that a wall may have held for so many m; "" for 0."""
    return "" if held == 0.0 else f"; {who} may have stood at a wall for {held:.2f} m of it"


class Pace:
    """Follows a profile in time, and waits for a robot that cannot keep up.

    lag_limit: how far the robot may be behind (m or rad). timeout: s until it gives up, which it also does if
    the robot does not move; None: twice the profile and 2 s. planned: see MotionResult. what: the motion, for
    messages; a "turn" is in rad. radius: m of the profile per rad of the requested angle, if there is one (of
    a turn 1).
    """

    def __init__(
        self,
        robot: Robot,
        profile: Profile | StagedProfile,
        lag_limit: float,
        timeout: float | None = None,
        planned: float = 1.0,
        what: str = "straight",
        radius: float | None = None,
    ) -> None:
        self._robot = robot
        self.what = what
        self.profile = profile
        self.planned = planned
        self._radius = radius
        self._lag_limit = lag_limit
        self._timeout = 2.0 * profile.duration + 2.0 if timeout is None else timeout
        self._current_profile, self._profile_start = profile, 0.0  # what it walks now, and where that began
        self._profile_time = 0.0
        self._stalled_seconds = self._waited_seconds = 0.0
        self._waiting_place = 0.0
        self.begin = robot.time
        self._start_distance = robot.estimate.distance
        self.saturated = False
        self.missing_speed = 0.0
        self.held_way = HeldWay(robot)
        self.doubts: dict[str, None] = {}
        """The odometry's doubts on the way, each once, in order."""
        self.finished = False
        """True once the profile has ended; the robot may still be closing in."""

    def states(self, progress: Callable[[], float], place: Callable[[float], Pose]) -> Iterator[ProfileState]:
        """One state of the profile a tick. Raises MotionTimeout if it takes too long or a wheel does not
        turn. progress: how far the robot is. place: the pose on the path for a progress; a motion that is
        ended early was meant to end where it is."""
        robot, profile, resets = self._robot, self.profile, self._robot.odometry.resets
        sign = -1.0 if profile.distance < 0.0 else 1.0
        last = robot.time
        try:
            while True:
                state = self._state_at(self._profile_time)
                yield state
                self._take_cycle()
                if robot.odometry.resets != resets:
                    raise RuntimeError(f"{self.what}: {RESET_HINT}")
                passed, here = robot.time - last, progress()
                behind = sign * (self._state_at(self._profile_time + passed).position - here)
                if robot.paused and behind > self._lag_limit:
                    # The motors were stopped meanwhile: it speeds up anew, and makes up for nothing.
                    self._current_profile = profile.over(profile.distance - here)
                    self._profile_start, self._profile_time = here, 0.0
                # A robot that is ahead is not waited for: the profile has to end for it to come back.
                elif sign * (state.position - here) < self._lag_limit:
                    # The whole of it also after a pause: the motors went on with their last command.
                    self._profile_time += passed
                else:
                    self._wait(passed, here)
                last = robot.time
                self.finished = self._profile_time >= self._current_profile.duration
                if robot.time - self.begin > self._timeout or self._should_give_up:
                    raise MotionTimeout(self._describe_timeout(progress()))
        finally:
            robot.drive.stop()
            if robot.odometry.resets == resets:
                robot.plan = place(progress())

    def _wait(self, passed: float, progress: float) -> None:
        """Count `passed` s behind the profile since the robot last moved."""
        self._waited_seconds += passed
        if abs(progress - self._waiting_place) > MOVED_SHARE * self._lag_limit:
            self._waiting_place, self._waited_seconds = progress, 0.0

    @property
    def _should_give_up(self) -> bool:
        return self._stalled_seconds > STALL_PATIENCE_S or self._waited_seconds > HELD_PATIENCE_S

    def may_end(self, off: float, tolerance: float | None) -> bool:
        """Whether the robot rests near enough to its goal, which is `off` m (turn: rad) away.

        tolerance: the program's, which stays. None: robot.toml's, which grows up to MAX_TOLERANCE_FACTOR
        times if the robot does not get there: friction yields in steps, one of which may lead from one side
        of the goal to the other for ever.
        """
        if not (self.finished and is_at_rest(self._robot)):
            return False
        if tolerance is not None:
            return abs(off) <= tolerance
        motion = self._robot.config.motion
        usual = motion.heading_tolerance if self.what == "turn" else motion.distance_tolerance
        late = self._profile_time - self._current_profile.duration - CLOSING_IN_S
        return abs(off) <= usual * max(1.0, min(1.0 + late / TOLERANCE_GROWTH_S, MAX_TOLERANCE_FACTOR))

    def _state_at(self, time: float) -> ProfileState:
        """The state of the motion `time` s after its current profile began."""
        state = self._current_profile.at(time)
        return ProfileState(self._profile_start + state.position, state.velocity, state.acceleration)

    @property
    def doubt(self) -> float:
        """m by which the way is uncertain because the wheels are off their calibration."""
        return 0.5 * scale_mismatch(self._robot) * (self._robot.estimate.distance - self._start_distance)

    def _take_cycle(self) -> None:
        wheels, robot = self._robot.drive.wheels, self._robot
        self.saturated = self.saturated or wheels.saturated
        self.missing_speed = max(self.missing_speed, robot.drive.missing_speed)
        if robot.estimate.reasons:
            self.doubts.update(dict.fromkeys(robot.estimate.reasons))
        self.held_way.update()
        lost = wheels.stalled or robot.odometry.wiring.suspects
        # Recorded readings say nothing of wheels under other commands.
        self._stalled_seconds = self._stalled_seconds + robot.dt if lost and robot.drive.followed else 0.0

    def _describe_timeout(self, progress: float) -> str:
        seconds = self._robot.time - self.begin
        way = f"{progress:.3f} of {self.profile.distance:.3f} m"
        if (radius := self._radius) is not None:
            turned, asked = math.degrees(progress / radius), math.degrees(self.profile.distance / radius)
            way = f"{turned:.1f} of {asked:.1f} deg"
        why = describe_obstacle(self._robot)
        passed = ", ".join(each for each in self.doubts if each not in why)
        on_the_way = f"; on the way: {passed}" if passed else ""
        return f"{self.what} not done after {seconds:.1f} s: {way}; {why}{on_the_way}"


def describe_obstacle(robot: Robot, *asked: TophatSensor) -> str:
    """Why a motion may not have come to its end: stalled, saturated, slipping, the odometry's reasons, and
    what is wrong with tophats that see nothing or are `asked` about."""
    wiring = describe_miswiring(robot)
    if robot.odometry.wiring.turned:  # the rest follows from it
        return wiring
    said = [wiring or robot.drive.describe_state(), *robot.estimate.reasons, *remark_oddities(robot)]
    said.extend(each.complaint for each in robot.tophats.values() if each.blind or each in asked)
    return "; ".join(filter(None, said))


def check_wiring(robot: Robot, lasted: float, name: str) -> float:
    """s for which the gyro has shown motors to be plugged in other than robot.toml says.

    lasted: the result of the previous tick. Raises MotionTimeout, naming the motion, once it has been sure
    for as long as a wheel may stand: under control such a robot spins faster and faster.
    """
    if not robot.odometry.wiring.turned:
        return 0.0
    if lasted > STALL_PATIENCE_S:
        raise MotionTimeout(f"{name}: {describe_miswiring(robot)}")
    return lasted + robot.dt


def finish_motion(robot: Robot, goal: Pose, pace: Pace) -> MotionResult:
    """Stop, make `goal` the start of the next motion, and return where the robot is relative to it."""
    robot.drive.stop()
    robot.plan = goal
    here = robot.estimate
    along, across = goal.offset_of(here.x, here.y)
    held = pace.held_way.remark(pace.what, " (result.arrived is False)")
    return MotionResult(
        along,
        across,
        here.heading - goal.heading,
        robot.time - pace.begin,
        max(math.hypot(here.x_std, here.y_std), abs(pace.doubt)),
        pace.saturated,
        here.heading_std,
        pace.missing_speed,
        pace.planned,
        (*pace.doubts, *remark_oddities(robot)),
        held,
    )


def is_at_rest(robot: Robot) -> bool:
    """Whether the robot is so slow that it would stop here."""
    return abs(robot.estimate.velocity) < REST_SPEED and abs(robot.estimate.turn_rate) < REST_RATE
