"""Rows that are missing for long: nothing is compared there, and it is said."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from blind.drives import exciting
from diagnoses import make_cause, make_diagnosis
from raccoon.core.config import RobotConfig
from raccoon.core.errors import TraceError
from raccoon.diagnose.diagnosis import Diagnoser, diagnose
from raccoon.diagnose.drives.features import Features
from raccoon.diagnose.drives.log import ROLL_OUT_S, SETTLING_DRIVE_S, Log, column_names, log_from_columns
from raccoon.diagnose.experiment.advice import planned_log
from raccoon.diagnose.findings import path_dependence
from raccoon.diagnose.hypotheses.coordinates import neutral_settings
from raccoon.diagnose.result import Diagnosis, Unexplained, Verdict
from raccoon.diagnose.rollout.plant_rollout import Habits, PlantRollout
from raccoon.diagnose.search_outcome import SearchOutcome
from raccoon.sim.effects.chain import Chain

Array = NDArray[np.float64]
ROBOT = RobotConfig()
HABITS = Habits(Chain.firmware(), brake=False)


def simulated(log: Log) -> Array:
    """Samples of the robot that robot.toml describes, (channels, rows)."""
    samples: Array = PlantRollout(log, ROBOT, HABITS, plain=True).samples([neutral_settings(ROBOT)])[0]
    return samples


@pytest.fixture(scope="module")
def whole() -> dict[str, Array]:
    """12 s of an exciting drive of that robot, every row of it."""
    log = planned_log(exciting(np.random.default_rng(1), 12.0))
    names = {
        column_names(ROBOT)[each.role]: row for each, row in zip(log.channels, simulated(log), strict=True)
    }
    return {"t": log.time, "motor.0.duty": log.duty[:, 0], "motor.1.duty": log.duty[:, 1], **names}


def less(columns: dict[str, Array], *gaps: tuple[float, float]) -> dict[str, Array]:
    time = columns["t"]
    kept = np.all([(time < start) | (time >= end) for start, end in gaps], axis=0)
    return {name: each[kept] for name, each in columns.items()}


def misfit(log: Log) -> Array:
    """By how much the same robot differs from a log, in units of each channel's noise."""
    features = Features.of(log)
    residual = features.measured - features.simulated(simulated(log)[None])[0]
    return np.asarray(np.abs(residual).max(axis=0) / features.floors, float)


def test_a_gap_makes_no_error(whole: dict[str, Array]) -> None:
    log = log_from_columns(less(whole, (4.0, 5.0), (8.0, 8.3)), ROBOT)
    assert misfit(log).max() < 3.0
    assert misfit(replace(log, lost=())).max() > 100.0


def test_gaps_are_said_and_short_losses_are_none(whole: dict[str, Array]) -> None:
    log = log_from_columns(less(whole, (4.0, 5.0), (8.0, 8.3)), ROBOT)
    assert log.notes[0].startswith("no rows from 4.0 to 5.0 s, 8.0 to 8.3 s: 2 gaps, 1.3 s in all")
    assert log_from_columns(less(whole, (4.0, 4.095)), ROBOT).lost == ()
    assert log_from_columns(whole, ROBOT).notes == ()


def test_bins_beside_a_gap_are_as_without_it(whole: dict[str, Array]) -> None:
    full = Features.of(log_from_columns(whole, ROBOT))
    features = Features.of(log_from_columns(less(whole, (4.0, 5.0)), ROBOT))
    same = np.searchsorted(full.time, features.time - 1e-9)
    np.testing.assert_array_equal(full.time[same], features.time)
    np.testing.assert_allclose(features.measured, full.measured[same], atol=1e-9)
    lost = full.time[~np.isin(full.time, features.time)]
    assert 3.98 < lost[0] < 4.03
    assert 5.0 + SETTLING_DRIVE_S - 0.03 < lost[-1] < 5.0 + ROLL_OUT_S + 0.03


def test_a_robot_that_rolls_takes_longer_to_forget() -> None:
    time = 0.005 * np.arange(1200, dtype=np.float64)
    columns = {"t": time, "motor.0.duty": np.zeros(1200), "motor.1.duty": np.zeros(1200)}
    columns = less(columns, (2.0, 3.0))
    (lost,) = log_from_columns(columns, ROBOT).lost
    assert lost == pytest.approx((2.0, 3.0 + ROLL_OUT_S), abs=0.006)


def test_what_is_left_must_be_long_enough(whole: dict[str, Array]) -> None:
    with pytest.raises(TraceError, match=r"1 gap, 10\.4 s in all; a diagnosis needs"):
        log_from_columns(less(whole, (0.8, 11.2)), ROBOT)


def test_the_longest_part_has_all_rows_between_two_gaps(whole: dict[str, Array]) -> None:
    log = log_from_columns(less(whole, (4.0, 5.0), (8.0, 8.3)), ROBOT)
    part = log.longest_part()
    assert (part.time[0], part.time[-1]) == pytest.approx((0.0, 3.995), abs=1e-6)
    assert part.lost == ()
    later = log_from_columns(less(whole, (4.0, 5.0)), ROBOT).longest_part()
    assert (later.time[0], later.time[-1]) == pytest.approx((5.0, whole["t"][-1]), abs=1e-6)


def found(*ids: str, depends_on: str = "") -> Diagnosis:
    causes = (make_cause(each, said="wrong: do.", change=math.nan) for each in ids)
    unexplained = Unexplained(0.5, (depends_on,) if depends_on else ())
    return make_diagnosis(*causes, verdict=Verdict.EXPLAINED, unexplained=unexplained)


def judged_parts(
    columns: dict[str, Array], first: Diagnosis, monkeypatch: pytest.MonkeyPatch
) -> tuple[Diagnosis, list[Log]]:
    """A diagnosis whose search of everything finds that, and the logs that were searched."""
    seen: list[Log] = []

    def once(_: Diagnoser, log: Log, __: Log | None) -> SearchOutcome:
        seen.append(log)
        return SearchOutcome(
            replace(first if len(seen) == 1 else found("friction.coulomb"), notes=log.notes), ()
        )

    monkeypatch.setattr(Diagnoser, "search_once", once)
    monkeypatch.setattr(path_dependence, "MIN_PART_S", 6.0)
    return diagnose(columns, ROBOT), seen


@pytest.mark.parametrize(
    "first", [found("drive.wheel_eccentricity", "drive.inertia"), found(depends_on="wheel angle left")]
)
def test_what_adds_up_over_a_gap_is_judged_without_one(
    whole: dict[str, Array], first: Diagnosis, monkeypatch: pytest.MonkeyPatch
) -> None:
    told, seen = judged_parts(less(whole, (4.0, 5.0)), first, monkeypatch)
    assert [each.id for each in told.causes] == ["friction.coulomb"]
    assert [each.time[0] for each in seen] == pytest.approx([0.0, 5.0])
    assert "only 5.0 to 12.0 s are used" in told.notes[1]


def test_where_no_part_is_long_enough_nothing_of_it_is_named(
    whole: dict[str, Array], monkeypatch: pytest.MonkeyPatch
) -> None:
    told, seen = judged_parts(less(whole, (4.0, 5.0), (8.0, 8.3)), found("drive.slope"), monkeypatch)
    assert (told.verdict, told.causes, len(seen)) == (Verdict.NOT_IDENTIFIABLE, (), 1)
    assert "the longest part without one has 4.0 s (6 s are needed)" in told.rejected[0].reason


def test_other_causes_keep_all_rows(whole: dict[str, Array], monkeypatch: pytest.MonkeyPatch) -> None:
    first = found("friction.viscous")
    told, seen = judged_parts(less(whole, (4.0, 5.0)), first, monkeypatch)
    assert (told.causes, len(seen)) == (first.causes, 1)
    told, seen = judged_parts(whole, found("drive.slope"), monkeypatch)
    assert ([each.id for each in told.causes], len(seen)) == (["drive.slope"], 1)
