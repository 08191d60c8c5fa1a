"""The fault table: no fault ends in a wrong pose that is called good, or in a motor that runs on.

Each fault with one firmware, in turn; `python benchmarks/faults.py` runs each with every one.
"""

import pytest

from fault_cases import CASES, Case, is_as_documented, run
from raccoon.hal.wombat.emulator import Firmware

ROWS = [
    pytest.param(case, firmware, id=f"{case.name}-{firmware}")
    for number, case in enumerate(CASES)
    for firmware in [case.firmwares[number % len(case.firmwares)]]
]


@pytest.mark.parametrize(("case", "firmware"), ROWS)
def test_every_fault_ends_as_documented(case: Case, firmware: Firmware) -> None:
    result = run(case, firmware)
    assert not result.running
    assert is_as_documented(case, result), result
