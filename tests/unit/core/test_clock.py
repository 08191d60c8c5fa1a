"""Deadlines are absolute."""

import pytest

from raccoon.core.clock import SteppedClock, Ticker


def test_lateness_does_not_accumulate() -> None:
    clock = SteppedClock(10.0)
    ticker = Ticker(0.005, clock)
    for tick in range(1, 1001):
        clock.advance(0.003 if tick % 2 else 0.0069)  # every other cycle overruns a little
        ticker.wait()
    # 500 cycles of work 3 ms and 500 of 6.9 ms average 4.95 ms: the schedule holds on the whole.
    assert clock.now() == pytest.approx(10.0 + 1000 * 0.005, abs=0.005)


def test_missed_deadlines_are_counted_and_skipped() -> None:
    clock = SteppedClock()
    ticker = Ticker(0.01, clock)
    clock.advance(0.035)
    assert ticker.wait() == 2
    assert clock.now() == pytest.approx(0.035)
    assert ticker.wait() == 0
    assert clock.now() == pytest.approx(0.04)


def test_stepped_clock_refuses_to_go_back() -> None:
    with pytest.raises(ValueError, match="only goes forward"):
        SteppedClock().advance(-1.0)


@pytest.mark.parametrize("period", [0.0, -1.0, float("nan")])
def test_period_must_be_positive(period: float) -> None:
    with pytest.raises(ValueError, match="above 0"):
        Ticker(period, SteppedClock())
