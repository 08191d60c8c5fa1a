"""Several recordings are simulated each from its own start, with its own battery."""

from __future__ import annotations

import numpy as np
import pytest

from blind.generator import make
from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.log import Log, log_from_columns
from raccoon.diagnose.drives.log_joining import join_logs
from raccoon.diagnose.habits.problems import starting_settings
from raccoon.diagnose.hypotheses.coordinates import Settings
from raccoon.diagnose.hypotheses.per_recording import (
    PER_RECORDING_STDS,
    RUN,
    per_recording_coordinates,
    per_recording_settings,
)
from raccoon.diagnose.rollout.joined_rollout import make_rollout
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.sim.effects.chain import Chain

ROBOT = RobotConfig()
HABITS = Habits(Chain(), brake=False)
HOT = {("motor.heating", side, "gain"): 2.0 for side in ("left", "right")}


def samples(log: Log, *variants: Settings) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    parts, _ = make_rollout(log, ROBOT, HABITS)(variants)
    return np.concatenate(list(parts))


@pytest.fixture(scope="module")
def both() -> Log:
    return join_logs([log_from_columns(make(seed, seconds=5.0).columns, ROBOT) for seed in (1, 2)])


def test_they_are_what_each_is_alone_and_motors_are_cold_again(both: Log) -> None:
    hot = starting_settings(ROBOT, None) | HOT
    together = samples(both, hot | per_recording_settings(2))
    alone = np.concatenate([samples(each, hot) for each in both.split_recordings()], axis=2)
    np.testing.assert_array_equal(together, alone)


def test_each_has_a_battery_and_a_bias_of_its_own(both: Log) -> None:
    plain = starting_settings(ROBOT, None) | per_recording_settings(2)
    fresh = plain | {(RUN, "1", id_): size for (id_, _, _), size in PER_RECORDING_STDS.items()}
    before, after = samples(both, plain, fresh)
    first = both.time < both.runs[1].start
    roles = [each.role for each in both.channels]
    np.testing.assert_array_equal(before[:, first], after[:, first])
    battery, gyro = roles.index("battery"), roles.index("gyro")
    assert np.median(after[battery, ~first] - before[battery, ~first]) == pytest.approx(0.3, abs=0.02)
    resting = np.all(both.duty == 0.0, axis=1) & ~first
    assert np.median(after[gyro, resting] - before[gyro, resting]) == pytest.approx(0.002, abs=1e-4)


def test_what_differs_is_open_in_each_of_several_and_in_none_of_one() -> None:
    assert per_recording_coordinates(1) == []
    assert per_recording_settings(1) == {}
    found = per_recording_coordinates(3)
    assert len(found) == 3 * len(PER_RECORDING_STDS)
    settings = per_recording_settings(3)
    for each in found:
        each.apply(settings, 1.0)
    assert sorted(settings.values()) == sorted([*PER_RECORDING_STDS.values()] * 3)
