"""Without numba all of it runs, slower, and gives the same."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from raccoon.core.config import RobotConfig
from raccoon.core.readings import Inputs, Outputs
from raccoon.sim import compiled, robot, rollout, running
from raccoon.sim.commands import Commands
from raccoon.sim.parameters import Parameters
from raccoon.sim.port import SimPort

TIME = np.arange(60) * 0.005


@pytest.fixture
def without_numba(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    def absent() -> bool:
        return False

    for module in (compiled, robot, running):
        monkeypatch.setattr(module, "has_numba", absent)
    _forget()
    yield
    monkeypatch.undo()
    _forget()


def _forget() -> None:
    cached: tuple[Any, ...] = (compiled.advance_one, compiled.advance_lanes, compiled._made)
    for each in cached:
        each.cache_clear()


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
    duty = np.where(TIME < 0.2, 0.7, -0.5)
    return rollout.rollout(robots, Commands.of_wheels(TIME, duty, duty))["motor.0.bemf"]


@pytest.fixture(params=[run_port, run_many], ids=["port", "rollout"])
def work(request: pytest.FixtureRequest) -> Callable[[], Any]:
    return request.param  # type: ignore[no-any-return]


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
