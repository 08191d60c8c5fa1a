"""Driving by time, as a team without sensors does: duties for measured times, tuned on the robot once."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from raccoon.cli.compare_mitigations.vehicles import Vehicle, simulated_vehicle
from raccoon.control.voltage import VoltageScaling
from raccoon.core.config import RobotConfig
from raccoon.sim.effects.parameters import Parameters

BRAKE_TIME_S = 0.25  # s with the motors shorted after each leg
MAX_LEG_S = 30.0  # s, bound on the duration of a leg
QUARTER_TURN = 0.5 * math.pi
TURN_DUTY = 0.5
TUNING_LEGS = (2.0, 5.0)  # s


@dataclass(frozen=True, slots=True)
class TimedDrive:
    """How a program without odometry drives.

    duty: of straight legs. trims: factors of the left and the right motor (static compensation). scaling: of
    the voltage, None for none. gyro: hold the heading on straight legs and turn by the gyro.
    """

    duty: float = 1.0
    trims: tuple[float, float] = (1.0, 1.0)
    scaling: VoltageScaling | None = None
    gyro: bool = False

    @property
    def blind(self) -> bool:
        """Whether the program reads no sensor while driving."""
        return self.scaling is None and not self.gyro

    def duties(
        self, left: float, right: float, correction: float, battery_voltage: float | None
    ) -> tuple[float, float]:
        """Duties of the left and the right motor after correction, trims and voltage scaling. correction:
        duty that turns the robot to the left. battery_voltage: V."""
        wanted = (left - correction) * self.trims[0], (right + correction) * self.trims[1]
        wanted = max(-1.0, min(1.0, wanted[0])), max(-1.0, min(1.0, wanted[1]))
        if self.scaling is None:
            return wanted
        return (
            self.scaling.scale_duty(wanted[0], battery_voltage).duty,
            self.scaling.scale_duty(wanted[1], battery_voltage).duty,
        )


@dataclass(frozen=True, slots=True)
class TunedTimes:
    """The result of tuning: times of straight legs, run_up + metre * |distance|, and the end of a turn.

    run_up: s. metre: s/m. turn: time of a quarter turn, s, or with the gyro, the angle before its end at
    which to stop, rad.
    """

    run_up: float
    metre: float
    turn: float


def leg(
    robot: Vehicle,
    way: TimedDrive,
    left: float,
    right: float,
    until: Callable[[float], bool],
    hold: float | None,
) -> None:
    """Drive with these duties (before trims and scaling) until a test of the elapsed time, s, is true, then
    brake. hold: heading to hold, rad, None for none."""
    begin = robot.time
    while not until(robot.time - begin) and robot.time - begin < MAX_LEG_S:
        correction = 0.0 if hold is None else max(-0.2, min(0.2, 2.0 * (hold - robot.heading)))
        robot.tick(*way.duties(left, right, correction, robot.battery_voltage))
    robot.stand(BRAKE_TIME_S)


def straight_leg(robot: Vehicle, way: TimedDrive, tuned: TunedTimes, distance: float, heading: float) -> None:
    """Drive straight by time. distance: m. heading: to hold if there is a gyro, rad."""
    seconds = tuned.run_up + tuned.metre * distance
    leg(robot, way, way.duty, way.duty, after(seconds), heading if way.gyro else None)


def quarter_turn(robot: Vehicle, way: TimedDrive, tuned: TunedTimes, heading: float = QUARTER_TURN) -> None:
    """Turn left by time, or with the gyro, to `heading`, rad."""

    def there(_seconds: float) -> bool:
        return robot.heading >= heading - tuned.turn

    leg(robot, way, -TURN_DUTY, TURN_DUTY, there if way.gyro else after(tuned.turn), None)


def after(limit: float) -> Callable[[float], bool]:
    """A test that is true from `limit` seconds on."""
    return lambda seconds: seconds >= limit


def tune(
    way: TimedDrive, parameters: Parameters, config: RobotConfig, tape: tuple[float, float]
) -> TunedTimes:
    """The times that drive distances and quarter turns on this robot, as a patient team finds them by tape.

    tape: errors of the two taped distances, m. The quarter turn is found without error.
    """
    points = []
    for seconds, error in zip(TUNING_LEGS, tape, strict=True):
        robot = simulated_vehicle(parameters, config, 1, blind=way.blind, noise=False)
        robot.stand(0.2, learn=True)
        leg(robot, way, way.duty, way.duty, after(seconds), 0.0 if way.gyro else None)
        truth = robot.truth
        points.append((math.hypot(truth.x, truth.y) + error, seconds))
    (near, early), (far, late) = points
    metre = (late - early) / max(far - near, 1e-3)
    return TunedTimes(early - metre * near, metre, _turn_end(way, parameters, config))


def _turn_end(way: TimedDrive, parameters: Parameters, config: RobotConfig) -> float:
    end = 0.1 if way.gyro else 0.8
    for _ in range(3):
        robot = simulated_vehicle(parameters, config, 1, blind=way.blind, noise=False)
        robot.stand(0.2, learn=True)
        quarter_turn(robot, way, TunedTimes(0.0, 0.0, end))
        turned = robot.truth.heading
        end = end - (QUARTER_TURN - turned) if way.gyro else end * QUARTER_TURN / max(turned, 0.1)
    return end


def matched_trims(parameters: Parameters, config: RobotConfig) -> tuple[float, float]:
    """The trims of static compensation, left and right: the faster motor is slowed by the ratio that straight
    drives of this robot show."""
    trims = (1.0, 1.0)
    for _ in range(3):
        robot = simulated_vehicle(parameters, config, 1, blind=True, noise=False)
        leg(robot, TimedDrive(0.8, trims=trims), 0.8, 0.8, after(3.0), None)
        truth = robot.truth
        track = config.model.drive.track_width.value
        ratio = 1.0 + truth.heading * track / max(math.hypot(truth.x, truth.y), 0.1)
        left, right = trims[0], trims[1] / ratio  # a turn to the left: the right motor is faster
        trims = left / max(left, right), right / max(left, right)
    return trims
