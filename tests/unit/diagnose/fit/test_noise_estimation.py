"""Noise is what cannot be foreseen, not what a fit of everything leaves."""

from __future__ import annotations

from itertools import pairwise
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from raccoon.diagnose.fit.cross_validation import (
    MIN_HELD_OUT_SHARE,
    RecordingPart,
    _influence,
    held_out_error,
    log_evidence_of_wander,
)
from raccoon.diagnose.fit.evidence import Gram
from raccoon.diagnose.fit.noise_estimation import (
    EXEMPT_RESPONSE_RMS,
    FORM_ERROR_RMS,
    MAX_FORM_ERROR_FACTOR,
    MAX_FORM_ERROR_WIDTHS,
    WANDER_SHARES,
    _estimate_unexplained,
    active_response_rms,
    classify_regimes,
    expected_wander_share,
    form_error_parts,
)
from raccoon.diagnose.fit.noise_model import CHANGING, EVENT_BINS, STEADY, white_noise
from raccoon.diagnose.fit.problem import Problem
from raccoon.diagnose.fit.wander import Piece

BINS, CHANNELS = 6 * EVENT_BINS, 2


def foreseen(columns: np.ndarray, target: np.ndarray, sizes: float | np.ndarray = 1.0) -> np.ndarray:
    part = RecordingPart.of(columns, columns, target, target, 0)
    return held_out_error([part], np.broadcast_to(sizes, len(columns)), 1.0, EVENT_BINS)


@pytest.mark.parametrize(("directions", "rows"), [(3, 50), (50, 3), (12, 12)])
@pytest.mark.parametrize("seen", [0.5, 1.0])
def test_fewer_directions_than_rows_are_as_many_equations(directions: int, rows: int, seen: float) -> None:
    """seen: the largest part of a direction that only this half second shows; all of it is not foreseen."""
    rng = np.random.default_rng(4)
    part = rng.normal(size=(directions, rows))
    part *= np.sqrt(seen) / np.linalg.norm(part, 2)
    rest = rng.normal(size=rows)
    shares, vectors = np.linalg.eigh(np.eye(rows) - part.T @ part)
    wanted = part @ (vectors @ ((vectors.T @ rest) / np.maximum(shares, MIN_HELD_OUT_SHARE)))
    np.testing.assert_allclose(_influence(part, rest), wanted, rtol=1e-8, atol=1e-8)


def test_a_prior_is_as_wide_as_its_size_says() -> None:
    rng = np.random.default_rng(6)
    columns, target = rng.standard_normal((5, BINS, CHANNELS)), rng.standard_normal((BINS, CHANNELS))
    sizes = np.array([1.0, 0.05, 0.3, 2.0, 1e-6])
    narrow = foreseen(columns, target, sizes)
    assert narrow == pytest.approx(foreseen(columns * sizes[:, None, None], target))
    assert narrow != pytest.approx(foreseen(columns, target), abs=1e-3)


def test_each_half_second_is_foreseen_by_a_fit_of_all_others() -> None:
    rng = np.random.default_rng(1)
    columns = rng.standard_normal((5, BINS, CHANNELS))
    target = rng.standard_normal((BINS, CHANNELS))
    error = foreseen(columns, target)
    for start in range(0, BINS, EVENT_BINS):
        inside = np.zeros(BINS, bool)
        inside[start : start + EVENT_BINS] = True
        x, y = columns[:, ~inside].reshape(5, -1), target[~inside].reshape(-1)
        mean = np.linalg.solve(np.eye(5) + x @ x.T, x @ y)
        direct = target[inside] - np.tensordot(mean, columns[:, inside], axes=1)
        assert error[inside] == pytest.approx(direct)


def test_what_wanders_in_a_part_is_foreseen_there_and_the_rest_from_everywhere() -> None:
    """Equal to one fit of all columns, those of a part being 0 elsewhere."""
    rng = np.random.default_rng(3)
    known, target = rng.standard_normal((4, BINS, CHANNELS)), rng.standard_normal((BINS, CHANNELS))
    edges = (0, 2 * EVENT_BINS, 5 * EVENT_BINS, BINS)
    sizes, wander = np.array([1.0, 0.3, 2.0, 0.1]), 0.7
    parts, every = [], [known]
    for start, stop in pairwise(edges):
        slow = rng.standard_normal((3, stop - start, CHANNELS))
        columns = np.concatenate([slow, known[:, start:stop]])
        parts.append(RecordingPart.of(columns, columns, target[start:stop], target[start:stop], 3))
        wide = np.zeros((3, BINS, CHANNELS))
        wide[:, start:stop] = slow
        every.append(wide)
    whole = np.concatenate(every)
    error = held_out_error(parts, sizes, wander, EVENT_BINS)
    np.testing.assert_allclose(
        error, foreseen(whole, target, np.concatenate([sizes, np.full(9, wander)])), rtol=1e-6, atol=1e-9
    )
    gram = Gram.of(whole.reshape(len(whole), -1).T, target.reshape(-1))
    evidence = gram.scaled(np.concatenate([np.ones(4), np.full(9, wander)])).evidence()
    assert log_evidence_of_wander(parts, wander) == pytest.approx(evidence)


def test_noise_in_a_moment_in_which_everything_acts_is_not_swallowed() -> None:
    """A fit of forty directions that act in one event leaves almost nothing of the noise there."""
    rng = np.random.default_rng(2)
    columns = 0.01 * rng.standard_normal((40, BINS, CHANNELS))
    columns[:, :EVENT_BINS] *= 1000.0
    noise = rng.standard_normal((BINS, CHANNELS))
    flat = columns.reshape(40, -1)
    fitted = np.linalg.solve(np.eye(40) + flat @ flat.T, flat @ noise.reshape(-1))
    left = noise - np.tensordot(fitted, columns, axes=1)
    assert left[:EVENT_BINS].std() < 0.6
    assert foreseen(columns, noise)[:EVENT_BINS].std() > 0.9


def test_how_much_a_floor_wanders_is_what_is_expected_not_what_is_likeliest() -> None:
    known = [0.0 if share == 0.04 else -1000.0 for share in WANDER_SHARES]
    assert expected_wander_share(known) == pytest.approx(0.04)
    nobody_knows = expected_wander_share([5.0] * len(WANDER_SHARES))
    assert nobody_knows == pytest.approx(np.sqrt(np.mean(np.square(WANDER_SHARES))))
    a_little_for_none = expected_wander_share([-0.5 * share / 0.02 for share in WANDER_SHARES])
    assert 0.015 < a_little_for_none < nobody_knows


def test_a_direction_that_one_moment_alone_shows_tells_no_noise() -> None:
    """A reading that jumps in one bin as soon as a number moves: what others foresee of it is the prior."""
    rng = np.random.default_rng(5)
    columns = rng.standard_normal((5, BINS, CHANNELS))
    columns[0] = 0.0
    columns[0, 30, 0] = 900.0
    noise = rng.standard_normal((BINS, CHANNELS))
    error = foreseen(columns, noise + 0.4 * columns[0])
    assert np.abs(error).max() < 5.0


def test_what_is_negligible_is_bounded_in_units_of_the_noise() -> None:
    rng = np.random.default_rng(3)
    base = np.zeros((1, 400, CHANNELS))
    strong = 5.0 * rng.standard_normal((1, 400, CHANNELS))
    weak = 0.1 * rng.standard_normal((1, 400, CHANNELS))
    size = float(np.sqrt((strong**2).mean()))
    assert form_error_parts(["actuation.latency"], base, strong)[0] == pytest.approx(FORM_ERROR_RMS / size)
    assert form_error_parts(["drive.inertia"], base, weak)[0] == pytest.approx(MAX_FORM_ERROR_WIDTHS)
    assert (
        form_error_parts(["imu.gyro_bias"], base, weak)[0] < MAX_FORM_ERROR_WIDTHS
    )  # a reading's own error is known
    assert (
        form_error_parts(["drive.slope"], base, weak)[0] > MAX_FORM_ERROR_WIDTHS
    )  # no floor is as even as a model
    beside = form_error_parts(["actuation.latency"], base, strong, strength=3.0)[0]
    assert beside > form_error_parts(["actuation.latency"], base, strong)[0]  # what acts has a form error too
    spared = form_error_parts(["actuation.latency"], base, strong, strength=EXEMPT_RESPONSE_RMS)[0]
    assert spared == pytest.approx(FORM_ERROR_RMS / size)  # and the gates know of it
    assert form_error_parts(["actuation.latency"], base, strong, strength=1e9)[0] == pytest.approx(
        MAX_FORM_ERROR_FACTOR * FORM_ERROR_RMS / size
    )
    absorbed = form_error_parts(["actuation.latency"], strong, strong)[0]
    assert absorbed > form_error_parts(["actuation.latency"], base, strong)[0]  # base numbers do most of it


@pytest.mark.parametrize("width", [1.0, 0.25])
def test_base_numbers_take_of_a_column_what_they_can_under_their_priors(width: float) -> None:
    """Of one that is like a base number's, of length L, L / sqrt(1 + L^2) is left; of what is across all."""
    along, across = np.zeros((2, 1, 1, 4))
    along[..., 0], across[..., 1] = 3.0, 2.0
    column, size = along + across, 4 * width
    rms = np.sqrt((9.0 / (1.0 + 9.0) + 4.0) / size)
    assert form_error_parts(["actuation.latency"], along, column, width=width)[0] == pytest.approx(
        FORM_ERROR_RMS / rms
    )


@pytest.mark.parametrize("bins", [1, 4])
def test_a_ramp_is_a_change_in_bins_of_any_length(bins: int) -> None:
    """Of a fortieth of the largest reading in 20 ms it is not, of a thirtieth it is."""
    time = 0.02 / bins * np.arange(150 * bins)
    for rate, changes in ((1.0 / 40.0, False), (1.0 / 30.0, True)):
        ramp = np.clip(0.5 + rate * (time - 1.0) / 0.02, 0.5, 1.0)
        features = SimpleNamespace(
            roles=("bemf_left",), measured=300.0 * ramp[:, None], time=time, width=0.02 / bins
        )
        found = classify_regimes(cast(Problem, SimpleNamespace(features=features)))
        assert (found[(time > 1.1) & (time < 1.2)] == CHANGING).all() == changes
        assert (found[time < 0.9] == STEADY).all()


def test_a_cause_counts_for_as_much_as_its_form_is_inexact() -> None:
    response = np.ones((BINS, CHANNELS))
    noise = white_noise(np.full(CHANNELS, 0.5), np.zeros(BINS, np.intp))
    assert active_response_rms({}, noise) == 0.0
    assert active_response_rms({"friction.load_dependent": response}, noise) == pytest.approx(2.0)
    assert active_response_rms({"actuation.latency": response}, noise) < 0.5
    both = {"friction.load_dependent": response, "friction.coulomb": 2.0 * response}
    assert active_response_rms(both, noise) == pytest.approx(np.hypot(2.0, 4.0))


def test_what_a_drive_shows_once_is_not_foreseen_from_elsewhere() -> None:
    """Where each half second has directions of its own beside one for all, what these may be is no noise."""
    rng = np.random.default_rng(4)
    own, none = rng.standard_normal((1, BINS, CHANNELS)), np.zeros((0, BINS, CHANNELS))
    slow = [Piece(slice(0, BINS), 0, none, none)]
    noise = white_noise(np.ones(CHANNELS), np.zeros(BINS, np.intp))
    target = 0.5 * own[0] + rng.standard_normal((BINS, CHANNELS))
    level = np.ones((BINS, CHANNELS))
    once = 0.3 * np.cumsum(rng.standard_normal((100, BINS, CHANNELS)), axis=1)
    error, _ = _estimate_unexplained(noise, [own, once], slow, target, level, EVENT_BINS)
    alone, _ = _estimate_unexplained(noise, [own], slow, target, level, EVENT_BINS)
    usual = foreseen(np.concatenate([own, once]), target)
    size = [float(np.sqrt((each**2).mean())) for each in (usual, error, alone)]
    assert size[0] > 1.5  # a hundred numbers for six half seconds
    assert size[2] < size[1] < 1.1
    many = 0.003 * once  # of a drive that shows them well enough, all may differ as much as they may
    error, _ = _estimate_unexplained(noise, [own, many], slow, target, level, EVENT_BINS)
    assert error == pytest.approx(foreseen(np.concatenate([own, many]), target))
