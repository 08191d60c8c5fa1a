"""The figures that the motions are asked for, held on robots of the benchmark (which has the percentiles)."""

import importlib.util
import math
import sys
from pathlib import Path
from types import ModuleType

import pytest

from raccoon.core.config import RobotConfig


def _benchmark() -> ModuleType:
    path = Path(__file__).parents[3] / "benchmarks" / "motions.py"
    spec = importlib.util.spec_from_file_location("benchmark_motions", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


motions = _benchmark()


@pytest.mark.parametrize(("battery", "left", "right", "seed"), [(6.1, 0, 2, 0), (7.0, 2, 1, 1)])
def test_a_robot_of_unequal_motors_keeps_every_figure(
    battery: float, left: int, right: int, seed: int
) -> None:
    _, errors = motions.measure(motions.Case(battery, left, right, seed))
    straight, turn, square = errors["straight"], errors["turn"], errors["square"]
    assert straight.along <= 0.003
    assert straight.across <= 0.005
    assert straight.heading_deg <= 0.3
    assert turn.heading_deg <= 0.5
    assert turn.seconds <= 1.3 * motions.turn_time_optimal(RobotConfig())
    assert math.hypot(square.along, square.across) <= 0.010
    assert square.heading_deg <= 1.0
    for name in motions.SMALL:
        assert errors[name].along <= 0.0015
        assert errors[name].seconds <= 1.0


@pytest.mark.parametrize("battery", [5.8, 7.2])
@pytest.mark.parametrize(("left", "right"), [(0, 2), (1, 0)])
def test_a_step_of_speed_settles_without_overshoot(battery: float, left: int, right: int) -> None:
    settled, overshoot = motions.step_response(battery, left, right, RobotConfig(), 3)
    wheel = motions.WheelModel(1.8, 1.08, 0.18, 0.004, 0.02)
    assert settled <= 3.0 * wheel.time_constant + 0.010
    assert overshoot <= 0.05


def test_nothing_oscillates_with_any_of_the_motors() -> None:
    phase_deg, gain_db = motions.worst_margins()
    assert phase_deg >= 45.0
    assert gain_db >= 6.0
