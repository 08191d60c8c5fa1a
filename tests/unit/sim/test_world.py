"""Tables: lines under tophats, walls and objects in the way, ramps."""

import math

import numpy as np
import pytest

from raccoon.core.config import RobotConfig, TophatConfig
from raccoon.core.readings import Outputs
from raccoon.sim.collision import Obstacles
from raccoon.sim.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.sim.tophats import Tophat, darkness
from raccoon.sim.world import Box, Line, Ramp, Thing, World, walls_around

PARAMETERS = Parameters.from_robot(
    RobotConfig(tophats={"front": TophatConfig(analog=0, forward=0.1, left=0.02)})
)


@pytest.mark.parametrize(
    ("x", "y", "distance"),
    [(0.5, 0.0, -0.025), (0.5, 0.025, 0.0), (0.5, 0.125, 0.1), (1.3, 0.4, 0.475), (-0.3, 0.0, 0.275)],
)
def test_distance_to_the_edge_of_a_line(x: float, y: float, distance: float) -> None:
    world = World(lines=(Line(((0.0, 0.0), (1.0, 0.0))),))
    assert world.line_distance(x, y) == pytest.approx(distance)


def test_half_the_spot_is_dark_on_the_edge() -> None:
    assert darkness(0.0, 0.003) == pytest.approx(0.5)
    assert darkness(0.003, 0.003) == 0.0
    assert darkness(-0.003, 0.003) == 1.0
    assert darkness(0.001, 0.003) + darkness(-0.001, 0.003) == pytest.approx(1.0)


def test_a_tophat_reads_the_same_whether_or_not_it_looked_before() -> None:
    world = World.default()
    config = TophatConfig(analog=0, forward=0.1)
    walker = Tophat(config, PARAMETERS)
    random = np.random.default_rng(3)
    x = y = heading = 0.0
    for _ in range(3000):
        x += 0.002 * math.cos(heading)
        y += 0.002 * math.sin(heading)
        heading += random.normal(0.0, 0.05) + 0.02
        pose = (x, y, math.cos(heading), math.sin(heading))
        assert walker.read(world, *pose, 0.0) == Tophat(config, PARAMETERS).read(world, *pose, 0.0)


def test_crossing_a_line_shows_in_the_word_and_in_the_truth() -> None:
    world = World(lines=(Line(((0.2, -1.0), (0.2, 1.0))),))
    port = SimPort(PARAMETERS, world, noise=False)
    port.write(Outputs(duty=(0.8, 0.8, 0.0, 0.0)))
    cycles = [port.read() for _ in range(300)]
    truths = [each.truth for each in cycles if each.truth is not None]
    black = [bool(each.surface[0]) for each in truths]
    entered = truths[black.index(True)]
    assert entered.x + 0.1 == pytest.approx(0.2 - 0.025, abs=0.002)
    assert max(each.analog[0] or 0 for each in cycles) == pytest.approx(3800, abs=2)
    assert min(each.analog[0] or 0 for each in cycles) == pytest.approx(1270, abs=2)


def test_obstacles_are_the_same_whether_or_not_it_looked_before() -> None:
    world = World(walls=walls_around(Box((-1.0, -1.0), (1.0, 1.0))), objects=(Thing((0.3, 0.2), 0.1),))
    walker = Obstacles(world, 0.1)
    random = np.random.default_rng(5)
    x = y = 0.0
    for _ in range(4000):
        wish = x + random.normal(0.0, 0.01), y + random.normal(0.0, 0.01)
        x, y = walker.pushed_out(*wish)
        assert (x, y) == pytest.approx(Obstacles(world, 0.1).pushed_out(*wish), abs=1e-12)
        assert max(abs(x), abs(y)) <= 0.9 + 1e-12
        assert math.dist((x, y), (0.3, 0.2)) >= 0.2 - 1e-9


def test_a_corner_holds_from_both_sides() -> None:
    world = World(walls=walls_around(Box((-1.0, -1.0), (1.0, 1.0))))
    assert Obstacles(world, 0.1).pushed_out(0.97, 0.95) == pytest.approx((0.9, 0.9))


def test_nothing_stands_in_the_way_on_an_empty_table() -> None:
    assert Obstacles(World.empty(), 0.1).pushed_out(7.0, -3.0) == (7.0, -3.0)


@pytest.mark.parametrize("start", [0.0, math.pi / 2])
def test_a_ramp_pulls_in_the_directions_of_the_table(start: float) -> None:
    world = World(ramps=(Ramp(Box((-9.0, -9.0), (9.0, 9.0)), along_x=0.25),))
    port = SimPort(PARAMETERS, world, noise=False, start=(0.0, 0.0, start))
    last = [port.read() for _ in range(200)][-1]
    assert last.truth is not None
    # Along x the pull beats the dry friction of 0.18 N m; across, the wheels hold.
    assert (last.truth.x > 0.05) is (start == 0.0)
    assert last.truth.y == pytest.approx(0.0, abs=1e-9)
