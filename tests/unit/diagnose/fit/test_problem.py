"""What a problem simulates, and what it need not simulate again."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import pytest

from raccoon.diagnose.fit import problem as module
from raccoon.diagnose.fit.fitting import fit_with_frozen_columns
from raccoon.diagnose.fit.problem import BASE_STEP_STDS, Point, Problem, neighbouring_points
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.hypotheses.coordinates import Settings
from raccoon.diagnose.rollout.dead_zone_evidence import ReadingEvidence


class Counting:
    """A rollout that says how many robots it was asked for."""

    def __init__(self, problem: Problem) -> None:
        self._sound = problem.rollout
        self.asked: list[int] = []

    def __call__(self, variants: Sequence[Settings]) -> tuple[Iterator[np.ndarray], float]:
        self.asked.append(len(variants))
        return self._sound(variants)


def points_of(problem: Problem, count: int) -> list[Point]:
    return [Point(np.full(len(problem.base), 0.1 * (each + 1))) for each in range(count)]


def test_what_was_simulated_lately_is_not_simulated_again(problem: Problem) -> None:
    counting = Counting(problem)
    counted = replace(problem, rollout=counting)
    first, second, third = points_of(problem, 3)
    before = counted.predict([first, second, first])
    after = counted.predict([third, second, first])
    assert counting.asked == [2, 1]
    np.testing.assert_array_equal(before[0], before[2])
    np.testing.assert_array_equal(after[1:], before[[1, 0]])
    np.testing.assert_array_equal(after[0], replace(problem).predict([third])[0])
    after[2] = 0.0  # an answer is the caller's own
    np.testing.assert_array_equal(counted.predict([first])[0], before[0])


def test_another_simulator_starts_with_nothing_remembered(problem: Problem) -> None:
    point = points_of(problem, 1)
    problem.predict(point)
    counting = Counting(problem)

    def louder(variants: Sequence[Settings]) -> tuple[Iterator[np.ndarray], float]:
        parts, step = counting(variants)
        return (each + 1.0 for each in parts), step

    other = replace(problem, rollout=louder)
    assert not np.array_equal(other.predict(point), problem.predict(point))
    assert counting.asked == [1]


def test_what_is_compared_is_simulated_in_steps_of_one_length(problem: Problem) -> None:
    """A wheel as stiff and light as this asks for shorter steps than all the others."""
    counting = Counting(problem)
    counted = replace(problem, rollout=counting)
    (first,) = points_of(problem, 1)
    names = [each.name for each in problem.base]
    base = first.base.copy()
    base[names.index("friction.presliding.compliance")] = -1.7
    stiff = Point(base).with_cause("drive.inertia", np.array([-1.5]))
    usual = counted.predict([first])
    together = counted.predict([stiff, first])
    assert counting.asked == [1, 1, 2]
    assert not np.array_equal(together[1], usual[0])
    np.testing.assert_array_equal(together, replace(problem).predict([stiff, first]))


def test_no_more_is_kept_than_allowed(problem: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "CACHE_BYTES", 2.5 * problem.features.measured.nbytes)
    counting = Counting(problem)
    counted = replace(problem, rollout=counting)
    first, second, third = points_of(problem, 3)
    assert len(counted.predict([first, second, third])) == 3
    counted.predict([second, third])
    counted.predict([first])
    assert counting.asked == [3, 1]


def test_a_robot_that_cannot_be_gives_no_numbers_and_leaves_the_others_alone(problem: Problem) -> None:
    """A fit on its way may try one that has next to no inertia, beside others that are sound."""
    sound = problem.settings(problem.nominal())
    weightless = {**sound, ("inertia", None, "straight"): 1e-6}
    (samples,), step = problem.rollout([sound, weightless, sound])
    (alone,), _ = problem.rollout([sound, sound])
    assert np.isnan(samples[1]).all()
    np.testing.assert_array_equal(samples[[0, 2]], alone)
    (nothing,), _ = problem.rollout([weightless])
    assert np.isnan(nothing).all()
    assert step > 0.0


@pytest.mark.parametrize("name", ["friction.viscous", "battery.internal_resistance", "bemf.filter_lag@left"])
def test_no_cause_goes_where_the_simulator_has_no_robot(name: str, problem: Problem) -> None:
    """A right wheel's friction of -0.0003 N m s/rad was to be put into robot.toml."""
    problem = replace(problem, causes={each.name: each for each in drive_causes()})
    (coordinate,) = problem.causes[name].coordinates
    low, high = problem.limits(problem.nominal().with_cause(name, np.zeros(1)))
    assert low[-1] < 0.0
    assert high[-1] == np.inf
    least = Point(low[:-1], {name: low[-1:]})
    values = [problem.settings(least)[key] for key in coordinate.settings]
    assert values == pytest.approx([0.0] * len(values), abs=1e-12)


def test_of_wheels_that_differ_that_with_less_friction_bounds_what_both_may_lose(problem: Problem) -> None:
    """A model to start from may have more at one wheel: the other's was then less than none."""
    settings = [("friction.viscous", side, "coefficient") for side in ("left", "right")]
    more = dict(problem.neutral) | {settings[0]: 2.0 * problem.neutral[settings[0]]}
    known = replace(problem, neutral=more, causes={each.name: each for each in drive_causes()})
    low, _ = known.limits(known.nominal().with_cause("friction.viscous", np.zeros(1)))
    least = known.settings(Point(low[:-1], {"friction.viscous": low[-1:]}))
    assert min(least[key] for key in settings) == pytest.approx(0.0, abs=1e-12)


def test_a_fit_starts_where_there_are_robots(problem: Problem) -> None:
    far = problem.nominal().with_cause("drive.backlash", np.array([-5.0, 0.0]))
    measured = problem.features.measured

    def plain(signals: np.ndarray) -> np.ndarray:
        return np.asarray(signals.reshape(*signals.shape[:-2], -1), float)

    (found,) = fit_with_frozen_columns(problem, plain, [far], np.zeros((0, measured.size)), 1)
    assert found.point.active["drive.backlash"][0] == 0.0


def test_a_column_at_a_bound_is_taken_inwards(problem: Problem) -> None:
    low, high = problem.limits(problem.nominal())
    for edge, inwards in ((high, -1.0), (low, 1.0)):
        points, steps = neighbouring_points(problem, Point(edge.copy()))
        bounded = np.isfinite(edge)
        assert (np.sign(steps[bounded]) == inwards).all()
        for index, (point, step) in enumerate(zip(points, steps, strict=True)):
            moved = point.base - edge
            assert moved[index] == pytest.approx(step) or not bounded[index]
            assert ((low <= point.base) & (point.base <= high)).all()
    assert (neighbouring_points(problem, problem.nominal())[1] == BASE_STEP_STDS).all()


def test_what_readings_tell_apart_from_a_simulation_needs_a_cause_of_that_size(problem: Problem) -> None:
    shown = {
        "bemf.dead_zone": ReadingEvidence(12.0, 0.4, low=0.3),
        "bemf.dead_zone@left": ReadingEvidence(3.0, 0.1),
    }
    told = replace(problem, reading_evidence=shown)
    point = problem.nominal().with_cause("imu.latency", np.ones(1))
    assert told.reading_evidence_at(point) == 0.0
    for size, evidence in ((0.39, 0.0), (0.4, 12.0), (2.0, 12.0)):
        assert told.reading_evidence_at(point.with_cause("bemf.dead_zone", np.array([size]))) == evidence
    assert told.limits(told.nominal().with_cause("bemf.dead_zone", np.ones(1)))[0][-1] == 0.3
    assert told.limits(told.nominal().with_cause("bemf.dead_zone@left", np.ones(1)))[0][-1] == 0.0
