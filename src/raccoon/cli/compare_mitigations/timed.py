"""Driving by time, as a team without sensors does: duties for so many seconds, tuned on the robot once."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from raccoon.control.voltage import VoltageScaling
from raccoon.core.config import RobotConfig
from raccoon.core.readings import Inputs, Outputs, Truth
from raccoon.sim.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.sim.world import World

STOPPING = 0.25  # s with the motors shorted after each leg
LONGEST = 30.0  # s of a leg, whatever happens


@dataclass(frozen=True, slots=True)
class TimedDrive:
    """How a program without odometry drives.

    duty: of straight legs; turns take `turn_duty`. trims: factors of the left and of the right motor (static
    compensation). scaling: of the voltage, None without. gyro: hold the heading on straight legs, and turn by
    it.
    """

    duty: float = 1.0
    turn_duty: float = 0.5
    trims: tuple[float, float] = (1.0, 1.0)
    scaling: VoltageScaling | None = None
    gyro: bool = False


class TimedRobot:
    """A simulated robot that a timed program drives; no estimators in between."""

    def __init__(self, parameters: Parameters, config: RobotConfig, seed: int, noise: bool = True) -> None:
        self._port = SimPort(parameters, World.empty(), robot=config, seed=seed, noise=noise)
        self.inputs: Inputs = self._port.read()
        self.heading = 0.0
        self._bias = 0.0

    @property
    def truth(self) -> Truth:
        assert self.inputs.truth is not None
        return self.inputs.truth

    def stand(self, seconds: float, learn: bool = False) -> None:
        """Motors shorted; learn: the gyro's bias."""
        rates = []
        for _ in range(round(seconds * 200.0)):
            self._tick(0.0, 0.0)
            rates.append(self.inputs.turn_rate or 0.0)
        if learn and rates:
            self._bias = sum(rates) / len(rates)
            self.heading = 0.0

    def leg(
        self, way: TimedDrive, left: float, right: float, until: Callable[[float], bool], hold: float | None
    ) -> None:
        """Duties (before trims and scaling) until a test of the seconds holds, then stand."""
        begin = self.inputs.time
        while not until(self.inputs.time - begin) and self.inputs.time - begin < LONGEST:
            correction = 0.0 if hold is None else max(-0.2, min(0.2, 2.0 * (hold - self.heading)))
            self._tick(
                self._scaled(way, (left - correction) * way.trims[0]),
                self._scaled(way, (right + correction) * way.trims[1]),
            )
        self.stand(STOPPING)

    def _scaled(self, way: TimedDrive, duty: float) -> float:
        duty = max(-1.0, min(1.0, duty))
        return duty if way.scaling is None else way.scaling.scaled(duty, self.inputs.battery_voltage).duty

    def _tick(self, left: float, right: float) -> None:
        self._port.write(Outputs(duty=(left, right, 0.0, 0.0), brake=(True, True, False, False)))
        before = self.inputs.time
        self.inputs = self._port.read()
        self.heading += ((self.inputs.turn_rate or 0.0) - self._bias) * (self.inputs.time - before)


@dataclass(frozen=True, slots=True)
class Tuned:
    """What tuning found: s for a metre and s of run-up (t = run_up + metre * |distance|); the turn's end.

    turn: s for a quarter turn, or rad before it at which to stop where the gyro turns.
    """

    run_up: float
    metre: float
    turn: float


def tune(way: TimedDrive, parameters: Parameters, config: RobotConfig) -> Tuned:
    """Times that drive true distances and quarter turns on this robot: what a patient team finds by tape."""
    points = []
    for seconds in (2.0, 5.0):
        robot = TimedRobot(parameters, config, 1, noise=False)
        robot.stand(0.2, learn=True)
        robot.leg(way, way.duty, way.duty, _after(seconds), 0.0 if way.gyro else None)
        points.append((math.hypot(robot.truth.x, robot.truth.y), seconds))
    (near, early), (far, late) = points
    metre = (late - early) / max(far - near, 1e-3)
    return Tuned(early - metre * near, metre, _turn_end(way, parameters, config))


def _turn_end(way: TimedDrive, parameters: Parameters, config: RobotConfig) -> float:
    end = 0.1 if way.gyro else 0.8
    for _ in range(3):
        robot = TimedRobot(parameters, config, 1, noise=False)
        robot.stand(0.2, learn=True)
        quarter_turn(robot, way, Tuned(0.0, 0.0, end))
        missing = 0.5 * math.pi - robot.truth.heading
        end = end - missing if way.gyro else end * 0.5 * math.pi / max(robot.truth.heading, 0.1)
    return end


def straight_leg(robot: TimedRobot, way: TimedDrive, tuned: Tuned, distance: float, heading: float) -> None:
    """Straight by time."""
    seconds = tuned.run_up + tuned.metre * distance
    robot.leg(way, way.duty, way.duty, _after(seconds), heading if way.gyro else None)


def quarter_turn(robot: TimedRobot, way: TimedDrive, tuned: Tuned, heading: float = 0.5 * math.pi) -> None:
    """To the left, by time, or to the gyro's `heading`."""

    def there(_seconds: float) -> bool:
        return robot.heading >= heading - tuned.turn

    robot.leg(way, -way.turn_duty, way.turn_duty, there if way.gyro else _after(tuned.turn), None)


def _after(limit: float) -> Callable[[float], bool]:
    return lambda seconds: seconds >= limit
