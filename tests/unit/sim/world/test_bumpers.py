"""Which switches a robot closes, worked out from where its box stands; and a program that ends by one."""

import math
import re
from pathlib import Path

import pytest

from raccoon import RobotConfig, drive, open_robot, pressed
from raccoon.core.config import BodyConfig, BumperConfig, Measured
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.sim.world.bumpers import ALL_OPEN, Bumpers
from raccoon.sim.world.table import Thing, Wall, World

README = Path(__file__).parents[4] / "README.md"
BOX = BodyConfig(front=0.12, back=0.06, width=0.2)
FRONT, BACK, LEFT, RIGHT, MIDDLE, CORNER, REAR_LEFT = range(7)
BUMPERS = (
    BumperConfig(FRONT),
    BumperConfig(BACK, "back"),
    BumperConfig(LEFT, "left"),
    BumperConfig(RIGHT, "right"),
    BumperConfig(MIDDLE, "front", Measured(-0.02), Measured(0.02)),
    BumperConfig(CORNER, "front", end=Measured(-0.06)),
    BumperConfig(REAR_LEFT, "left", Measured(-0.06), Measured(0.0)),
)
AHEAD = 0.4
WALL = World(walls=(Wall((AHEAD, -2.0), (AHEAD, 2.0)),))
DEEP, APART = 3e-4, -3e-4
"""m into a wall, as a robot pushes, and away from it."""


def pressed_at(world: World, x: float, y: float = 0.0, heading: float = 0.0) -> set[int]:
    flags = Bumpers(BUMPERS, world, BOX).digital((x, y, heading))
    return {port for port, flag in enumerate(flags) if flag}


def reach(heading: float) -> float:
    """m from the axis to the corner of the box that is the farthest ahead in the world."""
    corners = [(x, y) for x in (BOX.front, -BOX.back) for y in (0.1, -0.1)]
    return max(x * math.cos(heading) - y * math.sin(heading) for x, y in corners)


@pytest.mark.parametrize(
    ("degrees", "closed"),
    [
        (0.0, {FRONT, MIDDLE, CORNER}),
        (180.0, {BACK}),
        (90.0, {RIGHT}),
        (-90.0, {LEFT, REAR_LEFT}),
        (20.0, {FRONT, CORNER}),  # the right end of the front
        (-20.0, {FRONT}),  # the left one: neither the middle nor the part at the right
        (45.0, {FRONT, CORNER, RIGHT}),  # the corner gives way to either side
        (80.0, {RIGHT}),  # it grazes the wall: what is pushed along the front presses no switch there
        (-80.0, {LEFT}),
    ],
)
def test_what_touches_a_wall_is_pressed_and_nothing_else(degrees: float, closed: set[int]) -> None:
    heading = math.radians(degrees)
    assert pressed_at(WALL, AHEAD - reach(heading) + DEEP, 0.0, heading) == closed
    assert pressed_at(WALL, AHEAD - reach(heading) + APART, 0.0, heading) == set()
    assert (
        FRONT not in closed or pressed_at(WALL, AHEAD - reach(heading), 0.0, heading) == closed
    )  # set against it


@pytest.mark.parametrize(
    ("world", "closed"),
    [
        (World(objects=(Thing((0.15, 0.0), 0.03),)), {FRONT, MIDDLE}),
        (World(objects=(Thing((0.15, -0.07), 0.03),)), {FRONT, CORNER}),
        (World(objects=(Thing((0.15, -0.08), 0.03), Thing((0.15, 0.08), 0.03))), {FRONT, CORNER}),
        (World(objects=(Thing((-0.03, 0.13), 0.03),)), {LEFT, REAR_LEFT}),
        (World(objects=(Thing((0.05, 0.13), 0.03),)), {LEFT}),
        (World(walls=(Wall((0.12, 0.0), (0.5, 0.0)),)), {FRONT, MIDDLE}),  # the end of a wall
        (World(walls=(Wall((0.12, 0.03), (0.12, 0.08)),)), {FRONT}),  # one that is narrower than the robot
        (World(walls=(Wall((0.12, -0.5), (0.12, -0.03)),)), {FRONT, CORNER}),  # one that ends before it
    ],
)
def test_an_obstacle_presses_the_part_that_it_reaches(world: World, closed: set[int]) -> None:
    ahead, aside = (0.0, 1.0) if LEFT in closed else (1.0, 0.0)
    assert pressed_at(world, DEEP * ahead, DEEP * aside) == closed
    assert pressed_at(world, APART * ahead, APART * aside) == set()


def test_a_robot_without_bumpers_has_open_switches_for_nothing() -> None:
    assert Bumpers((), WALL, BOX).digital((AHEAD, 0.0, 0.0)) is ALL_OPEN
    assert Bumpers(BUMPERS, WALL, BOX).digital((AHEAD - 1.0, 0.0, 0.0)) is ALL_OPEN


def simulated(config: RobotConfig, world: World, start: tuple[float, float, float]) -> SimPort:
    return SimPort(Parameters.from_robot(config), world, robot=config, start=start)


def test_a_switch_closes_at_the_wall_stays_so_and_opens_when_the_robot_leaves() -> None:
    """The middle of the front, of a robot that comes askew: it squares up first."""
    config = RobotConfig(bumpers={"m": BUMPERS[MIDDLE], "b": BUMPERS[BACK]}, body=BOX)
    port = simulated(config, WALL, (AHEAD - BOX.front - 0.02, 0.0, math.radians(3.0)))
    with open_robot(config, port=port) as robot:
        robot.run(drive(0.1).until(pressed(MIDDLE)).timeout(2.0))
        stands = port.read()
        assert (stands.digital[MIDDLE], stands.digital[BACK]) == (True, False)
        assert stands.truth is not None
        assert stands.truth.x == pytest.approx(AHEAD - BOX.front, abs=5e-4)
        assert stands.truth.heading == pytest.approx(0.0, abs=math.radians(0.3))
        robot.run(drive(-0.1).until(~pressed(MIDDLE)).timeout(1.0))
        assert port.read().digital == ALL_OPEN


def test_the_readme_s_program_ends_its_drive_at_its_bumper() -> None:
    """Without one its wheels spin at the wall until the counters say 0.40 m, and so does the robot."""
    block = re.search(r"^```python\n(.*?)^```", README.read_text("utf-8"), re.MULTILINE | re.DOTALL)
    assert block is not None
    names: dict[str, object] = {"__name__": "readme"}
    exec(compile(block[1], "README.md", "exec"), names)
    config = RobotConfig(bumpers={"front": BumperConfig(0)})
    world = World(walls=(Wall((-1.0, 0.35), (2.0, 0.35)),))
    with open_robot(config, port=simulated(config, world, (0.0, 0.0, 0.0))) as robot:
        robot.run(names["mission"])  # type: ignore[arg-type]
        assert robot.pose.y == pytest.approx(0.35 - config.body.front, abs=0.01)
