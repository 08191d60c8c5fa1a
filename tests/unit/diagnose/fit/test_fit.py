"""Steps of a fit whose coordinates have bounds."""

from __future__ import annotations

import tracemalloc
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import cast

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from blind.drives import exciting
from raccoon.diagnose.drives.features import MIN_BIN_S, Features
from raccoon.diagnose.experiment.advice import planned_log
from raccoon.diagnose.fit import backlash_scan, levenberg_marquardt
from raccoon.diagnose.fit.backlash_scan import find_backlash_starts, fit_with_backlash_scan
from raccoon.diagnose.fit.fit_result import Fit, cost_of
from raccoon.diagnose.fit.fitting import evaluate_fit, fit_point, fit_starts
from raccoon.diagnose.fit.levenberg_marquardt import (
    ROUGH_DECREASE,
    STEP_REDUCTION,
    Descent,
    _broyden_update,
    _damped_step,
)
from raccoon.diagnose.fit.problem import Point, Problem
from raccoon.diagnose.hypotheses.coordinates import Settings
from unit.diagnose.searches import plain_whitener

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Straight:
    """As much of a problem as a step asks for: coordinates between -1 and 1."""

    count: int

    def limits(self, _: Point) -> tuple[Array, Array]:
        return np.full(self.count, -1.0), np.full(self.count, 1.0)


class Whole(Straight):
    """One that keeps points inside as well."""

    def inside(self, point: Point) -> Point:
        return Point(np.clip(point.base, -1.0, 1.0))


def step_of(columns: Array, target: Array, start: Array) -> tuple[Array, float]:
    """Where a step leads whose columns are exact and which is not damped, and the decrease it foretells."""
    problem = cast(Problem, Straight(len(start)))
    fit = Fit.of(problem, Point(start), target - start @ columns, columns)
    point, foretold = _damped_step(problem, fit, 0.0)
    return point.base, foretold


def cost(columns: Array, target: Array, u: Array) -> float:
    rest = target - u @ columns
    return float(rest @ rest + u @ u)


def test_a_coordinate_that_would_leave_goes_to_its_bound_and_the_others_beside_it() -> None:
    """It stayed where it was: a filter's time constant that a bound stopped never moved towards it, which
    cost 100 units of misfit and made a cause of what robot.toml's deviation explains."""
    columns = np.array([[10.0, 0.0, 0.0], [6.0, 8.0, 0.0]])
    target = 30.0 * columns[0] / 10.0
    end, foretold = step_of(columns, target, np.zeros(2))
    assert end[0] == 1.0
    beside = columns[1] @ (target - columns[0]) / (1.0 + columns[1] @ columns[1])
    assert end[1] == pytest.approx(min(beside, 1.0))
    assert foretold == pytest.approx(cost(columns, target, np.zeros(2)) - cost(columns, target, end))


@pytest.mark.parametrize("seed", range(40))
def test_a_step_leads_as_far_down_as_bounded_least_squares(seed: int) -> None:
    rng = np.random.default_rng(seed)
    columns = rng.standard_normal((4, 12)) * rng.uniform(0.5, 8.0, (4, 1))
    target = 2.0 * rng.standard_normal(4) @ columns + rng.standard_normal(12)
    start = rng.uniform(-1.0, 1.0, 4)
    end, foretold = step_of(columns, target, start)
    rows, goal = np.vstack([columns.T, np.eye(4)]), np.concatenate([target, np.zeros(4)])
    least = cost(columns, target, lsq_linear(rows, goal, (-1.0, 1.0)).x)
    first = cost(columns, target, start)
    assert np.abs(end).max() <= 1.0
    assert foretold == pytest.approx(first - cost(columns, target, end))
    assert foretold >= 0.99 * (first - least)


def test_columns_are_simulated_of_points_that_are_kept_only(
    problem: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A third of all trials is no better than what a fit has, and a point has a column for every number."""
    true = problem.nominal().with_cause("drive.backlash", np.array([0.5, -0.4]))
    measured = problem.predict([true])[0]
    clean = replace(problem, features=replace(problem.features, measured=measured))
    whitener, predictions = plain_whitener(clean), Problem.predictions
    alone: list[float] = []
    with_columns: list[float] = []

    def watched(self: Problem, points: Sequence[Point]) -> Iterator[Array]:
        outputs = list(predictions(self, points))
        costs = with_columns if len(points) > 1 else alone
        costs.append(cost_of(points[0], whitener((measured - outputs[0])[None])[0]))
        return iter(outputs)

    monkeypatch.setattr(Problem, "predictions", watched)
    fit = fit_point(clean, whitener, problem.nominal().with_cause("drive.backlash", np.array([1.5, 0.5])))
    assert all(after < before for before, after in pairwise(with_columns))
    assert fit.cost == pytest.approx(with_columns[-1])
    assert len(alone) >= len(with_columns)  # all but the start were tried alone, and one was no better


@pytest.mark.parametrize("seed", range(5))
def test_bent_columns_foretell_the_step_that_was_taken(seed: int) -> None:
    rng = np.random.default_rng(seed)
    problem = cast(Problem, Straight(3))
    columns = rng.normal(size=(3, 20)) * np.array([[1.0], [10.0], [100.0]])
    start, end = rng.uniform(-0.5, 0.5, size=(2, 3))
    fit = Fit.of(problem, Point(start), rng.normal(size=20), columns)
    there = fit.whitened_residual - (end - start) @ columns + 0.3 * rng.normal(size=20)
    bent = _broyden_update(problem, fit, Point(end), there)
    np.testing.assert_allclose(fit.whitened_residual - (end - start) @ bent.jacobian, there, atol=1e-9)
    part = (end - start) * (columns**2).sum(axis=1)  # of a coordinate in the step
    bend = bent.jacobian - columns
    np.testing.assert_allclose(bend / part[:, None], np.tile(bend[0] / part[0], (3, 1)), atol=1e-12)
    straight = _broyden_update(problem, fit, Point(end), fit.whitened_residual - (end - start) @ columns)
    np.testing.assert_allclose(straight.jacobian, columns, atol=1e-9)


def test_what_a_step_gains_is_foretold_whole_damped_and_shortened() -> None:
    rng = np.random.default_rng(3)
    columns, target, start = rng.normal(size=(3, 20)), 0.1 * rng.normal(size=20), np.zeros(3)
    problem = cast(Problem, Straight(3))
    fit = Fit.of(problem, Point(start), target, columns)
    for damping in (0.0, 0.5, 5.0):
        point, foretold = _damped_step(problem, fit, damping)
        assert foretold == pytest.approx(fit.cost - cost(columns, target, point.base))
    whole, foretold = _damped_step(problem, fit, 0.0)
    track = Descent(whole, fit, predicted_decrease=foretold)
    track.shorten_step(cast(Problem, Whole(3)))
    np.testing.assert_allclose(track.trial.base, STEP_REDUCTION * whole.base)
    assert track.predicted_decrease == pytest.approx(fit.cost - cost(columns, target, track.trial.base))


@pytest.mark.parametrize(("foretold", "least"), [(0.4, 0.05), (8.0, 0.8), (90.0, 1.0)])
@pytest.mark.parametrize("arrived", [False, True])
def test_a_fit_has_arrived_where_a_tenth_of_what_was_foretold_comes_and_that_is_little(
    foretold: float, least: float, arrived: bool
) -> None:
    """No more than 1, and no less than 0.05."""
    problem, decrease = cast(Problem, Whole(1)), least - 0.01 if arrived else least + 0.01
    columns = np.array([[1.0, 0.0]])
    before = Fit.of(problem, Point(np.zeros(1)), np.array([4.0, 9.0]), columns)
    white = np.array([4.0, np.sqrt(81.0 - decrease - 0.01)])  # and 0.01 that the prior takes
    track = Descent(Point(np.full(1, 0.1)), before, predicted_decrease=foretold)
    track.consider(problem, Fit.of(problem, track.trial, white, columns))
    assert track.best is not before
    assert track.converged == arrived


def test_columns_that_foretold_a_step_well_do_for_the_next(
    problem: Problem, simulated: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    true = problem.nominal().with_cause("drive.inertia", np.array([-0.8]))
    true = true.with_cause("friction.viscous", np.array([0.7]))
    noise = problem.features.floors * np.random.default_rng(1).normal(size=problem.features.measured.shape)
    measured = problem.predict([true])[0] + noise
    start = (
        problem.nominal().with_cause("drive.inertia", np.zeros(1)).with_cause("friction.viscous", np.ones(1))
    )

    def fitted() -> Fit:
        simulated.append(0)
        noisy = replace(problem, features=replace(problem.features, measured=measured))
        return fit_point(noisy, plain_whitener(noisy), start)

    kept = fitted()
    monkeypatch.setattr(levenberg_marquardt, "GOOD_GAIN_RATIOS", (np.inf, np.inf))
    anew = fitted()
    assert kept.cost < anew.cost + ROUGH_DECREASE
    *_, of_kept, of_anew = simulated
    assert of_kept < 0.75 * of_anew


def test_a_start_that_is_a_fit_goes_on_with_its_columns(problem: Problem, simulated: list[int]) -> None:
    truth = problem.nominal().with_cause("drive.inertia", np.array([-0.3]))
    measured = problem.predict([truth])[0]
    problem = replace(problem, features=replace(problem.features, measured=measured))
    whitener = plain_whitener(problem)
    start = problem.nominal().with_cause("drive.inertia", np.array([0.0]))
    simulated.append(0)
    whole = fit_point(problem, whitener, start, 3)
    simulated.append(0)
    begun = evaluate_fit(problem, whitener, start)
    simulated.append(0)
    gone_on = fit_point(problem, whitener, begun, 2)
    np.testing.assert_array_equal(gone_on.point.vector(), whole.point.vector())
    *_, of_whole, of_begun, of_the_rest = simulated
    assert of_the_rest == of_whole - of_begun


def test_a_fit_of_play_does_not_stop_on_a_stair(problem: Problem) -> None:
    """A tooth is met before or after a sample of the gyro, so the misfit over the gap is a staircase. Where a
    fit ends depends on where it came from; with a scan it does not."""
    true = problem.nominal().with_cause("drive.backlash", np.array([0.5, -0.4]))
    size = problem.features.floors * np.array([4.0, 4.0, 9.0, 5.0])
    rng = np.random.default_rng(1)
    measured = problem.predict([true])[0] + size * rng.standard_normal(problem.features.measured.shape)
    noisy = replace(problem, features=replace(problem.features, measured=measured))

    def white(signals: Array) -> Array:
        return np.asarray((signals / size).reshape(*signals.shape[:-2], -1), float)

    starts = [(0.54, -0.05), (0.16, 0.0), (0.7, -0.8)]
    points = [noisy.nominal().with_cause("drive.backlash", np.array(each)) for each in starts]
    plain = [fit_point(noisy, white, each).cost for each in points]
    scanned = [fit_with_backlash_scan(noisy, white, each).cost for each in points]
    assert max(plain) - min(plain) > 5.0
    assert max(scanned) - min(scanned) < 1.0
    assert max(scanned) < min(plain) + 1.0


def test_a_scan_of_play_goes_on_for_less_where_numbers_are_said(
    problem: Problem, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And not from where a fit has just been: that looked at every column again for next to nothing."""
    starts: list[Point] = []

    def fitted(problem: Problem, whitener: object, around: list[Point], looks: int) -> list[Fit]:
        starts.extend(around)
        return [replace(fit, point=around[-1], cost=fit.cost - 0.3 * len(starts))]

    point = problem.nominal().with_cause("drive.backlash", np.array([0.5, -0.4]))
    exact = replace(problem, features=replace(problem.features, measured=problem.predict([point])[0]))
    white = plain_whitener(exact)
    fit = evaluate_fit(exact, white, point)
    monkeypatch.setattr(backlash_scan, "fit_point", lambda *_: fit)
    monkeypatch.setattr(backlash_scan, "fit_starts", fitted)
    fit_with_backlash_scan(exact, white, point)
    once = len(starts)
    assert once in (backlash_scan.SCAN_STARTS - 1, backlash_scan.SCAN_STARTS)
    assert all(not np.array_equal(each.vector(), point.vector()) for each in starts)
    fit_with_backlash_scan(exact, white, point, last=True)
    assert len(starts) > 2 * once + 1


def test_without_play_nothing_is_scanned(problem: Problem) -> None:
    def white(signals: Array) -> Array:
        return np.asarray(signals.reshape(*signals.shape[:-2], -1), float)

    start = problem.nominal().with_cause("friction.viscous", np.array([0.3]))
    assert fit_with_backlash_scan(problem, white, start).cost == fit_point(problem, white, start).cost


@pytest.mark.parametrize("size", [0.0, 0.35, 0.75, 1.3])
def test_play_is_looked_for_where_it_explains_more_than_none(problem: Problem, size: float) -> None:
    """And nowhere where there is none; from there a fit finds it."""
    none = problem.nominal()
    true = none.with_cause("drive.backlash", np.array([size, 0.2])) if size else none
    noise = problem.features.floors * np.random.default_rng(3).standard_normal(
        problem.features.measured.shape
    )
    measured = problem.predict([true])[0] + noise
    problem = replace(problem, features=replace(problem.features, measured=measured))
    whitener = plain_whitener(problem)
    fit = fit_point(problem, whitener, none)
    places = find_backlash_starts(problem, whitener, fit)
    assert bool(places) == (size > 0.0)
    if places:
        best = min(fit_starts(problem, whitener, places, 8), key=lambda each: each.cost)
        assert best.point.active["drive.backlash"][0] == pytest.approx(size, rel=0.1)


def test_play_is_looked_for_between_as_finely_as_bins_are_short(problem: Problem) -> None:
    """In bins of 5 ms, as a wheel loop takes to answer, play of 0.13 rad was nowhere beside sizes of 0.12 and
    0.15, and called unknown: a few hundredths of a radian from its size the teeth meet in other bins."""
    log = planned_log(exciting(np.random.default_rng(1), 8.0))
    problem = replace(problem, features=Features.of(log, MIN_BIN_S))
    none = problem.nominal()
    true = none.with_cause("drive.backlash", np.array([1.3, 0.2]))
    measured = problem.predict([true])[0]
    problem = replace(problem, features=replace(problem.features, measured=measured))
    whitener = plain_whitener(problem)
    places = find_backlash_starts(problem, whitener, evaluate_fit(problem, whitener, none))
    assert places[0].active["drive.backlash"][0] == pytest.approx(1.3, rel=0.03)


@pytest.mark.parametrize(("saved", "looked_at"), [(19.9, False), (20.1, True)])
def test_play_is_looked_at_where_it_saves_ten_units_of_evidence(
    problem: Problem, monkeypatch: pytest.MonkeyPatch, saved: float, looked_at: bool
) -> None:
    fit = evaluate_fit(problem, plain_whitener(problem), problem.nominal())
    monkeypatch.setattr(backlash_scan, "costs_at", lambda *_: fit.cost - saved * (np.arange(33) == 5))
    places = find_backlash_starts(problem, plain_whitener(problem), fit)
    assert [each.active["drive.backlash"].tolist() for each in places] == [[0.2, 0.6]] * looked_at


def test_a_fit_goes_on_until_it_has_arrived(problem: Problem) -> None:
    truth = problem.nominal().with_cause("drive.inertia", np.array([-0.8]))
    measured = problem.predict([truth])[0]
    problem = replace(problem, features=replace(problem.features, measured=measured))
    whitener = plain_whitener(problem)
    start = problem.nominal().with_cause("drive.inertia", np.array([0.0]))
    fit = fit_point(problem, whitener, start)
    assert fit.point.active["drive.inertia"][0] == pytest.approx(-0.8, abs=0.12)


def test_a_fit_that_is_given_up_stays_where_it_is(problem: Problem) -> None:
    truth = problem.nominal().with_cause("drive.inertia", np.array([-0.8]))
    measured = problem.predict([truth])[0]
    problem = replace(problem, features=replace(problem.features, measured=measured))
    whitener = plain_whitener(problem)
    starts = [problem.nominal().with_cause("drive.inertia", np.array([u])) for u in (0.0, 0.5)]

    def lost(fit: Fit, foretold: float) -> bool:
        assert foretold > 0.0
        return bool(fit.point.active["drive.inertia"][0] == 0.5)

    went, stayed = fit_starts(problem, whitener, starts, 10, lost)
    assert went.point.active["drive.inertia"][0] == pytest.approx(-0.8, abs=0.12)
    assert stayed.point.active["drive.inertia"][0] == 0.5


def test_a_simulation_that_gives_no_numbers_is_no_fit_and_no_crash(problem: Problem) -> None:
    """Far from everything a set of causes may simulate to nonsense; its start is given up, not the search."""
    truth = problem.nominal().with_cause("drive.inertia", np.array([0.4]))
    measured = problem.predict([truth])[0]
    sound = problem.rollout

    def broken(variants: Sequence[Settings]) -> tuple[Iterator[np.ndarray], float]:
        parts, step = sound(variants)
        samples = np.concatenate(list(parts))
        for place, each in enumerate(variants):
            if each[("imu.latency", None, "seconds")] > 0.0:
                samples[place] = np.nan
        return iter([samples]), step

    features = replace(problem.features, measured=measured)
    problem = replace(problem, features=features, rollout=broken)
    whitener = plain_whitener(problem)
    inertia = problem.nominal().with_cause("drive.inertia", np.array([0.0]))
    starts = [inertia.with_cause("imu.latency", np.array([0.5])), inertia]
    lost, found = fit_starts(problem, whitener, starts, 6)
    assert lost.cost == np.inf
    assert lost.evidence == -np.inf
    assert found.point.active["drive.inertia"][0] == pytest.approx(0.4, abs=0.1)


def test_of_more_starts_no_more_is_kept_than_their_columns(problem: Problem) -> None:
    """A search fits some sixty starts of twenty coordinates at once: their simulations beside each other took
    a controller's whole memory, ten times their columns. So short a drive has settings as large."""
    whitener, peaks, counts = plain_whitener(problem), [], (2, 12, 24)
    near = problem.nominal().vector()
    for count in counts:  # the first loads the simulator
        fresh = replace(problem)  # nothing is remembered
        starts = [Point(near + 0.001 * each) for each in range(count)]
        tracemalloc.start()
        fits = fit_starts(fresh, whitener, starts, 1)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    columns = fits[0].jacobian.nbytes + fits[0].whitened_residual.nbytes
    assert peaks[-1] - peaks[-2] < 3.0 * (counts[-1] - counts[-2]) * columns
