"""The offset of a wheel's back-EMF, from what it reads at rest: right to what it says."""

import numpy as np
import pytest

from raccoon.estimate.drive_calibration.resting import resting_offset


def words_at_rest(offset: float, dead_zone: float, seed: int) -> list[float]:
    """A second of what a firmware makes of it: smoothed, fractions cut off, 0 within the dead zone."""
    random, smooth, words = np.random.default_rng(seed), offset, []
    for noise in random.normal(0.0, 4.0, 200):
        smooth += 0.2 * (offset + noise - smooth)
        words.append(float(int(smooth)) if abs(smooth) >= dead_zone else 0.0)
    return words


@pytest.mark.parametrize("dead_zone", [0.0, 25.0])
def test_an_offset_is_as_sure_as_it_says(dead_zone: float) -> None:
    """Whole words are cut towards 0, and at the edge of a dead zone some of them are 0: both hide a part of
    the offset that no number of readings brings back.
    """
    offsets = np.linspace(-60.0, 60.0, 121)
    found = [resting_offset(words_at_rest(each, dead_zone, 7), dead_zone) for each in offsets]
    off = [abs(each.value - true) / each.std for each, true in zip(found, offsets, strict=True) if each]
    assert len(off) == len(offsets)
    assert np.mean(np.less(off, 2.0)) > 0.95
    assert max(off) < 3.5


def test_an_offset_beyond_the_dead_zone_is_known_to_a_count() -> None:
    found = resting_offset(words_at_rest(40.0, 25.0, 1), 25.0)
    assert found is not None
    assert found.value == pytest.approx(40.0, abs=1.5)
    assert found.std < 1.0
