"""How wrong a simulation is on unseen data, and what a cause gains there."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from blind.generator import make
from first_problem import make_problem
from raccoon.core.config import RobotConfig
from raccoon.diagnose.drives.features import BIN_S, bins_per_event
from raccoon.diagnose.drives.log import log_from_columns
from raccoon.diagnose.findings.held_out import (
    HeldOut,
    _expected_variance,
    contributions,
    fitted_bins,
    size_of,
)
from raccoon.diagnose.fit.noise_model import EVENT_BINS
from raccoon.diagnose.fit.problem import Point
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.recordings.reference.gyro_rescaling import GyroRescaling
from raccoon.diagnose.result import ChannelResult, Curve
from raccoon.diagnose.select.state import Search, start_search
from raccoon.diagnose.unknown.probes import make_probe_function

ROBOT = RobotConfig()
CAUSES = {each.name: each for each in drive_causes()}


def held(residual: np.ndarray) -> HeldOut:
    one, nothing = np.ones(2), np.zeros(len(residual))
    return HeldOut(
        one, one, one, 1.0, 1.0, {}, nothing, residual, np.stack([residual, residual]), one, EVENT_BINS
    )


def test_one_event_makes_no_model_wrong_and_a_steady_error_does() -> None:
    usual = np.random.default_rng(1).standard_normal((40 * EVENT_BINS, 2))
    event = usual.copy()
    event[:EVENT_BINS] *= 10.0
    assert held(usual).error_ratio == pytest.approx(1.0, abs=0.05)
    assert held(event).error_ratio == pytest.approx(1.0, abs=0.1)
    assert held(1.6 * usual).error_ratio == pytest.approx(1.6, abs=0.1)
    assert size_of(event, np.ones(2), EVENT_BINS) == pytest.approx(
        size_of(usual, np.ones(2), EVENT_BINS), abs=0.1
    )


@pytest.mark.parametrize(("seconds", "adequate", "wrong"), [(12.0, 1.15, 1.25), (2.0, 1.4, 1.6)])
def test_how_far_is_too_far_depends_on_how_much_there_is_to_judge_on(
    seconds: float, adequate: float, wrong: float
) -> None:
    bins = int(seconds / BIN_S)
    assert not held(np.full((bins, 2), adequate)).is_model_wrong
    assert held(np.full((bins, 2), wrong)).is_model_wrong


def test_what_wanders_slowly_may_be_further_off_by_chance() -> None:
    """In 12 s a floor has few values; what is left is counted from what is expected."""
    residual = np.full((600, 2), 1.35 * 1.5)
    wandering = replace(held(residual), expected=np.full(2, 1.5), size_before=4.0, size_after=1.35 * 1.5)
    assert not wandering.is_model_wrong  # 1.35 times what is expected
    assert replace(held(np.full((600, 2), 1.35)), size_before=4.0, size_after=1.35).is_model_wrong
    assert wandering.size_expected == pytest.approx(1.5)
    assert wandering.left == pytest.approx(1.5**2 * (1.35**2 - 1.0) / (4.0**2 - 1.5**2))
    assert replace(wandering, size_after=1.4).left == 0.0


@pytest.mark.parametrize(("seconds", "values"), [(12.0, 6.0), (4.0, 2.0), (24.0, 12.0)])
def test_what_wanders_has_as_many_values_as_it_forgets_itself_times_on_both_wheels(
    seconds: float, values: float
) -> None:
    """Three deviations of the mean square of so many, of the part that is not the floor, here a half."""
    chance, unit = 1.0 + 0.2 * np.sqrt(12.0 / seconds), np.full(2, np.sqrt(2.0))
    most = np.sqrt(chance**2 + 3.0 * 0.5 * np.sqrt(2.0 / values))
    for size, far in ((0.99 * most, False), (1.01 * most, True)):
        residual = np.full((int(seconds / BIN_S), 2), size) * unit
        assert replace(held(residual), expected=unit).is_model_wrong == far


def test_what_is_far_off_in_every_half_second_is_far_however_short_it_is() -> None:
    """None counts for more than four usual ones, and more than that was to be asked of 2 s."""
    off = replace(held(np.full((100, 2), 50.0)), expected=np.full(2, 2.0))
    assert off.error_ratio == pytest.approx(2.0)
    assert off.is_model_wrong


@pytest.mark.parametrize(("seconds", "part"), [(3.0, 0.8), (12.0, 0.9), (30.0, 0.9)])
def test_the_less_there_is_to_judge_on_the_more_harm_may_be_chance(seconds: float, part: float) -> None:
    residual = np.ones((int(seconds / BIN_S), 2))
    assert replace(held(residual), size_after=1.3).harm_limit == pytest.approx(part * 1.3, rel=0.01)


def test_what_a_cause_gains_is_counted_from_where_the_error_is_without_it() -> None:
    """The others may do harm without it: then it gains more than there was to gain at first, and not all."""
    found = replace(held(np.ones((2, 2))), size_before=1.5, size_after=1.2, without={"a": 1.3, "b": 2.0})
    assert found.share("a") == pytest.approx((1.3**2 - 1.2**2) / (1.5**2 - 1.0))
    assert found.share("b") == pytest.approx((2.0**2 - 1.2**2) / (2.0**2 - 1.0))


def test_where_usual_errors_are_below_the_noise_one_event_counts_as_four_times_that() -> None:
    rest = np.full((20 * EVENT_BINS, 2), 0.1)
    rest[:EVENT_BINS] = 10.0
    assert size_of(rest, np.ones(2), EVENT_BINS) == pytest.approx(np.sqrt((19 * 0.01 + 4.0) / 20))


def test_the_size_of_an_error_is_its_root_mean_square_where_no_moment_stands_out() -> None:
    rest = np.random.default_rng(2).standard_normal((20 * EVENT_BINS + 7, 2)) * [3.0, 8.0]
    floor = np.array([1.0, 2.0])
    plain = float(np.sqrt(((rest / floor) ** 2).mean()))
    assert size_of(rest, floor, EVENT_BINS) == pytest.approx(plain, rel=1e-6)
    assert size_of(0.2 * rest, floor, EVENT_BINS) == pytest.approx(0.2 * plain, rel=1e-6)


def test_what_acts_most_is_what_base_numbers_cannot_absorb() -> None:
    """A change of inertia within robot.toml's deviations is theirs; a latency is next to nobody else's."""
    log = log_from_columns(make(4, seconds=8.0).columns, ROBOT)
    real = make_problem(log, ROBOT, tuple(CAUSES.values()))
    search = start_search(real, make_probe_function(real))
    both = {"drive.inertia": np.array([0.05]), "actuation.latency": np.array([1.0])}
    point = Point(np.zeros(len(real.base)), both)
    found = contributions(replace(search, fit=replace(search.fit, point=point)))
    changes = real.predict([point, *(point.without_cause(name) for name in both)])
    floor = np.sqrt((search.linear.residual**2).mean(axis=0))
    whole = [np.sqrt((((changes[0] - each) / floor) ** 2).mean()) for each in changes[1:]]
    assert found["drive.inertia"].unabsorbed < 0.5 * whole[0]
    assert 0.5 * whole[1] < found["actuation.latency"].unabsorbed < whole[1]
    most = [np.sqrt((((changes[0] - each) / floor) ** 2).mean(axis=0).max()) for each in changes[1:]]
    assert [found[name].change for name in both] == pytest.approx(most, rel=0.01)
    fitted = fitted_bins(real.features)
    assert fitted[: int(fitted.sum())].all()
    assert fitted.mean() == pytest.approx(0.7, abs=0.01)
    white, own = search.whitener.restricted_to_bins(fitted)(search.linear.jacobian), search.linear.jacobian
    factor = np.linalg.inv(np.linalg.cholesky(np.eye(len(own)) + white @ white.T))
    unsure = (np.tensordot(factor, own, axes=1) ** 2).sum(axis=0)  # of a fit of the first part
    np.testing.assert_allclose(
        _expected_variance(search, fitted), search.whitener.held_out_variance + unsure, rtol=1e-6
    )
    rough = replace(search.linear, residual=3.0 * search.linear.residual)
    less = contributions(replace(search, fit=replace(search.fit, point=point), linear=rough))
    assert less["actuation.latency"].unabsorbed == pytest.approx(
        found["actuation.latency"].unabsorbed / 3.0, rel=0.05
    )
    assert less["actuation.latency"].change == pytest.approx(most[1] / 3.0, rel=0.01)


@pytest.mark.parametrize(("place", "left"), [(-3.5, 0.0), (0.0, 0.0), (3.0, 0.5), (3.5, 1.0)])
def test_a_base_number_absorbs_as_far_as_it_may_go_from_where_it_is(place: float, left: float) -> None:
    """A cause does what a deviation more of a number does, which may be 3.5 of them off."""
    column = np.random.default_rng(7).normal(size=(40, 1))
    point = Point(np.array([place]), {"a": np.array([1.0])})
    search = SimpleNamespace(
        problem=SimpleNamespace(
            base=(None,),
            features=SimpleNamespace(floors=np.zeros(1)),
            limits=lambda _: (np.array([-3.5]), np.array([3.5])),
            predict=lambda points: np.stack([len(each.active) * column for each in points]),
        ),
        fit=SimpleNamespace(point=point),
        linear=SimpleNamespace(residual=np.ones((40, 1)), jacobian=column[None]),
    )
    whole = float(np.sqrt((column**2).mean()))
    found = contributions(cast(Search, search))["a"]
    assert found.change == pytest.approx(whole)
    assert found.unabsorbed == pytest.approx(left * whole, abs=1e-6)


def test_another_factor_on_the_gyro_is_judged_by_half_seconds_of_whole_swings_as_well() -> None:
    width, bins = 0.16, 60
    residual = np.random.default_rng(3).standard_normal((bins, 2))
    residual[: bins_per_event(width)] *= 30.0  # a wheel that broke loose a moment late
    names, nothing = ("motor.0.bemf", "imu.gyro.z"), np.zeros(bins)
    time = np.asarray(width * np.arange(bins), np.float64)
    curves = [Curve(name, "", time, residual[:, index], nothing, nothing) for index, name in enumerate(names)]
    results = [ChannelResult(name, "", 1.0, 1.0, 1.0, 0.5) for name in names]
    found = GyroRescaling(tuple(results), tuple(curves)).residual_size(1.0)
    assert bins_per_event(width) == 3
    assert found == pytest.approx(size_of(residual, np.ones(2), 3))
    assert found < 1.3
