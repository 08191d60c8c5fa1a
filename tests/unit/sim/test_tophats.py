"""Where a simulated tophat looks, and how much of what it sees is black."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from raccoon.core.config import RobotConfig, TophatConfig
from raccoon.model.reflectance import fit, spot_radius
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.tophats import Tophat, darkness
from raccoon.sim.world.table import Line, World


def test_it_looks_ahead_of_the_axis_and_to_the_left() -> None:
    """Of a robot that faces up, left is where x is less."""
    front = TophatConfig(2, forward=0.11, left=0.03)
    tophat = Tophat(front, Parameters.from_robot(RobotConfig(tophats={"front": front})))
    looked: list[tuple[float, float]] = []

    def nearest_line(x: float, y: float) -> tuple[float, float]:
        looked.append((x, y))
        return 1.0, 0.05

    world: Any = SimpleNamespace(nearest_line=nearest_line, lights=())
    for heading, wanted in ((0.0, (1.11, 2.03)), (0.5 * math.pi, (0.97, 2.11))):
        tophat._slack = -1.0
        tophat.read(world, 1.0, 2.0, math.cos(heading), math.sin(heading), 0.0)
        assert looked[-1] == pytest.approx(wanted)


@pytest.mark.parametrize("distance", [-0.9, -0.3, 0.0, 0.2, 0.7])
def test_the_dark_share_of_a_spot_is_the_part_of_a_disc_beyond_the_edge(distance: float) -> None:
    edges = np.linspace(distance, 1.0, 20001)
    middle = 0.5 * (edges[1:] + edges[:-1])
    part = float((2.0 * np.sqrt(1.0 - middle**2) * np.diff(edges)).sum()) / math.pi
    assert darkness(0.004 * distance, 0.004) == pytest.approx(part, abs=1e-5)


def test_half_the_spot_is_dark_on_the_edge() -> None:
    assert darkness(0.0, 0.003) == pytest.approx(0.5)
    assert darkness(0.003, 0.003) == 0.0
    assert darkness(-0.003, 0.003) == 1.0
    assert darkness(0.001, 0.003) + darkness(-0.001, 0.003) == pytest.approx(1.0)


def test_a_tophat_reads_the_same_whether_or_not_it_looked_before() -> None:
    world = World.default()
    config = TophatConfig(analog=0, forward=0.1)
    parameters = Parameters.from_robot(RobotConfig(tophats={"front": config}))
    walker = Tophat(config, parameters)
    random = np.random.default_rng(3)
    x = y = heading = 0.0
    for _ in range(3000):
        x += 0.002 * math.cos(heading)
        y += 0.002 * math.sin(heading)
        heading += random.normal(0.0, 0.05) + 0.02
        pose = (x, y, math.cos(heading), math.sin(heading))
        assert walker.read(world, *pose, 0.0) == Tophat(config, parameters).read(world, *pose, 0.0)


@pytest.mark.parametrize("aside", [0.0, 0.0008, -0.0015, 0.003])
def test_a_line_thinner_than_the_spot_darkens_only_what_it_covers(aside: float) -> None:
    thin = World(lines=(Line(((0.0, -1.0), (0.0, 1.0)), width=0.002),))
    config = TophatConfig(analog=0, forward=0.0)
    tophat = Tophat(config, Parameters.from_robot(RobotConfig(tophats={"front": config})))
    height = 0.007
    radius = spot_radius(height)
    across = np.linspace(-radius, radius, 200001)
    chords = np.sqrt(radius**2 - across**2)
    share = float(chords[np.abs(across + aside) < 0.001].sum() / chords.sum())
    counts, _ = tophat.read(thin, aside, 0.0, 1.0, 0.0, 0.0)
    assert counts == pytest.approx(fit("new").at(height).counts(share, 0.0), abs=0.1)
