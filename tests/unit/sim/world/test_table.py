"""Tables: lines under tophats, walls and objects in the way, ramps."""

import math

import numpy as np
import pytest

from raccoon.core.config import BodyConfig, RobotConfig, TophatConfig
from raccoon.core.readings import Outputs
from raccoon.robot.emulated import SimulatedPlant
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.sim.world.collision import Obstacles
from raccoon.sim.world.table import Box, Line, Ramp, Thing, Wall, World, walls_around

PARAMETERS = Parameters.from_robot(
    RobotConfig(tophats={"front": TophatConfig(analog=0, forward=0.1, left=0.02)})
)


@pytest.mark.parametrize(
    ("x", "y", "distance"),
    [(0.5, 0.0, -0.025), (0.5, 0.025, 0.0), (0.5, 0.125, 0.1), (1.3, 0.4, 0.475), (-0.3, 0.0, 0.275)],
)
def test_distance_to_the_edge_of_a_line(x: float, y: float, distance: float) -> None:
    world = World(lines=(Line(((0.0, 0.0), (1.0, 0.0))),))
    assert world.nearest_line(x, y)[0] == pytest.approx(distance)


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


BOX = BodyConfig(front=0.12, back=0.06, width=0.2)


def touched(world: World, x: float, y: float, heading_deg: float) -> list[tuple[float, ...]]:
    """Place, direction and depth of each touch of a box with corners at (0.12, 0.1) and (-0.06, 0.1)."""
    found = Obstacles(world, BOX).touches((x, y, math.radians(heading_deg)))
    return sorted(tuple(round(number, 9) + 0.0 for number in touch) for touch in found)


def test_touches_are_the_same_whether_or_not_it_looked_before() -> None:
    world = World(walls=walls_around(Box((-1.0, -1.0), (1.0, 1.0))), objects=(Thing((0.3, 0.2), 0.1),))
    walker = Obstacles(world, BOX)
    random = np.random.default_rng(5)
    x = y = heading = 0.0
    met = 0
    for _ in range(4000):
        x, y = (min(max(each + random.normal(0.0, 0.02), -0.95), 0.95) for each in (x, y))
        heading += random.normal(0.0, 0.1)
        fresh = Obstacles(world, BOX).touches((x, y, heading))
        assert walker.touches((x, y, heading)) == fresh
        met += bool(fresh)
    assert 500 < met < 3500


def test_a_wall_ahead_is_touched_by_both_front_corners_or_by_the_one_that_leads() -> None:
    world = World(walls=(Wall((0.5, -1.0), (0.5, 1.0)),))
    assert touched(world, 0.379, 0.0, 0.0) == []
    both = [(0.12, -0.1, -1.0, 0.0, 0.001), (0.12, 0.1, -1.0, 0.0, 0.001)]
    assert touched(world, 0.381, 0.0, 0.0) == both
    # Turned left the right corner leads; behind the wall its normal looks the other way.
    ((x, y, normal_x, normal_y, depth),) = touched(world, 0.381, 0.0, 10.0)
    assert (x, y) == (0.12, -0.1)
    assert (normal_x, normal_y) == pytest.approx((-math.cos(math.radians(10)), math.sin(math.radians(10))))
    lead = 0.12 * math.cos(math.radians(10)) + 0.1 * math.sin(math.radians(10))
    assert depth == pytest.approx(0.381 + lead - 0.5)
    assert touched(world, 0.559, 0.0, 0.0) == [
        (-0.06, -0.1, 1.0, 0.0, 0.001),
        (-0.06, 0.1, 1.0, 0.0, 0.001),
    ]


def test_the_back_and_the_sides_touch_as_well() -> None:
    wall = World(walls=(Wall((-1.0, 0.0), (1.0, 0.0)),))
    assert touched(wall, 0.0, 0.059, 90.0) == [
        (-0.06, -0.1, 1.0, 0.0, 0.001),
        (-0.06, 0.1, 1.0, 0.0, 0.001),
    ]
    assert touched(wall, 0.0, 0.099, 0.0) == [(-0.06, -0.1, 0.0, 1.0, 0.001), (0.12, -0.1, 0.0, 1.0, 0.001)]


@pytest.mark.parametrize("turned", [False, True])
def test_the_end_of_a_wall_touches_a_side_and_no_corner(turned: bool) -> None:
    ends = ((0.05, 0.099), (0.05, 1.0))
    world = World(walls=(Wall(*(ends[::-1] if turned else ends)),))
    assert touched(world, 0.0, 0.0, 0.0) == [(0.05, 0.099, 0.0, -1.0, 0.001)]
    ahead = World(walls=(Wall((0.119, 0.02), (0.6, 0.1)),))
    assert touched(ahead, 0.0, 0.0, 0.0) == [(0.119, 0.02, -1.0, 0.0, 0.001)]


def test_a_wall_narrower_than_the_robot_touches_with_its_ends() -> None:
    world = World(walls=(Wall((0.119, -0.05), (0.119, 0.3)),))
    assert touched(world, 0.0, 0.0, 0.0) == [
        (0.119, -0.05, -1.0, 0.0, 0.001),
        (0.12, 0.1, -1.0, 0.0, 0.001),
    ]


def test_in_a_corner_of_the_table_each_wall_pushes_its_own_way() -> None:
    world = World(walls=walls_around(Box((-1.0, -1.0), (1.0, 1.0))))
    ways = {touch[2:4] for touch in touched(world, 0.8805, 0.9005, 0.0)}
    assert ways == {(-1.0, 0.0), (0.0, -1.0)}


def test_an_object_touches_a_face_or_a_corner() -> None:
    assert touched(World(objects=(Thing((0.169, 0.03), 0.05),)), 0.0, 0.0, 0.0) == [
        (0.12, 0.03, -1.0, 0.0, 0.001)
    ]
    ((x, y, normal_x, normal_y, depth),) = touched(World(objects=(Thing((0.15, 0.14), 0.06),)), 0.0, 0.0, 0.0)
    assert (x, y, depth) == pytest.approx((0.12, 0.1, 0.01))
    assert (normal_x, normal_y) == pytest.approx((-0.6, -0.8))
    assert touched(World(objects=(Thing((0.0, -0.08), 0.05),)), 0.0, 0.0, 0.0) == [
        (0.0, -0.08, 0.0, 1.0, 0.07)
    ]


def test_nothing_stands_in_the_way_on_an_empty_table() -> None:
    assert Obstacles(World.empty(), BOX).touches((7.0, -3.0, 0.3)) == []
    assert Obstacles(World.empty(), BOX).is_far(7.0, -3.0)


@pytest.mark.parametrize("start", [0.0, math.pi / 2])
def test_a_ramp_pulls_in_the_directions_of_the_table(start: float) -> None:
    world = World(ramps=(Ramp(Box((-9.0, -9.0), (9.0, 9.0)), along_x=0.25),))
    port = SimPort(PARAMETERS, world, noise=False, start=(0.0, 0.0, start))
    last = [port.read() for _ in range(200)][-1]
    assert last.truth is not None
    # Along x the pull beats the dry friction of 0.18 N m; across, the wheels hold.
    assert (last.truth.x > 0.05) is (start == 0.0)
    assert last.truth.y == pytest.approx(0.0, abs=1e-9)


def _hill(degrees: float) -> World:
    """A ramp that rises along x at the origin."""
    model, mass = RobotConfig().model.drive, RobotConfig().body.mass
    pull = 0.5 * mass * 9.80665 * math.sin(math.radians(degrees)) * model.wheel_radius.value
    return World(ramps=(Ramp(Box((-0.5, -1.0), (0.5, 1.0)), -pull),))


@pytest.mark.parametrize("heading", [0.0, 0.5 * math.pi, math.pi])
def test_an_accelerometer_feels_the_ramp_that_a_robot_stands_on(heading: float) -> None:
    port = SimPort(PARAMETERS, _hill(10.0), start=(0.0, 0.0, heading), noise=False)
    port.write(Outputs(brake=(True,) * 4))
    inputs = [port.read() for _ in range(20)][-1]
    assert inputs.accel is not None
    ahead, _, up = (each * inputs.device.accel_m_s2 for each in inputs.accel)
    felt = 9.80665 * math.sin(math.radians(10.0)) * math.cos(heading)
    assert ahead == pytest.approx(felt, abs=0.02)
    assert up == pytest.approx(math.sqrt(9.80665**2 - felt**2), abs=0.02)


def test_the_emulated_one_feels_it_as_well() -> None:
    felt = SimulatedPlant(PARAMETERS, _hill(-10.0)).advance(0.005, (0.0,) * 4).accel
    angle = math.radians(10.0)
    assert felt == pytest.approx((-9.80665 * math.sin(angle), 0.0, 9.80665 * math.cos(angle)), abs=0.02)


def test_a_robot_leans_by_the_floor_under_its_length() -> None:
    world = World(ramps=(Ramp(Box((0.1, -1.0), (0.5, 1.0)), -0.1),))
    felt = [world.slope_along(x, 0.0, 0.1, 0.0)[0] for x in (-0.01, 0.05, 0.1, 0.475, 0.51)]
    assert felt == pytest.approx([0.0, -0.05, -0.1, -0.025, 0.0])
    assert world.slope_along(0.3, 0.0, -0.1, 0.0)[0] == pytest.approx(-0.1)
    assert world.slope_along(0.3, 0.95, 0.0, 0.1)[0] == pytest.approx(-0.05)


@pytest.mark.parametrize("emulated", [False, True])
def test_the_gyro_tells_how_a_robot_pitches_on_its_way_up(emulated: bool) -> None:
    world = World(ramps=(Ramp(Box((0.15, -1.0), (2.0, 1.0)), -0.05),))
    pitch, force = 0.0, 0.0
    if emulated:
        plant = SimulatedPlant(PARAMETERS, world)
        for _ in range(300):
            state = plant.advance(0.005, (0.8, 0.8, None, None))
            pitch += 0.005 * state.gyro[1]
            force = state.accel[0]
    else:
        port = SimPort(PARAMETERS, world, noise=False)
        for _ in range(300):
            port.write(Outputs(duty=(0.8, 0.8, 0.0, 0.0)))
            inputs = port.read()
            assert inputs.gyro is not None
            assert inputs.accel is not None
            pitch += 0.005 * inputs.gyro[1] * inputs.device.gyro_rad_s
            force = inputs.accel[0] * inputs.device.accel_m_s2
    assert -9.80665 * pitch == pytest.approx(force, abs=0.02)
    assert force == pytest.approx(2.0 * 0.05 / (0.0345 * RobotConfig().body.mass), abs=0.02)


def test_a_robot_that_turns_on_a_slope_does_not_pitch() -> None:
    port = SimPort(PARAMETERS, _hill(10.0), noise=False)
    for _ in range(200):
        port.write(Outputs(duty=(-0.5, 0.5, 0.0, 0.0)))
        inputs = port.read()
        assert inputs.gyro is not None
        assert inputs.gyro[1] == 0.0


def test_a_robot_that_starts_on_a_ramp_rolls_from_the_first_cycle_on() -> None:
    everywhere = Ramp(Box((-9.0, -9.0), (9.0, 9.0)), along_x=0.3)
    plain = Parameters.from_robot(RobotConfig())
    ramp = SimPort(plain, World(ramps=(everywhere,)))
    slope = SimPort(plain.with_effect("drive.slope", along_x=0.3), World.empty())
    rolled = [slope.read().truth for _ in range(5)]
    assert [ramp.read().truth for _ in range(5)] == rolled
    assert rolled[0] != rolled[1]


def test_a_slope_along_a_way_counts_by_the_part_of_it_that_lies_on_the_ramp() -> None:
    world = World(
        ramps=(Ramp(Box((0.0, 0.0), (1.0, 1.0)), 0.1, -0.2), Ramp(Box((0.0, 0.6), (1.0, 2.0)), 0.3))
    )
    assert world.slope_along(0.5, -0.25, 0.0, 0.5) == pytest.approx((0.05, -0.1))  # half of it on the first
    assert world.slope_along(0.5, 0.4, 0.0, 0.4) == pytest.approx((0.1 + 0.5 * 0.3, -0.2))
    assert world.slope_along(0.5, 0.5, 0.0, 0.0) == pytest.approx(world.slope(0.5, 0.5))
    assert world.slope_along(-0.5, 0.5, 0.2, 0.0) == (0.0, 0.0)
