"""Lines that robots of tests/blind/table.py follow, with one tophat on an edge or with two around the line.

benchmarks/matches.py --lines draws the robots. They drive at 0.05 to 0.20 m/s, their tophats are 5 to 13 cm
ahead, and floor and line read up to 150 counts off their calibration. The lines: two bends of 0.12 to 0.4 m;
two of 0.06 to 0.12 m; a straight line that three others cross, up to 30 degrees off square; one that kinks by
40 to 110 degrees. With one tophat it is the distance from its edge that counts, with two that of their middle
from the line's. Two that are further apart than the line is wide, or less, have play: the one of them that
just sees the edge is 0.4 of a spot on it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from blind.table import HEADING, Eye, Floor, TableRobot, X, Y, curve, drawn
from raccoon import Action, Robot, after_distance, deg, follow_line, open_robot, wait
from raccoon.core.config import RobotConfig
from raccoon.core.errors import RaccoonError
from raccoon.core.sections import TophatConfig
from raccoon.estimate.tophat import calibrate

HALF = 0.025
"""m, half a line's width."""
BEND = 1.2
"""rad of each bend."""
SETTLED = 0.1
"""m after which it counts how far off the robot is."""
Strips = list[list[float]]


@dataclass(slots=True)
class Followed:
    """How a line was followed. beside: m that the tophat is off its edge, or two's middle off the line's.
    lost: whether it was looked for. wrong: what went wrong, "" for nothing. seconds: s it took."""

    beside: list[float] = field(default_factory=list)
    lost: bool = False
    wrong: str = ""
    seconds: float = 0.0


def two_bends(radius: float) -> Strips:
    """Straight on, to the left, to the right, and straight on."""
    first = curve(0.5, radius, radius, -math.pi / 2, -math.pi / 2 + BEND, HALF)
    x, y = first[-1][2:4]
    centre = x + radius * math.sin(BEND), y - radius * math.cos(BEND)
    second = curve(*centre, radius, math.pi / 2 + BEND, math.pi / 2, HALF)
    x, y = second[-1][2:4]
    return [[-0.2, 0.0, 0.5, 0.0, HALF], *first, *second, [x, y, x + 0.4, y, HALF]]


def watching(action: Action[object], see: Callable[[Robot], None]) -> Action[object]:
    """The action, and `see` in each of its cycles."""

    def steps(robot: Robot) -> Iterator[None]:
        for _ in action.start(robot):
            see(robot)
            yield

    return Action(action.name, steps, action.check)  # type: ignore[arg-type]


def to_line(strips: Strips, x: float, y: float) -> float:
    """m to the middle of the nearest strip."""
    nearest = math.inf
    for x0, y0, x1, y1, _ in strips:
        ax, ay, bx, by = x1 - x0, y1 - y0, x - x0, y - y0
        share = min(max((ax * bx + ay * by) / (ax * ax + ay * ay), 0.0), 1.0)
        nearest = min(nearest, math.hypot(bx - share * ax, by - share * ay))
    return nearest


def followed(seed: int, course: str, apart: float) -> Followed:
    """One robot on one line. course: "bends", "tight", "crossings" or "corner". apart: m between two tophats,
    0 for one on an edge."""
    rng = np.random.default_rng((seed, 2))
    radius, speed = float(rng.uniform(0.12, 0.4)), float(rng.choice([0.05, 0.10, 0.15, 0.20]))
    forward, left = float(rng.uniform(0.05, 0.13)), float(rng.uniform(-0.03, 0.03))
    side: Literal["left", "right"] = "left" if rng.random() < 0.5 else "right"
    white, black = float(rng.uniform(180.0, 1300.0)), float(rng.uniform(2700.0, 3800.0))
    noise, wander = float(rng.uniform(2.0, 12.0)), float(rng.uniform(0.0, 150.0))
    numbers = drawn(rng)
    off, askew = float(rng.normal(0.0, 0.004)), float(rng.normal(0.0, deg(3.0)))
    levels = rng.normal(0.0, noise, 200)
    main, others, end = _course(course, radius, np.random.default_rng((seed, 3)))
    places = [0.5 * apart, -0.5 * apart] if apart else [left]
    eyes = [Eye(port, forward, at, white, black, noise, wander) for port, at in enumerate(places)]
    floor = Floor(main + others, patches=((0.2, -0.2, 0.4, 0.2, 0.33),))
    port = TableRobot(numbers, floor, eyes, seed)
    edge = 0.0 if apart else (HALF if side == "left" else -HALF)
    port.place(0.0, edge - (0.0 if apart else left) + off, askew)
    names = ("left", "right") if apart else ("front",)
    tophats = {
        name: TophatConfig(each.port, forward, each.left) for name, each in zip(names, eyes, strict=True)
    }
    result = Followed()
    with open_robot(replace(RobotConfig(), tophats=tophats), port=port) as robot:
        robot.run(wait(1.0))
        for name in names:
            robot.tophat(name).calibrate(calibrate([*(white + levels), *(black + levels)]))
        action = (
            follow_line(left="left", right="right", speed=speed)
            if apart
            else follow_line("front", side, speed)
        )

        def see(robot: Robot) -> None:
            if robot.estimate.distance > SETTLED:
                at = np.mean([port.eye_at(eye) for eye in eyes], axis=0)
                result.beside.append(to_line(main, *at) - (0.0 if apart else HALF))

        begin = robot.time
        try:
            robot.run(watching(action.until(after_distance(end)), see))
        except RaccoonError as error:
            result.wrong = str(error)
        result.seconds = robot.time - begin
        result.lost = any("lost the line" in said for said in robot.drive.remarks.values())
        s = port.state
        goal = main[-1]
        ahead = (s[X] - goal[0]) * (goal[2] - goal[0]) + (s[Y] - goal[1]) * (goal[3] - goal[1])
        if not result.wrong and ahead < 0.0:
            result.wrong = (
                f"ended at {s[X]:.2f}, {s[Y]:.2f} m, heading {math.degrees(s[HEADING]):.0f} degrees"
            )
    return result


def _course(course: str, radius: float, rng: np.random.Generator) -> tuple[Strips, Strips, float]:
    """The line, others that cross it, and m to drive."""
    if course == "bends":
        return two_bends(radius), [], 0.7 + 2.4 * radius
    if course == "tight":
        radius = float(rng.uniform(0.06, 0.12))
        return two_bends(radius), [], 0.75 + 2.4 * radius
    if course == "crossings":
        across: Strips = []
        for x in (0.35, 0.6, 0.85):
            angle = float(rng.uniform(deg(60), deg(120)))
            dx, dy = 0.3 * math.cos(angle), 0.3 * math.sin(angle)
            across.append([x - dx, -dy, x + dx, dy, HALF])
        return [[-0.2, 0.0, 1.0, 0.0, HALF], [1.0, 0.0, 1.6, 0.0, HALF]], across, 1.1
    angle = float(rng.choice([-1.0, 1.0]) * rng.uniform(deg(40), deg(110)))
    x, y = 0.5 + 0.8 * math.cos(angle), 0.8 * math.sin(angle)
    return [[-0.2, 0.0, 0.5, 0.0, HALF], [0.5, 0.0, x, y, HALF]], [], 0.9


COURSES = {
    "bends": "two bends",
    "tight": "two tight bends",
    "crossings": "three crossings",
    "corner": "a kink",
}
TWO = (0.03, 0.05, 0.08)
"""m between two tophats."""


def follow_lines(seeds: range, *, show: bool) -> None:
    """Follow every kind of line with one tophat and with two, and print. show: each that went wrong."""
    print(f"{'line':17}{'tophats':14}{'rms mm':>7}{'most':>7}{'looked for':>12}{'not followed':>14}{'s':>6}")
    for course, called in COURSES.items():
        for apart in (0.0, *TWO):
            all_of = [followed(seed, course, apart) for seed in seeds]
            off = 1e3 * np.abs(np.concatenate([each.beside for each in all_of]))
            lost, wrong = sum(each.lost for each in all_of), sum(bool(each.wrong) for each in all_of)
            tophats = f"two, {100.0 * apart:.0f} cm" if apart else "one"
            print(
                f"{called:17}{tophats:14}{np.sqrt(np.mean(off**2)):7.1f}{off.max():7.1f}"
                f"{lost:9} of {len(seeds):<3}{wrong:8} of {len(seeds):<3}"
                f"{np.median([each.seconds for each in all_of]):6.1f}",
                flush=True,
            )
            for seed, each in zip(seeds, all_of, strict=True):
                if show and each.wrong:
                    print(f"    seed {seed}: {each.wrong}")
