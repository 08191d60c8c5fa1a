"""How a number goes from recording to recording, and how seldom a steady one seems to change."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from raccoon.diagnose.fleet.change_points import Piece, fit_pieces, typical_values

Array = NDArray[np.float64]
KINDS = ("scattered", "heavy-tailed", "now and then", "one odd", "two odd, apart")


def steady(kind: str, count: int, rng: np.random.Generator) -> Array:
    """Numbers that scatter more than they say, that are named on and off, or of which one or two are off."""
    series = 1.0 + 0.03 * rng.standard_normal(count)
    if kind == "heavy-tailed":
        series = 1.0 + 0.03 * rng.standard_t(2, count)
    elif kind == "now and then":
        series = np.where(rng.random(count) < 0.3, 1.0, 1.03 + 0.01 * rng.standard_normal(count))
    elif kind == "one odd":
        series[rng.integers(count)] += 1.0
    elif kind == "two odd, apart":
        series[[1, count - 2]] += 1.0
    return series


def test_a_steady_number_does_not_change() -> None:
    rng = np.random.default_rng(3)
    courses = [fit_pieces((1.0 + 0.05 * rng.standard_normal(12)).tolist(), [0.05] * 12) for _ in range(100)]
    assert sum(map(bool, courses)) <= 1
    assert fit_pieces([1.0, 1.0], [0.1, 0.1]) == ()
    assert fit_pieces([1.0] * 9, [0.0] * 9) == ()


@pytest.mark.parametrize("count", [5, 12])
@pytest.mark.parametrize("kind", KINDS)
def test_a_steady_series_is_hardly_ever_said_to_change(count: int, kind: str) -> None:
    rng = np.random.default_rng(count)
    said = sum(bool(fit_pieces(steady(kind, count, rng).tolist(), [0.01] * count)) for _ in range(66))
    assert said <= 2


@pytest.mark.parametrize("count", [5, 6])
def test_few_numbers_that_say_no_deviation_seem_to_change_in_one_of_a_hundred(count: int) -> None:
    """What five numbers leave of their scatter is often far too small: 3.8 % seemed to jump or creep."""
    rng = np.random.default_rng(count)
    silent = [float("nan")] * count
    said = sum(
        bool(fit_pieces((1.0 + 0.01 * rng.standard_normal(count)).tolist(), silent)) for _ in range(400)
    )
    assert said <= 6
    one, two = (level + 0.01 * rng.standard_normal(count) for level in (1.0, 1.3))
    before, after = fit_pieces([*one[:3], *two[3:]], silent)
    assert (before.last, after.first) == (2, 3)
    assert not before.creeps


@pytest.mark.parametrize("count", [8, 11, 20])
@pytest.mark.parametrize(
    ("rate", "jumps", "size"),
    [(0.0, 1, 0.05), (0.0, 2, -0.05), (0.012, 0, 0.0), (0.012, 1, -0.05), (-0.01, 1, 0.05)],
)
def test_what_was_done_to_a_number_is_found(count: int, rate: float, jumps: int, size: float) -> None:
    """Steps, a step there and back, creeping, and creeping with a part replaced; none missed of 20 draws."""
    places = [(each + 1) * count // (jumps + 1) for each in range(jumps)]
    rows = np.arange(count)
    truth = 1.0 + rate * rows + size * sum((rows >= at) * (-1.0) ** k for k, at in enumerate(places))
    for seed in range(20):
        rng = np.random.default_rng([seed, count])
        found = fit_pieces((truth + 0.002 * rng.standard_normal(count)).tolist(), [0.003] * count)
        assert [each.first for each in found] == [0, *places]
        assert all(each.creeps == (rate != 0.0) for each in found)
        for each in found:
            assert (each.start, each.end) == pytest.approx((truth[each.first], truth[each.last]), abs=0.006)


def test_what_creeps_is_no_staircase() -> None:
    """A battery that runs down faster at first is a line without a jump."""
    rng = np.random.default_rng(6)
    for _ in range(50):
        series = 1.0 + 0.3 * np.exp(-np.arange(15) / 30.0) + 0.004 * rng.standard_normal(15)
        (piece,) = fit_pieces(series.tolist(), [0.005] * 15)
        assert piece.creeps


def test_numbers_that_are_not_known_are_left_out() -> None:
    nan = float("nan")
    series = [1.0, nan, 1.001, 0.999, nan, 1.1, 1.101, nan, 1.1]
    before, after = fit_pieces(series, [0.002] * 9)
    assert (before.first, before.last, after.first, after.last) == (0, 3, 5, 8)


def test_numbers_without_any_scatter_change_where_they_do_and_nowhere_else() -> None:
    """What rounding leaves of them was a jump in every thirtieth step and every eighth line."""
    rng = np.random.default_rng(9)
    for _ in range(100):
        before, after = rng.integers(3, 7, 2)
        low, high = rng.normal(size=2).tolist()
        found = fit_pieces([low] * before + [high] * after, [0.0] * (before + after))
        assert [(each.first, each.creeps) for each in found] == [(0, False), (before, False)]
        (piece,) = fit_pieces((low + high * np.arange(before + after)).tolist(), [0.0] * (before + after))
        assert piece.creeps
    assert fit_pieces([0.3, 0.3, 0.3, 0.1 + 0.2, 0.1 + 0.2, 0.1 + 0.2], [0.0] * 6) == ()


def test_beside_an_odd_number_the_others_must_jump_by_ten_deviations() -> None:
    """Of the difference of their means, by what they say of themselves where they do not scatter."""
    std = 0.01
    least = 10.0 * std * np.sqrt(1.0 / 12.0 + 1.0 / 7.0)
    for jump, found in ((0.98, []), (1.02, [0, 13])):
        series = np.where(np.arange(19) < 12, 1.0, 1.0 + jump * least)
        course = fit_pieces(np.insert(series, 5, 0.5).tolist(), [std] * 20)
        assert [each.first for each in course] == found


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_the_unit_does_not_matter(scale: float) -> None:
    rng = np.random.default_rng(8)
    series = 1.0 + 0.02 * np.arange(9) - 0.1 * (np.arange(9) >= 5) + 0.002 * rng.standard_normal(9)
    plain = fit_pieces(series.tolist(), [0.002] * 9)
    scaled = fit_pieces((scale * series).tolist(), [scale * 0.002] * 9)
    assert len(plain) == 2
    for one, two in zip(plain, scaled, strict=True):
        assert (two.first, two.last) == (one.first, one.last)
        assert (two.start, two.end) == pytest.approx((scale * one.start, scale * one.end))


def test_what_is_usual_is_the_middle_of_a_steady_piece_and_the_line_of_one_that_creeps() -> None:
    rows, values = np.arange(6), np.array([1.0, 1.1, 9.0, 2.0, 2.5, 3.5])
    course = (Piece(0, 2, 3.7, 3.7), Piece(3, 5, 2.0, 3.0))
    assert typical_values(rows, values, rows, course) == pytest.approx([1.1, 1.1, 1.1, 2.0, 2.5, 3.0])
    assert typical_values(rows, values, rows, ()) == pytest.approx([2.25] * 6)
