"""How often RaccoonOS updates its counters, as it is seen in them."""

import pytest

from raccoon.hal.wombat.firmware.raccoon.rate import CounterRate


def test_a_rate_needs_motion() -> None:
    rate = CounterRate()
    for _ in range(200):
        rate.update((0, 0, 0, 0), (0.0,) * 4, 0.005)
    assert rate.rate_hz is None
    for _ in range(200):
        rate.update((400 * 9, 0, 0, 0), (400.0, 0.0, 0.0, 0.0), 0.05)
    assert rate.rate_hz == pytest.approx(180.0)
