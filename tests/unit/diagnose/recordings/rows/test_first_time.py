"""Times of a clock that counts from 1970."""

from __future__ import annotations

import numpy as np
import pytest

from raccoon.diagnose.recordings.rows.first_time import with_times_from_first_row

DATE = 1767182400.25


def test_dates_are_counted_from_the_first_row() -> None:
    seconds = np.linspace(0.0, 0.04, 5)
    columns, notes = with_times_from_first_row({"t": DATE + seconds, "analog.0": seconds})
    assert columns["t"] == pytest.approx(seconds, abs=3e-7)
    assert columns["analog.0"] is seconds
    assert notes == ("all times are from the first row on, whose t is 1767182400.250 s",)


@pytest.mark.parametrize(
    "time", [[], [86399.0, 86400.0], [DATE, DATE + 1.0, DATE + 0.5], [DATE, np.nan], [np.nan, DATE]]
)
def test_other_times_stay(time: list[float]) -> None:
    given = {"t": np.array(time)}
    assert with_times_from_first_row(given) == (given, ())
