"""What the stock firmware's counters tell of themselves."""

import pytest

from raccoon.hal.wombat.firmware.dialect import Reading
from raccoon.hal.wombat.firmware.stock.dialect import StockDialect


@pytest.mark.parametrize(
    ("first", "second", "seconds", "torn"),
    [
        (400, 400, 0.0002, False),
        (400, 790, 0.0002, False),  # an update fell between the looks
        (-400, -1150, 0.005, False),
        (0, 90, 0.0002, False),  # it starts
        (656, 400, 0.0002, True),
        (400, 144, 0.005, True),
        (20, 276, 0.0002, True),
    ],
)
def test_counters_that_count_on_between_two_looks_are_not_torn(
    first: int, second: int, seconds: float, torn: bool
) -> None:
    assert StockDialect().torn((0, first, 0, 0), (0, second, 0, 0), seconds) is torn


def test_two_updates_in_one_look_deserve_no_second_one() -> None:
    dialect = StockDialect(250.0)
    frame = Reading(b"", (), (0, 0, 0, 0), 0)
    dialect.bemf(frame, (0, 600, 0, 0), 0.004)
    assert not dialect.suspicious((0, 1190, 0, 0), 0.005)
    assert dialect.suspicious((0, 1190, 0, 0), 0.004)
    assert dialect.suspicious((0, 600 + 256, 0, 0), 0.005)
