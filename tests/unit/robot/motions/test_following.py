"""Following a line: around bends, across an edge of light, and after it was lost."""

import math
from dataclasses import replace
from functools import cache
from itertools import pairwise
from random import Random

import numpy as np
import pytest

from raccoon import (
    Action,
    Condition,
    ConfigError,
    MotionTimeout,
    Robot,
    RobotConfig,
    after_distance,
    after_time,
    at_crossing,
    deg,
    open_robot,
    wait,
    wait_for,
    when,
)
from raccoon.core.config import TophatConfig
from raccoon.core.readings import Inputs
from raccoon.estimate.tophat import TophatCalibration, calibrate
from raccoon.model.reflectance import fit
from raccoon.robot.actions.steps import Steps
from raccoon.robot.motions.following import follow_line
from raccoon.robot.motions.last_edge import LastEdge
from raccoon.robot.motions.line_search import SEARCH_TIME, LineSearch
from raccoon.robot.motions.line_sight import OneEdge
from raccoon.sim.port import SimPort
from raccoon.sim.world.table import Box, Light, Line, World
from robots import CONFIG, FULL_RATE, InterceptingPort, simulated_port

HALF = 0.025
"""m, half of the width of a line."""
SHADE = 0.2
"""m from the robot's start to where the light is another; a tophat starts 11 cm in front of the robot."""
STRAIGHT = Line(((-0.5, 0.0), (3.0, 0.0)))


@cache
def calibration(ambient: float) -> TophatCalibration:
    optics = fit("new").at(0.007)
    levels = [optics.counts(dark, ambient) for dark in (0.0, 1.0)]
    return calibrate([level * (1.0 + 0.004 * (i % 5)) for level in levels for i in range(200)])


def follow(
    world: World,
    side: str,
    *,
    beside: float = 0.0,
    heading: float = 0.0,
    way: float = 0.45,
    ambient: float = 0.0,
    speed: float = 0.1,
    config: RobotConfig = CONFIG,
) -> tuple[Robot, SimPort]:
    """Follow with the left tophat, 3 cm left of the middle, that starts `beside` m left of the edge."""
    edge = HALF if side == "left" else -HALF
    port = simulated_port(world=world, start=(0.0, edge - 0.03 + beside, heading), config=config)
    with open_robot(config, port=port) as robot:
        for sensor in robot.tophats.values():
            sensor.calibrate(calibration(ambient))
        robot.run(wait(0.2))
        robot.run(
            follow_line("left", "left" if side == "left" else "right", speed).until(after_distance(way))
        )
        robot.run(wait(0.2))
        return robot, port


def sensor_at(port: SimPort) -> tuple[float, float]:
    x, y, heading = port._robot.pose
    cosine, sine = math.cos(heading), math.sin(heading)
    return x + 0.11 * cosine - 0.03 * sine, y + 0.11 * sine + 0.03 * cosine


@pytest.mark.parametrize("side", ["left", "right"])
def test_a_line_is_followed_around_a_bend(side: str) -> None:
    bend = [(0.2 + 0.4 * math.sin(a), 0.4 - 0.4 * math.cos(a)) for a in (i * 0.05 for i in range(25))]
    world = World(lines=(Line(((-0.2, 0.0), *bend)),))
    _, port = follow(world, side, beside=0.008, way=0.5)
    assert abs(world.nearest_line(*sensor_at(port))[0]) < 0.006
    assert port._robot.pose[2] > deg(30)


@pytest.mark.parametrize(("way", "most"), [(1.0, 0.003), (-1.0, 0.012)])
def test_a_tight_bend_is_followed_without_losing_it(way: float, most: float) -> None:
    """On its inner edge, of a radius of 0.105 m, it asks for 1.4 rad/s, and half of the spot gives 0.75. To
    the right no robot can go around steadily whose sensor is 0.114 m from the middle of its axis."""
    bend = [(0.2 + 0.13 * math.sin(0.05 * k), way * 0.13 * (1.0 - math.cos(0.05 * k))) for k in range(64)]
    world = World(lines=(Line(((-0.5, 0.0), *bend, (-0.3, way * 0.26))),))
    side = 1.0 if way > 0.0 else -1.0
    port = simulated_port(world=world, start=(0.0, side * HALF - 0.03, 0.0))
    beside: list[float] = []

    def see(_: Robot) -> bool:
        beside.append(world.nearest_line(*sensor_at(port))[0])
        return False

    with open_robot(CONFIG, port=port) as robot:
        for sensor in robot.tophats.values():
            sensor.calibrate(calibration(0.0))
        robot.run(wait(0.3))
        robot.run(
            follow_line("left", "left" if way > 0.0 else "right", 0.15).until(when(see) | after_distance(0.6))
        )
    assert abs(port._robot.pose[2]) > deg(150)
    assert np.abs(beside).max() < most
    assert robot.drive.remarks == {}


@pytest.mark.parametrize(
    ("speed", "side", "askew"),
    [(0.2, "right", 0.0), (0.05, "left", -30.0), (0.04, "left", -20.0)],
)
def test_a_line_is_followed_straight_over_one_that_crosses_it(speed: float, side: str, askew: float) -> None:
    """It turned off where it was slow: it had turned along the other line's edge before it was on it."""
    lean = math.tan(deg(askew))
    world = World(lines=(STRAIGHT, Line(((0.25 + lean, -1.0), (0.25 - lean, 1.0)))))
    robot, port = follow(world, side, way=0.35, speed=speed)
    x, y = sensor_at(port)
    assert x > 0.43
    assert y == pytest.approx(HALF if side == "left" else -HALF, abs=0.004)
    assert robot.drive.remarks == {}


@pytest.mark.parametrize(
    ("before", "behind", "side"),
    [
        (0.0, 1.0, "left"),
        (0.3, 0.0, "left"),
        (1.0, 0.3, "right"),
    ],
)
def test_a_line_is_followed_across_an_edge_of_light(before: float, behind: float, side: str) -> None:
    """The levels of before say that the sensor is beside the line: it was lost within 0.1 m."""
    lights = (
        Light(Box((-1.0, -1.0), (SHADE, 1.0)), before),
        Light(Box((SHADE, -1.0), (3.0, 1.0)), behind),
    )
    robot, port = follow(World(lines=(STRAIGHT,), lights=lights), side, ambient=before)
    x, y = sensor_at(port)
    assert x > 0.5
    assert abs(y) == pytest.approx(HALF, abs=0.003)
    assert robot.tophat("left").coverage == pytest.approx(0.5, abs=0.15)
    assert robot.time < 14.2


@pytest.mark.parametrize(
    ("width", "light", "side"),
    [
        (0.0, 0.06, "left"),
        (0.2, 0.08, "right"),
    ],
)
def test_a_floor_that_reads_like_half_an_edge_is_told_from_one(width: float, light: float, side: str) -> None:
    """In less light by little more than half of what black and white are apart; the robot circled on it."""
    ends = [SHADE + width * k / 8 for k in range(9)]
    steps = [
        Light(Box((begin, -1.0), (end, 1.0)), light * (7.5 - k) / 8)
        for k, (begin, end) in enumerate(pairwise(ends))
        if width > 0.0
    ]
    before = Light(Box((-1.0, -1.0), (SHADE, 1.0)), light)
    robot, port = follow(World(lines=(STRAIGHT,), lights=(before, *steps)), side, ambient=light)
    x, y = sensor_at(port)
    assert x > 0.5
    assert abs(y) == pytest.approx(HALF, abs=0.003)
    assert any("the light on the line has changed" in said for said in robot.drive.remarks.values())


@pytest.mark.parametrize(("way", "side"), [(-1.0, "left"), (1.0, "right")])
def test_a_bend_that_reads_the_same_all_along_is_not_taken_for_other_light(way: float, side: str) -> None:
    bend = [(0.2 + 0.4 * math.sin(0.05 * k), way * 0.4 * (1.0 - math.cos(0.05 * k))) for k in range(60)]
    world = World(lines=(Line(((-0.5, 0.0), *bend)),))
    robot, port = follow(world, side, way=0.7, speed=0.15)
    assert abs(world.nearest_line(*sensor_at(port))[0]) < 0.006
    assert robot.drive.remarks == {}


def test_a_calibration_of_indoors_follows_a_line_in_the_sun() -> None:
    world = World(lines=(STRAIGHT,), lights=(Light(Box((-1.0, -1.0), (3.0, 1.0)), 0.3),))
    _, port = follow(world, "left", way=0.3)
    x, y = sensor_at(port)
    assert x > 0.35
    assert y == pytest.approx(HALF, abs=0.003)


def test_light_that_hardly_moves_the_edge_is_not_learnt() -> None:
    """The sensor starts beside the edge, where its noise does not hide that the floor reads less."""
    world = World(lines=(STRAIGHT,), lights=(Light(Box((-1.0, -1.0), (3.0, 1.0)), 0.015),))
    robot, port = follow(world, "left", beside=0.006, way=0.35)
    assert abs(sensor_at(port)[1]) == pytest.approx(HALF, abs=0.0015)
    assert not any("the light on the line has changed" in said for said in robot.drive.remarks.values())


def test_a_robot_that_stands_drives_on_into_another_light_too() -> None:
    """As after a search, during which the light changed: it stood for the 12 s of the next one."""
    world = World(lines=(STRAIGHT,), lights=(Light(Box((-1.0, -1.0), (3.0, 1.0)), 0.3),))

    def learns(robot: Robot) -> Steps[None]:
        sensor = robot.tophat("left")
        sensor.follow_light(False)
        yield from LineSearch(robot, OneEdge(sensor, 1.0), LastEdge(robot), 0.0).learn_light()

    with open_robot(CONFIG, port=simulated_port(world=world, start=(0.0, HALF - 0.03, 0.0))) as robot:
        robot.tophat("left").calibrate(calibration(0.0))
        robot.run(wait(0.2))
        robot.run(Action("learn the light", learns))
        assert robot.time < 8.0
        assert 0.1 < (robot.tophat("left").coverage or 0.0) < 0.9  # its spot is on the edge


@pytest.mark.parametrize(
    ("side", "beside", "heading"),
    [("left", -0.08, deg(-3)), ("right", 0.06, deg(3))],
)
def test_a_robot_beside_the_line_that_steers_away_from_it_finds_it(
    side: str, beside: float, heading: float
) -> None:
    _, port = follow(World(lines=(STRAIGHT,)), side, beside=beside, heading=heading, way=0.3)
    x, y = sensor_at(port)
    assert x > 0.25
    assert abs(y) == pytest.approx(HALF, abs=0.003)


@pytest.mark.parametrize(
    ("side", "angle", "speed"),
    [
        ("left", 135, 0.2),
        ("left", -135, 0.1),
        ("right", 110, 0.1),
    ],
)
def test_a_line_is_followed_around_a_sharp_corner(angle: float, side: str, speed: float) -> None:
    """It was looked for where it was missed, up to 20 cm behind the corner, and from there out of reach; and
    less far to the right than to the left, because the sensor sits to the left."""
    cosine, sine = math.cos(deg(angle)), math.sin(deg(angle))
    world = World(lines=(Line(((-0.5, 0.0), (0.15, 0.0), (0.15 + 2.0 * cosine, 2.0 * sine))),))
    _, port = follow(world, side, way=0.55, speed=speed, config=FULL_RATE)
    x, y = sensor_at(port)
    across = cosine * y - sine * (x - 0.15)
    # A probe of whether it is on an edge moves it by 3 mm.
    assert across == pytest.approx(HALF if side == "left" else -HALF, abs=0.006)
    assert cosine * (x - 0.15) + sine * y > 0.2


@pytest.mark.parametrize(("side", "angle", "speed"), [("left", 135, 0.15), ("left", 150, 0.1)])
def test_a_line_that_turns_back_is_found_beyond_the_tip_of_its_corner(
    angle: float, side: str, speed: float
) -> None:
    """It lies behind the robot's axle while its sensor is at the corner. There the tip was found instead, and
    found again when it led nowhere."""
    cosine, sine = math.cos(deg(angle)), math.sin(deg(angle))
    world = World(lines=(Line(((-0.5, 0.0), (0.35, 0.0), (0.35 + 2.0 * cosine, 2.0 * sine))),))
    edge = HALF if side == "left" else -HALF
    config = replace(CONFIG, tophats={"front": TophatConfig(0, 0.11, 0.0)})
    port = simulated_port(world=world, start=(0.0, edge, 0.0), config=config)
    with open_robot(config, port=port) as robot:
        robot.tophat("front").calibrate(calibration(0.0))
        robot.run(wait(0.2))
        robot.run(
            follow_line("front", "left" if side == "left" else "right", speed).until(after_distance(0.8))
        )
    x, y, heading = port._robot.pose
    x, y = x + 0.11 * math.cos(heading) - 0.35, y + 0.11 * math.sin(heading)
    assert cosine * y - sine * x == pytest.approx(edge, abs=0.006)
    assert cosine * x + sine * y > 0.1
    assert math.cos(heading - deg(angle)) > 0.9


@pytest.mark.parametrize("speed", [0.1, 0.2])
def test_a_robot_that_comes_back_along_its_line_does_not_drive_on(speed: float) -> None:
    """It went around the tip of a corner, from one edge of the line to the other one of the same line, and
    back to where it came from."""
    world = World(lines=(Line(((-0.5, 0.0), (0.25, 0.0), (0.25 - 1.4, -1.4))),))
    config = replace(FULL_RATE, tophats={"front": TophatConfig(0, 0.07, 0.03)})
    port = simulated_port(world=world, start=(0.0, -HALF - 0.03, 0.0), config=config)
    with open_robot(config, port=port) as robot:
        robot.tophat("front").calibrate(calibration(0.0))
        robot.run(wait(0.2))
        with pytest.raises(
            MotionTimeout, match=r"came back along it, so it ends at .* follow its other edge"
        ):
            robot.run(follow_line("front", "right", speed).until(after_distance(0.8)))
        robot.run(wait(0.2))
    assert port._robot.pose[0] > 0.1
    assert port._robot.state.speed_left == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_line_is_followed_around_a_bend_that_is_tighter_than_the_robot_turns(way: float) -> None:
    angles = [0.05 * step for step in range(32)]
    bend = [(0.2 + 0.08 * math.sin(angle), way * (0.08 - 0.08 * math.cos(angle))) for angle in angles]
    world = World(lines=(Line(((-0.5, 0.0), *bend, (bend[-1][0], 2.0 * way))),))
    _, port = follow(world, "left", way=0.5, speed=0.2)
    assert abs(world.nearest_line(*sensor_at(port))[0]) < 0.006
    assert way * sensor_at(port)[1] > 0.2


def test_a_tophat_that_rides_along_another_edge_does_not_read_other_light() -> None:
    beside = Line(((-0.5, -0.06), (3.0, -0.06)))
    robot, _ = follow(World(lines=(STRAIGHT, beside)), "left", way=0.15)
    assert not any("does not read" in each for each in robot.drive.remarks.values())


@pytest.mark.parametrize("exchanged", [True, False])
def test_exchanged_plugs_are_said_where_the_other_tophat_is_on_the_edge(exchanged: bool) -> None:
    """Or beside the line, where no sensor is on an edge, and nothing is known of the plugs."""

    def seen(inputs: Inputs) -> Inputs:
        left, right, *rest = inputs.analog
        return replace(inputs, analog=(right, left, *rest)) if exchanged else inputs

    port = simulated_port(
        world=World(lines=(STRAIGHT,)), start=(0.0, HALF - (0.03 if exchanged else -0.04), 0.0)
    )
    with open_robot(CONFIG, port=InterceptingPort(port, seen=seen)) as robot:
        for sensor in robot.tophats.values():
            sensor.calibrate(calibration(0.0))
        robot.run(wait(0.3))
        robot.run(follow_line("left", "left", 0.1).until(after_time(0.8)))
        said = " ".join(robot.drive.remarks.values())
        assert "tophat left lost the line: looking for it" in said
        assert (
            "left found no edge, but right started on one: are their plugs exchanged?" in said
        ) is exchanged


@pytest.mark.parametrize("out", ["for good", "for a moment", "floating"])
def test_no_line_is_looked_for_with_a_tophat_that_sees_none(out: str) -> None:
    """It looked for the line for 6 s, with a plug that was out, and drove on for long if the port floated."""
    until, noise, level = 2.6 if out == "for a moment" else math.inf, Random(1), 1800.0

    def seen(inputs: Inputs) -> Inputs:
        nonlocal level
        if not 1.0 < inputs.time < until:
            return inputs
        if out == "floating":  # as on the emulated controllers, after its neighbour
            level += 0.1 * ((inputs.analog[1] or 0.0) - level) + noise.gauss(0.0, 43.0)
        return replace(inputs, analog=(level if out == "floating" else 4095.0, *inputs.analog[1:]))

    port = simulated_port(world=World(lines=(STRAIGHT,)), start=(0.0, HALF - 0.03, 0.0))
    with open_robot(CONFIG, port=InterceptingPort(port, seen=seen)) as robot:
        for sensor in robot.tophats.values():
            sensor.calibrate(calibration(0.0))
        robot.run(wait(0.3))
        follow = follow_line("left", "left", 0.1).until(after_distance(0.3))
        if out == "for a moment":
            robot.run(follow)
            assert robot.pose.x == pytest.approx(0.3, abs=0.01)
            return
        with pytest.raises(MotionTimeout, match=r"no floor is seen; .*tophat left.* is it plugged in"):
            robot.run(follow)
        assert robot.time < 4.0
        assert out == "floating" or abs(robot.pose.heading) < 0.05


def test_a_line_that_ends_is_said_and_the_robot_stands() -> None:
    world = World(lines=(Line(((-0.5, 0.0), (0.25, 0.0))),))
    port = simulated_port(world=world, start=(0.0, -0.005, 0.0))
    with open_robot(CONFIG, port=port) as robot:
        for sensor in robot.tophats.values():
            sensor.calibrate(calibration(0.0))
        robot.run(wait(0.5))
        begin = robot.time
        said = (
            r"left lost the line: no edge for 1 s or 0.15 m, and no line was found within 165 degrees "
            r"to either side"
        )
        with pytest.raises(MotionTimeout, match=said):
            robot.run(follow_line("left", "left", 0.1))
        assert (
            LastEdge(robot, play=0.04).missed_for == "no edge for 2.9 s or 0.35 m"
        )  # 0.5 s where none was yet
        assert robot.time - begin < 2.0 * SEARCH_TIME
        robot.run(wait(0.2))
        assert port._robot.state.speed_left == pytest.approx(0.0, abs=0.01)
    x, _, heading = port._robot.pose
    assert x < 0.4
    assert abs(heading) < deg(155)  # the sensor sits 15 degrees to the left


def between(
    lines: tuple[Line, ...], until: Condition, apart: float, speed: float = 0.15
) -> tuple[Robot, SimPort, float]:
    """Follow with two tophats around the first line; also m that their middle was off it, at the most."""
    sides = (("left", 0, 0.5), ("right", 1, -0.5))
    config = replace(CONFIG, tophats={name: TophatConfig(port, 0.11, at * apart) for name, port, at in sides})
    port = simulated_port(world=World(lines=lines), config=config)
    first, off = World(lines=lines[:1]), [0.0]

    def see(_: Robot) -> bool:
        x, y, heading = port._robot.pose
        off.append(HALF + first.nearest_line(x + 0.11 * math.cos(heading), y + 0.11 * math.sin(heading))[0])
        return False

    with open_robot(config, port=port) as robot:
        for sensor in robot.tophats.values():
            sensor.calibrate(calibration(0.0))
        robot.run(wait(0.3))
        robot.run(follow_line(left="left", right="right", speed=speed).until(when(see) | until))
    return robot, port, max(off)


@pytest.mark.parametrize(("apart", "most"), [(0.05, 0.003), (0.08, 0.016)])
def test_two_tophats_keep_a_line_between_them_around_a_bend(apart: float, most: float) -> None:
    """8 cm apart leave the line 1 cm of play to either side."""
    bend = [(0.2 + 0.2 * math.sin(0.05 * k), 0.2 - 0.2 * math.cos(0.05 * k)) for k in range(25)]
    line = Line(((-0.5, 0.0), *bend, (0.2 + 0.19 + 0.1, 0.127 + 0.3)))
    robot, port, off = between((line,), after_distance(0.5), apart)
    assert off < most
    assert port._robot.pose[2] > deg(60)
    assert robot.drive.remarks == {}


@pytest.mark.parametrize(("radius", "turned", "most"), [(0.06, 90, 0.04), (0.13, 150, 0.012)])
def test_two_tophats_take_a_tight_bend_for_no_crossing(radius: float, turned: float, most: float) -> None:
    """They turned aside as steeply as along a line that crosses, and left the line by 22 cm and by 4. Where
    another line crosses, the one that they follow goes on under the lighter of the two."""
    angles = [deg(3) * k for k in range(int(turned / 3) + 1)]
    bend = [(0.35 + radius * math.sin(each), radius * (1.0 - math.cos(each))) for each in angles]
    x, y = bend[-1]
    end = x + math.cos(deg(turned)), y + math.sin(deg(turned))
    robot, port, off = between(
        (Line(((-0.5, 0.0), *bend, end)),), after_distance(0.45 + radius * deg(turned)), 0.05, 0.1
    )
    assert off < most
    assert port._robot.pose[2] > deg(turned - 10)
    assert robot.drive.remarks == {}


def test_two_tophats_go_over_a_crossing_and_stop_at_one() -> None:
    """The second line lies 25 degrees off square, so the left tophat comes to it first."""
    lines = (STRAIGHT, Line(((0.25, 0.2), (0.25, -0.2))), Line(((0.45, 0.2), (0.636, -0.2))))
    robot, port, off = between(lines, after_distance(0.35) & at_crossing("left", "right"), 0.05)
    x, y, heading = port._robot.pose
    right = x + 0.11 * math.cos(heading) + 0.025 * math.sin(heading), y - 0.025 * math.cos(heading)
    assert off < 0.003
    assert World(lines=lines[2:]).nearest_line(*right)[0] == pytest.approx(0.0, abs=0.012)
    assert robot.drive.remarks == {}


def test_two_tophats_find_a_line_that_turned_off() -> None:
    corner = Line(((-0.5, 0.0), (0.15, 0.0), (0.15, 2.0)))
    _, port, _ = between((corner,), when(lambda robot: robot.pose.y > 0.05) | after_time(15.0), 0.06)
    x, y, heading = port._robot.pose
    middle = x + 0.11 * math.cos(heading), y + 0.11 * math.sin(heading)
    assert middle[0] == pytest.approx(0.15, abs=0.012)
    assert y > 0.05


@pytest.mark.parametrize(
    ("left", "right", "said"),
    [
        ((0.11, -0.03), (0.11, 0.03), "tophat left is not to the left of right"),
        ((0.11, 0.06), (0.11, -0.06), "left and right are 0.12 m apart .* 0.01 to 0.1 m"),
        ((0.11, 0.03), (0.06, -0.03), "left and right are 0.11 and 0.06 m ahead .* beside each other"),
        ((0.11, 0.03), (0.01, -0.03), "tophat.right.forward = 0.01"),
    ],
)
def test_two_tophats_that_are_no_pair_are_refused(
    left: tuple[float, float], right: tuple[float, float], said: str
) -> None:
    tophats = {"left": TophatConfig(0, *left), "right": TophatConfig(1, *right)}
    with open_robot(replace(CONFIG, tophats=tophats), port=simulated_port()) as robot:
        for action in (follow_line(left="left", right="right"), wait_for(at_crossing("left", "right"))):
            with pytest.raises(ConfigError, match=said):
                robot.run(action)


def test_two_tophats_that_fit_on_the_line_see_no_crossing() -> None:
    tophats = {"left": TophatConfig(0, 0.11, 0.02), "right": TophatConfig(1, 0.11, -0.02)}
    with (
        open_robot(replace(CONFIG, tophats=tophats), port=simulated_port()) as robot,
        pytest.raises(ConfigError, match=r"0\.04 m apart .* cannot see a crossing"),
    ):
        robot.run(wait_for(at_crossing("left", "right")))
