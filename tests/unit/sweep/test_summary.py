"""How often it fails, and what that depends on."""

import math
from typing import Any

import numpy as np
import pytest

from raccoon.sweep.summary import Rate, summary

NAMES = ("left", "both_ends", "switch", "nothing", "constant")


@pytest.mark.parametrize(
    ("failed", "played", "low", "high"),
    # Wilson's interval as in statistical tables (checked with scipy.stats.binomtest's "wilson").
    [(0, 10, 0.0, 0.2775), (10, 10, 0.7225, 1.0), (37, 200, 0.1373, 0.2446), (1, 3, 0.0615, 0.7923)],
)
def test_interval(failed: int, played: int, low: float, high: float) -> None:
    assert Rate(failed, played).interval == pytest.approx((low, high), abs=1e-4)


def test_a_program_that_always_fails_may_do_so_always() -> None:
    for count in (1, 10, 117, 200):
        assert Rate(0, count).interval[0] == 0.0
        assert Rate(count, count).interval[1] == 1.0


def test_interval_is_that_of_scipy() -> None:
    stats = pytest.importorskip("scipy.stats")
    theirs = stats.binomtest(23, 117).proportion_ci(method="wilson")
    assert Rate(23, 117).interval == pytest.approx((theirs.low, theirs.high), abs=1e-6)


def test_interval_holds_the_truth_as_often_as_it_says() -> None:
    random = np.random.default_rng(3)
    hits = [
        low <= 0.1 <= high
        for low, high in (Rate(int(random.binomial(100, 0.1)), 100).interval for _ in range(2000))
    ]
    assert np.mean(hits) == pytest.approx(0.95, abs=0.02)


def rows_of(count: int, fails: Any, seed: int = 1) -> list[dict[str, Any]]:
    random = np.random.default_rng(seed)
    rows = []
    for _ in range(count):
        values = dict(zip(NAMES, random.uniform(-1.0, 1.0, len(NAMES)), strict=True))
        values |= {"switch": float(values["switch"] > 0.6), "constant": 2.0}
        failed = bool(fails(values, random))
        rows.append(
            {
                "status": "failed" if failed else "ok",
                "reason": "ZeroDivisionError: division" if failed else "",
                "position_error": abs(values["left"]) * 0.01,
                **values,
            }
        )
    return rows


def test_it_names_what_failures_depend_on_also_at_both_ends() -> None:
    def fails(values: dict[str, float], random: np.random.Generator) -> bool:
        return bool(random.uniform() < 0.02 + 0.5 * (abs(values["both_ends"]) > 0.7) + 0.3 * values["switch"])

    rows = rows_of(600, fails)
    found = summary(rows, NAMES)
    assert found.of == "failure"
    assert {each.name for each in found.sensitivities[:2]} == {"both_ends", "switch"}
    assert all(each.is_clear for each in found.sensitivities[:2])
    assert not any(each.is_clear for each in found.sensitivities[2:])
    assert {each.name for each in found.sensitivities} == {"left", "both_ends", "switch", "nothing"}
    (switch,) = (each for each in found.sensitivities if each.name == "switch")
    of_both = [[row["status"] == "failed" for row in rows if row["switch"] == on] for on in (0.0, 1.0)]
    assert switch.groups == tuple((on, on, np.mean(each)) for on, each in enumerate(of_both))
    assert found.reasons[0][0] == "ZeroDivisionError"


def few(values: list[float], failed: list[int]) -> list[dict[str, Any]]:
    """Matches of one parameter, of which the numbers `failed` failed."""
    return [
        {"status": "failed" if run in failed else "ok", "reason": "", "position_error": math.nan, "a": value}
        for run, value in enumerate(values)
    ]


def test_share_and_chance_are_those_of_the_analysis_of_variance() -> None:
    stats = pytest.importorskip("scipy.stats")
    values = [0.0] * 8 + [1.0] * 10 + [2.0] * 6
    failed = [0, 1, 2, 8, 9, 18, 19, 20, 21]
    (found,) = summary(few(values, failed), ["a"]).sensitivities
    groups = [
        [float(run in failed) for run, each in enumerate(values) if each == value] for value in (0, 1, 2)
    ]
    assert found.chance == pytest.approx(stats.f_oneway(*groups).pvalue)
    within = sum(np.var(each) * len(each) for each in groups)
    expected = 1.0 - (within / (24 - 3)) / (np.var(np.concatenate(groups)) * 24 / (24 - 1))
    assert found.share == pytest.approx(expected)


def test_the_chance_of_groups_of_unlike_sizes_is_counted_and_not_guessed() -> None:
    """Of 100 matches 3, 1 and 1 failed in groups of 80, 18 and 2. Dealt out at random, groups explain as much
    or more in 10.1 % of all ways (counted one by one); the F test says 1.1 %."""
    values = [0.0] * 80 + [1.0] * 18 + [2.0] * 2
    failed = [0, 1, 2, 80, 98]
    found = summary(few(values, failed), ["a"] * 4).sensitivities[0]
    assert found.chance == pytest.approx(4 * 0.101, abs=0.12)
    others = [run for run in range(100) if run not in failed]  # what they depend on is the same
    assert summary(few(values, others), ["a"] * 4).sensitivities[0].chance == pytest.approx(found.chance)


def test_chance_is_not_taken_for_a_cause() -> None:
    clear = [
        any(
            each.is_clear
            for each in summary(rows_of(100, lambda _, r: r.uniform() < 0.3, seed), NAMES).sensitivities
        )
        for seed in range(200)
    ]
    assert np.mean(clear) < 0.1


def test_a_fault_of_one_match_that_failed_like_others_is_within_chance() -> None:
    """One of 120 matches has the fault, and is one of the six that fail: as likely as not with six faults."""
    rows = rows_of(120, lambda *_: False)
    for number in range(0, 120, 20):
        rows[number]["status"] = "failed"
    named = {f"fault.{number}": number for number in (0, 1, 2, 3, 4, 5)}  # of which the first one fails
    rows = [{**row, **{name: float(at == run) for name, at in named.items()}} for run, row in enumerate(rows)]
    found = {each.name: each for each in summary(rows, (*NAMES, *named)).sensitivities}
    assert found["fault.0"].share > 0.1
    assert not found["fault.0"].is_clear
    for number in range(0, 120, 20):  # as it is where all that fail have it
        rows[number]["fault.0"] = 1.0
    found = {each.name: each for each in summary(rows, (*NAMES, *named)).sensitivities}
    assert found["fault.0"].is_clear


def test_with_hardly_a_failure_the_distance_from_the_goal_tells() -> None:
    found = summary(rows_of(200, lambda *_: False), NAMES)
    assert (found.of, found.sensitivities[0].name) == ("error", "left")
    assert found.rate.interval[1] < 0.02


def test_with_nothing_to_say_it_says_nothing() -> None:
    rows = [{**row, "position_error": math.nan} for row in rows_of(30, lambda *_: False)]
    assert summary(rows, NAMES).sensitivities == ()
    assert summary([], NAMES).rate.interval == (0.0, 1.0)
