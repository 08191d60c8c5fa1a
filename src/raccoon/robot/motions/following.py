"""Following a line with one tophat, and finding it again where the robot slid off or the light changed."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING, Literal

from raccoon.control.motion import slewed
from raccoon.core.errors import MotionTimeout
from raccoon.robot.actions.actions import Action, Steps
from raccoon.robot.actions.limits import check_name, check_pace
from raccoon.robot.motions.last_edge import LOST_TIME, LOST_WAY, LastEdge
from raccoon.robot.motions.lines import tophat_ahead
from raccoon.robot.motions.pacing import STALL_PATIENCE, at_rest, check_wiring, reason
from raccoon.robot.motions.steering import Steering
from raccoon.robot.remarks import say

if TYPE_CHECKING:
    from raccoon.robot.parts.tophats import TophatSensor
    from raccoon.robot.robot import Robot

SEARCH_ANGLE = math.radians(90.0)
"""rad to either side of the line's direction in which it is looked for, of the sensor about the axis' middle:
one that sits aside would look less far to its other side by what the robot turns."""
SEARCH_SPEED, SEARCH_TIME = 0.08, 12.0
"""m/s of the sensor meanwhile, and s that it takes at the most."""
SIGHT_TIME = 1.0
"""s until a loose plug that moves no more, or a controller that restarts, is read again, or is not."""
BACK_SPEED = 0.1
"""m/s at which the robot goes back to where the line was."""
CATCH_SPEED = 0.03
"""m/s until it keeps to an edge that it found: that may lie across, and is as wide as the sensor's spot."""
PROBE, PROBE_RATE, PROBE_TIME, ANSWER = 0.003, 0.4, 0.4, 0.15
"""m by which the sensor is moved to see whether it is on an edge, rad/s, s at the most, and by how much less
of it must then be on black: half of what an edge gives."""
ON_BLACK = 0.98
"""Share of the sensor's spot that is all of it, but for noise."""
HALF_ON = 0.35
"""Off from half of the spot on black, at the most, of a tophat that somebody put on an edge."""
NEAR = 1e-3
"""m that is as good as there."""
MOST_SEARCHES = 2
"""How often a line is looked for at a place: one that ends would be found for ever."""
INTO_LIGHT, ASIDE = 0.03, 0.03
"""m that the robot drives on into another light, and that its sensor then turns to both sides of the edge."""
LIGHT_SPEED, LIGHT_GAIN = 0.1, 3.0
"""m/s at the most and rad/s a rad off the line's direction on that way."""
SURFACE_READINGS = 4
"""in a row, whose mean is what a surface reads."""


def follow_line(
    tophat: str, side: Literal["left", "right"] = "left", speed: float | None = None
) -> Action[None]:
    """Keep one tophat on an edge of a black line, until ended from outside (`.until`, `race`).

    side: the edge of the line it keeps to, "left" or "right". speed: m/s; `motion.speed` when None. The
    share of the sensor's spot that is on black steers, and tells the line's bends. Lines that cross are
    gone over. After 1 s or 0.15 m without an edge (0.5 s where there was none yet) the robot stops, goes
    back to where it was on one and looks for the line there on the spot, the sensor 90 degrees to either
    side; where the light changes, it does so to learn what floor and line read there. What reads the same
    for 5 cm, and not half an edge, is moved by up to 3 mm to see whether it is one. Raises CalibrationError
    without a calibration, ConfigError for a sensor that is not ahead of the axis, MotionTimeout where it
    finds no line.
    """
    check_name(tophat=tophat)
    check_pace(speed=speed)
    if side not in ("left", "right"):
        raise ValueError(f"side is {side!r}: allowed are 'left' and 'right'")
    sign = 1.0 if side == "left" else -1.0
    label = f"follow the {side} edge with {tophat}"

    def steps(robot: Robot) -> Steps[None]:
        sensor = robot.tophat(tophat)
        sensor.require()
        motion = robot.config.motion
        wanted = motion.speed if speed is None else speed
        top, acceleration = robot.drive.speeds.planned(wanted, motion.acceleration)
        steering = Steering(robot, sensor.config.forward, sign)
        line = LastEdge(robot, _other_on_edge(robot, sensor))
        velocity, limit, miswired = robot.estimate.velocity, top, 0.0
        sensor.follow_light(False)
        try:
            while True:
                # Who sees nothing goes straight on, and is on no edge.
                coverage = sensor.coverage if sensor.sees and sensor.coverage is not None else 0.5
                if sensor.sees and line.see(coverage) and line.kept:
                    limit = top
                turn_rate = steering.turn_rate(coverage, velocity)
                answers = True
                if line.doubtful:
                    answers = yield from _answers(robot, sensor, sign, velocity, turn_rate)
                    line.believe(answers)
                if robot.paused:  # the motors may have been stopped meanwhile
                    velocity = robot.estimate.velocity
                miswired = check_wiring(robot, miswired, label)
                other_light = sensor.other_light or not answers
                if (line.lost and not steering.crosses) or other_light:
                    if line.searches() > MOST_SEARCHES:
                        raise MotionTimeout(_lost(robot, sensor))
                    search = _Search(robot, sensor, sign, line, velocity)
                    yield from search.in_other_light() if other_light else search.beside()
                    line.found()
                    velocity, limit = 0.0, min(top, CATCH_SPEED)
                    steering.restart()
                    continue
                velocity = slewed(velocity, steering.limit(coverage, limit), acceleration * robot.dt)
                robot.drive.follow(velocity, turn_rate)
                yield
        finally:
            sensor.follow_light(True)
            robot.drive.stop()
            robot.replan()

    return Action(label, steps, lambda robot: tophat_ahead(robot, tophat))


def _other_on_edge(robot: Robot, sensor: TophatSensor) -> str:
    """The tophat that is on an edge where `sensor` is not, "" for none. A robot is put down with the one that
    is to follow on the edge, so that is what exchanged plugs read."""
    on = [
        each for each in robot.tophats.values() if each.sees and abs((each.coverage or 0.0) - 0.5) < HALF_ON
    ]
    return "" if sensor in on or not on else on[0].name


def _answers(
    robot: Robot, sensor: TophatSensor, side: float, velocity: float, turn_rate: float
) -> Steps[bool]:
    """Whether the sensor is on an edge: it is moved a little to where an edge would read nearer to half, and
    no further than it takes to see that.

    turn_rate: rad/s by which it follows. What reads the same then is a surface in other light.
    """
    begin, heading, before = robot.time, robot.estimate.heading, sensor.coverage or 0.0
    way = side if before > 0.5 else -side
    while robot.time - begin < PROBE_TIME:
        further = robot.estimate.heading - heading - turn_rate * (robot.time - begin)
        if way * further * sensor.config.forward > PROBE:
            break
        robot.drive.follow(velocity, turn_rate + way * PROBE_RATE)
        yield
        if way * side * (before - (sensor.coverage or 0.0)) > ANSWER:
            return True
    return False


class _Search:
    """Looks for an edge of a line by turning on the spot, and takes down what both surfaces read meanwhile.

    side: 1 for the left edge of the line, -1 for the right one. velocity: m/s that the robot comes with.
    """

    def __init__(
        self, robot: Robot, sensor: TophatSensor, side: float, line: LastEdge, velocity: float
    ) -> None:
        self._robot, self._sensor, self._line = robot, sensor, line
        self._side, self._heading, self._velocity = side, line.heading, velocity
        self._end = robot.time + SEARCH_TIME
        self._last: deque[float] = deque(maxlen=SURFACE_READINGS)
        self._white, self._black = math.inf, -math.inf

    def beside(self) -> Steps[None]:
        """On both sides of where it was last. Ends on the edge, or on the line from beyond it."""
        name, other = self._sensor.name, self._line.other
        say(self._robot, f"{name} lost the line and looks for it")
        if self._line.pointing is None and other:
            say(self._robot, f"{name} came to no edge, {other} began on one: are their plugs exchanged?")
        yield from self._stop()
        yield from self._see()
        yield from self._back()
        # Black is on the right of the left edge: a sensor on it has gone too far right.
        first = self._side if self._line.to_black else -self._side
        for way in (first, -first):
            if (yield from self._turn(way)) or self._sensor.black:
                return
        yield from self._learn_and_return(first)

    def in_other_light(self) -> Steps[None]:
        """Drive on into it, turn over both surfaces there, the floor first, and back to the edge."""
        robot, sensor = self._robot, self._sensor
        say(robot, f"{sensor.name} comes into another light on the line, and learns it")
        begin, acceleration = robot.estimate.distance, robot.config.motion.acceleration
        speed = max(min(self._velocity, LIGHT_SPEED), CATCH_SPEED)  # after a search, or at first, it stands
        while robot.estimate.distance - begin < INTO_LIGHT and robot.time < self._end:
            self._velocity = slewed(self._velocity, speed, acceleration * robot.dt)
            robot.drive.follow(self._velocity, LIGHT_GAIN * (self._heading - robot.estimate.heading))
            yield
        yield from self._stop()
        aside = ASIDE / sensor.config.forward
        yield from self._turn(self._side, aside, to_edge=False)
        yield from self._turn(-self._side, aside, to_edge=False)
        if not sensor.relearn(self._white, self._black):
            yield from self._turn(-self._side, to_edge=False)
        yield from self._learn_and_return(self._side)

    def _learn_and_return(self, way: float) -> Steps[None]:
        learnt = self._sensor.relearn(self._white, self._black)
        if not learnt or not (yield from self._turn(way)):
            raise MotionTimeout(_lost(self._robot, self._sensor))

    def _stop(self) -> Steps[None]:
        robot = self._robot
        while not at_rest(robot) and robot.time < self._end:
            self._velocity = slewed(self._velocity, 0.0, robot.config.motion.acceleration * robot.dt)
            robot.drive.follow(self._velocity)
            yield

    def _see(self) -> Steps[None]:
        """Stand until the sensor sees a floor: without it no line is found."""
        robot, sensor, begin = self._robot, self._sensor, self._robot.time
        while not sensor.sees:
            if robot.time - begin > SIGHT_TIME:
                raise MotionTimeout(f"{sensor.name} lost the line and sees no floor; {reason(robot, sensor)}")
            robot.drive.follow(0.0)
            yield

    def _back(self) -> Steps[None]:
        """Backwards along the arc that it came, to where it was on an edge the last time, or to black before:
        a line that turned off is beside that place, and not beside where it was missed.
        """
        robot, line, acceleration = self._robot, self._line, self._robot.config.motion.acceleration
        if line.pointing is None:
            return
        bend = robot.estimate.heading - line.pointing
        way, silent = robot.estimate.distance - line.place, 0.0
        while (left := robot.estimate.distance - line.place) > NEAR and not self._sensor.black:
            silent = silent + robot.dt if robot.drive.wheels.stalled else 0.0
            if silent > STALL_PATIENCE or robot.time > self._end:
                raise MotionTimeout(_lost(robot, self._sensor))
            speed = min(BACK_SPEED, math.sqrt(acceleration * left))
            self._velocity = slewed(self._velocity, -speed, acceleration * robot.dt)
            off = line.pointing + bend * left / way - robot.estimate.heading
            robot.drive.follow(self._velocity, self._velocity * bend / way + LIGHT_GAIN * off)
            yield
        yield from self._stop()

    def _turn(self, way: float, angle: float = math.inf, *, to_edge: bool = True) -> Steps[bool]:
        """Turn until `angle` rad beside the line's direction, at the most as far as a line is looked for, or
        to its edge; whether it came to that.

        way: 1 to the left, -1 to the right.
        """
        robot, sensor, motion = self._robot, self._sensor, self._robot.config.motion
        angle = min(angle, SEARCH_ANGLE - way * math.atan2(sensor.config.left, sensor.config.forward))
        wanted = min(motion.turn_rate, SEARCH_SPEED / sensor.config.forward)
        top, acceleration = robot.drive.speeds.planned_turn(wanted, motion.turn_acceleration)
        rate = silent = 0.0
        wanted_to_black = way * self._side < 0.0
        across = wanted_to_black  # who comes from the border of black may leave it there: by another edge
        sensor.forget_edge()
        while way * (robot.estimate.heading - self._heading) < angle:
            self._read()
            # To the left of the left edge and to the right of the right one is white.
            edge = sensor.edge
            if to_edge and across and edge is not None and edge.to_black is wanted_to_black:
                return True
            if not across and (sensor.coverage or 0.0) > ON_BLACK:
                across = True
                sensor.forget_edge()
            wrong = robot.drive.wheels.stalled or robot.odometry.wiring.suspects
            silent = silent + robot.dt if wrong else 0.0
            if silent > STALL_PATIENCE or robot.time > self._end:
                raise MotionTimeout(_lost(robot, sensor))
            if robot.paused:
                rate = robot.estimate.turn_rate
            rate = slewed(rate, way * top, acceleration * robot.dt)
            robot.drive.follow(0.0, rate)
            yield
        return False

    def _read(self) -> None:
        """Keep the lowest and the highest mean: what floor and line read."""
        last, counts = self._last, self._sensor.counts
        if counts is not None and self._sensor.sees:
            last.append(counts)
        if len(last) == SURFACE_READINGS:
            mean = sum(last) / SURFACE_READINGS
            self._white, self._black = min(self._white, mean), max(self._black, mean)


def _lost(robot: Robot, sensor: TophatSensor) -> str:
    return (
        f"{sensor.name} lost the line: no edge for {LOST_TIME:g} s or {LOST_WAY:g} m, and none found "
        f"{math.degrees(SEARCH_ANGLE):.0f} degrees to either side; {reason(robot, sensor)}"
    )
