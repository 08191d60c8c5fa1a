"""Examples of property tests are the same 50 in every run; `RACCOON_EXPLORE=1` draws 100 fresh ones. None has
a deadline: how long one takes says how busy the machine is."""

import gc
import os
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import settings

from raccoon.sim.plant import compiled
from raccoon.sim.rollout import running

settings.register_profile("fixed", derandomize=True, deadline=None, max_examples=50)
settings.register_profile("explore", deadline=None)
settings.load_profile("explore" if os.environ.get("RACCOON_EXPLORE") else "fixed")


def pytest_configure() -> None:
    """The garbage collector looks after so many objects, not after every 700: that took a twentieth of the
    time."""
    gc.set_threshold(50_000, 20, 50)


def pytest_collection_finish() -> None:
    """Nor need it walk through thousands of tests and all libraries again and again: that took a twelfth."""
    gc.collect()
    gc.freeze()


@pytest.fixture
def few_causes(monkeypatch: pytest.MonkeyPatch) -> None:
    """A recorded drive may have few causes, where a test is not about which it has: a short diagnosis spends
    half of its time on the others."""
    from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes

    ids = {
        "actuation.latency", "battery.discharge", "battery.internal_resistance", "bemf.filter_lag",
        "bemf.scale", "drive.track_width", "imu.gyro_scale", "motor.back_emf_constant",
    }  # fmt: skip
    few = [each for each in drive_causes() if each.id in ids]
    monkeypatch.setattr("raccoon.diagnose.recordings.drive.drive_causes", lambda: few)


@pytest.fixture
def without_numba(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """As where numba is not installed: the plant's equations run as plain Python."""
    for module in (compiled, running):
        monkeypatch.setattr(module, "has_numba", lambda: False)
    _forget()
    yield
    monkeypatch.undo()
    _forget()


def _forget() -> None:
    cached: tuple[Any, ...] = (compiled.advance_cells, compiled.advance_lanes, compiled._made)
    for each in cached:
        each.cache_clear()
