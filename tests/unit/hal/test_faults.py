"""The fault table: no fault ends in a wrong pose that is called good, or in a motor that runs on."""

import pytest

from fault_cases import CASES, Case, Result, run
from raccoon.hal.wombat.emulator import Firmware

ROWS = [
    pytest.param(case, firmware, id=f"{case.name}-{firmware}")
    for case in CASES
    for firmware in case.firmwares
]
GOOD_ERROR_MM = 15.0
"""What the filter lag of the board makes of a pose at full speed, and a fault within its first cycles."""


@pytest.mark.parametrize(("case", "firmware"), ROWS)
def test_every_fault_ends_as_documented(case: Case, firmware: Firmware) -> None:
    result: Result = run(case, firmware)
    assert result.reaction == case.reaction, result
    if case.expect is not None:
        named = result.error is not None and result.error.startswith(case.expect)
        assert named or case.expect in result.faults, result
    assert result.good_error_mm < GOOD_ERROR_MM, result
    assert not result.running
