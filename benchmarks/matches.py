"""Whole matches of 120 s by robots that share no code with the package.

    python benchmarks/matches.py [--trials 20] [--walls 30] [--lines 24] [--seed 0] [--show]

Every trial draws a robot of tests/blind/table.py: two of the paper's three motors, a battery of 6.2 to 7.0
V, back-EMF offsets, wheels that are not round, a track and a gyro's scale that nobody measured, 1.8 to 3.2
kg, noisy tophats a millimetre beside their place, a patch of the floor with a third of the grip. It is
calibrated by a taped metre (to 1 mm) and by a drive over floor and lines, and put down by hand (3 mm, 1
degree). Then it waits for the light, aligns at a line, follows another around a bend to a crossing one,
pushes an object, squares up to a wall, drives an arc and two rounds of a path over the slippery patch,
squares up to the wall behind it, and goes on until the clock ends it. Errors are those of the true robot
against the pose that it believes.

Before that as many robots as --walls says square up to a wall 21 cm away, from 4 degrees askew (one standard
deviation), at three speeds, as put together and never calibrated. As many as --lines says follow the lines of
match_lines.py, with one tophat and with two.
"""

from __future__ import annotations

import argparse
import logging
import math
import sys
import time
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from raccoon import (
    Robot,
    after_distance,
    align_on_line,
    align_on_wall,
    arc,
    calibrate_drive,
    calibrate_tophats,
    deg,
    drive,
    drive_to,
    follow_line,
    follow_path,
    on_black,
    open_robot,
    parallel,
    repeat,
    run_match,
    seq,
    servo,
    straight,
    turn_to,
    wait,
    wait_for_light,
)
from raccoon.core.config import RobotConfig
from raccoon.core.errors import RaccoonError
from raccoon.core.sections import ServoConfig, TophatConfig

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from blind.table import HEADING, LEFT, RIGHT, Eye, Floor, Numbers, TableRobot, X, Y, curve, drawn  # noqa: E402
from match_lines import HALF, follow_lines, watching  # noqa: E402

BACK, FRONT_WALL = -0.12, 2.10
BEND = 0.3
LINES = (
    (0.5, -0.5, 0.5, 0.35, HALF),
    (0.7, 0.0, 1.2, 0.0, HALF),
    *curve(1.2, BEND, BEND, -math.pi / 2, 0.0, HALF),
    (1.5, 0.3, 1.5, 0.9, HALF),
    (0.2, 0.9, 1.75, 0.9, HALF),
)
WALLS = ((BACK, 0.0, 1.0, 0.0), (FRONT_WALL, 0.0, -1.0, 0.0), (0.0, -0.55, 0.0, 1.0), (0.0, 1.35, 0.0, -1.0))
SLIPPERY = (0.6, 0.2, 0.9, 0.55, 0.33)
BLOCK = (1.47, 1.06)
SEATS = {"front": (0, 0.11, 0.0), "left": (1, 0.10, 0.06), "right": (2, 0.10, -0.06)}
"""Analog port, m ahead and m to the left of the tophats by robot.toml."""
CONFIG = replace(
    RobotConfig(),
    tophats={name: TophatConfig(*each) for name, each in SEATS.items()},
    servos={"claw": ServoConfig(0, positions_us={"open": 1200.0, "closed": 1900.0})},
)
LAMP_PORT = 5


@dataclass(frozen=True, slots=True)
class Waypoint:
    """Where a robot was and believed to be: m, rad, with the deviations that it stated."""

    name: str
    true: tuple[float, float, float]
    believed: tuple[float, float, float]
    std: float
    heading_std: float

    @property
    def off(self) -> float:
        """m between both."""
        return math.hypot(self.true[0] - self.believed[0], self.true[1] - self.believed[1])

    @property
    def heading_off(self) -> float:
        """rad between both."""
        return abs(math.remainder(self.true[2] - self.believed[2], math.tau))


@dataclass(slots=True)
class Match:
    """How a match went. wrong: what it did not do as it should."""

    seed: int
    waypoints: list[Waypoint] = field(default_factory=list)
    beside: list[float] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)
    remarks: tuple[str, ...] = ()
    seconds: float = 0.0
    light: float = 0.0


def eyes(rng: np.random.Generator) -> list[Eye]:
    """The tophats as they truly sit and read."""
    found = []
    for port, forward, left in SEATS.values():
        white = float(rng.uniform(180.0, 1300.0))
        black = float(rng.uniform(2700.0, 3800.0))
        ahead, aside = forward + float(rng.normal(0.0, 0.001)), left + float(rng.normal(0.0, 0.001))
        found.append(Eye(port, ahead, aside, white, black, float(rng.uniform(2.0, 12.0)), 40.0))
    return found


def calibrated(numbers: Numbers, seed: int) -> RobotConfig:
    """robot.toml after a taped metre."""
    error = float(np.random.default_rng((seed, 7)).normal(0.0, 0.001))
    port = TableRobot(numbers, Floor(), seed=seed + 1)
    with open_robot(CONFIG, port=port) as robot:
        return calibrate_drive(
            robot, lambda: math.hypot(port.state[X], port.state[Y]) + error, distance=1.0, tape_std=0.001
        )


class Referee:
    """Looks at the true robot while it drives."""

    def __init__(self, port: TableRobot, match: Match) -> None:
        self._port, self._match = port, match

    def at(self, robot: Robot, name: str) -> None:
        """Take down a waypoint."""
        s, here = self._port.state, robot.estimate
        self._match.waypoints.append(
            Waypoint(
                name,
                (float(s[X]), float(s[Y]), float(s[HEADING])),
                (here.x, here.y, here.heading),
                math.hypot(here.x_std, here.y_std),
                here.heading_std,
            )
        )

    def check(self, good: bool, what: str) -> None:
        """Take down what is not as it should be."""
        if not good:
            self._match.wrong.append(what)

    def true(self) -> tuple[float, float, float]:
        """x, y, heading."""
        s = self._port.state
        return float(s[X]), float(s[Y]), math.remainder(float(s[HEADING]), math.tau)

    def sensor(self) -> tuple[float, float]:
        """Where the front tophat truly is."""
        return self._port.eye_at(self._port.eyes[0])


def beside_main_line(x: float, y: float) -> float:
    """m to the right of the main line's right edge, by its shape in closed form."""
    if x < 1.2:
        return -y - HALF
    if y < BEND:
        return math.hypot(x - 1.2, y - BEND) - BEND - HALF
    return x - 1.5 - HALF


def program(robot: Robot, referee: Referee, match: Match, speed: float) -> None:
    """The match. It ends in a drive that the clock ends."""
    match.light = robot.time
    robot.run(seq(straight(0.25, speed), align_on_line("left", "right")))
    x, y, heading = referee.true()
    referee.check(abs(heading) < deg(2.5), f"aligned at the line {heading / deg(1):.1f} deg askew")
    robot.odometry.observe_heading(0.0, deg(1.5))
    referee.at(robot, "line")
    robot.run(parallel(straight(0.25, speed), servo("claw", "open")))
    settled: list[float] = []
    begin = robot.estimate.distance

    def see(robot: Robot) -> None:
        if robot.estimate.distance - begin > 0.2:
            settled.append(beside_main_line(*referee.sensor()))

    crossing = after_distance(0.8) & on_black("right")
    robot.run(watching(follow_line("front", "right", speed).until(crossing), see))
    match.beside += settled
    worst = max(map(abs, settled), default=math.inf)
    referee.check(worst < 0.020, f"followed the line up to {1e3 * worst:.0f} mm beside its edge")
    x, y, heading = referee.true()
    referee.check(abs(y - 0.775) < 0.015 and abs(x - 1.525) < 0.02, f"left the line at {x:.3f}, {y:.3f} m")
    referee.at(robot, "followed")
    robot.run(seq(turn_to(deg(90)), straight(0.15, 0.1), servo("claw", "closed", seconds=0.4)))
    robot.run(straight(-0.12, speed))
    referee.at(robot, "pushed")
    robot.run(seq(turn_to(0.0), straight(0.30, speed), align_on_wall(0.08, heading=0.0)))
    x, y, heading = referee.true()
    referee.check(abs(heading) < deg(1.0), f"at the wall {heading / deg(1):.1f} deg askew")
    referee.check(abs(x - (FRONT_WALL - 0.09)) < 0.01, f"at the wall it is at x = {x:.3f} m")
    referee.at(robot, "wall")
    side = math.pi / 2
    seen = robot.odometry.observe_line((FRONT_WALL, 0.0), side, sensor=(0.09, 0.0), std=0.004)
    referee.check(seen.accepted, f"the wall's place is refused: {seen.reason}")
    robot.run(seq(straight(-0.30, speed), turn_to(deg(-90)), arc(0.25, deg(-90), speed)))
    referee.at(robot, "arc")
    square = follow_path([(0.4, 0.35), (0.4, 0.7), (1.2, 0.7), (1.2, 0.35)], speed=speed, rounding=0.05)
    for number in range(2):
        robot.run(parallel(square, seq(servo("claw", "open"), wait(2.0), servo("claw", "closed"))))
        referee.at(robot, f"round {number + 1}")
    robot.run(seq(drive_to(0.5, 0.5, heading=0.0, speed=speed), straight(-0.35, speed)))
    referee.at(robot, "before the wall")
    robot.run(align_on_wall(-0.08, heading=0.0))
    x, y, heading = referee.true()
    referee.check(abs(heading) < deg(1.0), f"at the second wall {heading / deg(1):.1f} deg askew")
    referee.check(abs(x - (BACK + 0.09)) < 0.01, f"at the second wall it is at x = {x:.3f} m")
    referee.at(robot, "second wall")
    robot.run(seq(straight(0.3, speed), drive(0.1).until(on_black("left") | after_distance(0.4))))
    referee.at(robot, "end")
    robot.run(repeat(seq(straight(-0.15), straight(0.15))))


def played(seed: int, **fixed: float) -> Match:
    """One match of one robot."""
    rng = np.random.default_rng((seed, 1))
    numbers = drawn(rng, **fixed)
    config = calibrated(numbers, seed)
    floor = Floor(LINES, WALLS, (SLIPPERY,), BLOCK, math.inf)
    port = TableRobot(numbers, floor, eyes(rng), seed)
    match = Match(seed)
    referee = Referee(port, match)
    speed = float(rng.choice([0.10, 0.15, 0.20]))
    try:
        with open_robot(config, port=port) as robot:
            robot.run(wait(1.0))
            calibrate_tophats(robot, distance=0.75)
            port.place(*(float(each) for each in rng.normal(0.0, (0.003, 0.003, deg(1.0)))))
            robot.odometry.reset(position_std=0.004, heading_std=deg(1.0))
            robot.replan()
            lamp = robot.time + rng.uniform(2.0, 20.0)
            port.floor = replace(floor, lamp=float(lamp))
            report = run_match(
                robot,
                lambda robot: program(robot, referee, match, speed),
                start=wait_for_light(LAMP_PORT).timeout(40.0),
            )
            match.seconds, match.remarks = report.seconds, report.remarks
            referee.check(abs(match.light - lamp) < 0.4, f"began {match.light - lamp:.2f} s after the light")
            referee.check(abs(report.seconds - 120.0) < 0.05, f"ended after {report.seconds:.2f} s")
            referee.check(not any(port.written.duty), "motors on at the end")
            for _ in range(100):
                port.read()
            referee.check(abs(port.state[LEFT]) + abs(port.state[RIGHT]) < 1e-3, "wheels turn after the end")
    except RaccoonError as error:
        match.wrong.append(f"{type(error).__name__}: {error}")
    return match


def squared(seed: int, speed: float) -> bool:
    """Whether a robot of an untouched robot.toml squares up to a wall, by the true robot."""
    rng = np.random.default_rng((seed, 99))
    port = TableRobot(drawn(rng), Floor(walls=((0.3, 0.0, -1.0, 0.0), (-0.3, 0.0, 1.0, 0.0))), seed=seed)
    port.place(0.0, 0.0, float(rng.normal(0.0, deg(4.0))))
    with open_robot(CONFIG, port=port) as robot:
        robot.run(wait(1.0))
        try:
            robot.run(align_on_wall(speed))
        except RaccoonError:
            return False
    x, heading = float(port.state[X]), float(port.state[HEADING])
    return abs(heading) < deg(1.0) and abs(abs(x) - 0.21) < 0.003


def table(matches: list[Match]) -> None:
    """Everything for people."""
    good = sum(not each.wrong for each in matches)
    print(f"{good} of {len(matches)} matches did all they should")
    names = list(dict.fromkeys(point.name for each in matches for point in each.waypoints))
    print(
        f"{'waypoint':18}{'mm: median':>12}{'90 %':>8}{'stated':>8}"
        f"{'deg: median':>13}{'90 %':>7}{'stated':>8}{'rms z':>7}{'rms z heading':>15}"
    )
    for name in names:
        points = [point for each in matches for point in each.waypoints if point.name == name]
        off = np.array([point.off for point in points]) * 1e3
        turned = np.degrees([point.heading_off for point in points])
        std = np.array([point.std for point in points]) * 1e3
        heading_std = np.degrees([point.heading_std for point in points])
        print(
            f"{name:18}{np.median(off):12.1f}{np.percentile(off, 90):8.1f}{np.median(std):8.1f}"
            f"{np.median(turned):13.2f}{np.percentile(turned, 90):7.2f}{np.median(heading_std):8.2f}"
            f"{np.sqrt(np.mean((off / std) ** 2)):7.2f}{np.sqrt(np.mean((turned / heading_std) ** 2)):15.2f}"
        )
    beside = 1e3 * np.abs(np.concatenate([each.beside for each in matches]))
    print(f"beside the edge: median {np.median(beside):.1f} mm, 95 % {np.percentile(beside, 95):.1f} mm")


def main() -> None:
    """Play and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--trials", type=int, default=20)
    parser.add_argument("--walls", type=int, default=30)
    parser.add_argument("--lines", type=int, default=24)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--show", action="store_true", help="each match that went wrong, with its remarks")
    asked = parser.parse_args()
    logging.getLogger("raccoon").setLevel(logging.CRITICAL)
    begun = time.perf_counter()
    for speed in (0.06, -0.08, 0.15) if asked.walls else ():
        good = sum(squared(asked.seed + number, speed) for number in range(asked.walls))
        print(f"{good} of {asked.walls} squared up to a wall at {speed:g} m/s", flush=True)
    if asked.lines:
        follow_lines(range(asked.seed, asked.seed + asked.lines), show=asked.show)
    matches = [played(asked.seed + number) for number in range(asked.trials)]
    for each in matches:
        for what in each.wrong:
            print(f"seed {each.seed}: {what}")
        if asked.show:
            for what in each.remarks:
                print(f"    seed {each.seed} said: {what}")
    if matches:
        table(matches)
    print(f"{time.perf_counter() - begun:.0f} s")


if __name__ == "__main__":
    main()
