"""Without numba all of it runs, slower, and gives the same."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from raccoon.core.config import RobotConfig
from raccoon.core.readings import Inputs, Outputs
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.sim.rollout import rollout
from raccoon.sim.rollout.commands import Commands

TIME = np.arange(60) * 0.005


def run_port() -> list[Inputs]:
    port = SimPort(
        Parameters.from_robot(RobotConfig()).with_effect("actuation.latency", seconds=0.012), seed=4
    )
    port.write(Outputs(duty=(0.6, 0.4, 0.0, 0.0)))
    return [port.read() for _ in range(80)]


def run_many() -> np.ndarray:
    robots = [
        Parameters.from_robot(RobotConfig()).with_effect("drive.inertia", factor=1.0 + 0.05 * each)
        for each in range(12)
    ]
    duty = np.select([TIME < 0.15, TIME < 0.25], [0.7, -0.5], 0.0)  # then the bridge is open
    return rollout.rollout(robots, Commands.of_wheels(TIME, duty, duty, brake=False))["motor.0.bemf"]


@pytest.fixture(params=[run_port, run_many], ids=["port", "rollout"])
def work(request: pytest.FixtureRequest) -> Callable[[], Any]:
    made: Callable[[], Any] = request.param
    return made


@pytest.fixture
def with_numba(work: Callable[[], Any]) -> Any:
    pytest.importorskip("numba")
    return work()


def test_the_same_numbers(work: Callable[[], Any], with_numba: Any, without_numba: None) -> None:
    plain = work()
    if isinstance(plain, list):
        assert plain == with_numba
    else:
        np.testing.assert_allclose(plain, with_numba, rtol=1e-12, atol=1e-12)
