"""A battery that gives way while the robot drives."""

from fault_cases import Bench, Case, sag
from raccoon.core.readings import Fault


def test_a_battery_that_sags_makes_no_motors_odd() -> None:
    """For a tenth of a second they get less than they were meant to: it looked like a fifth of the load."""
    bench = Bench(Case("", "degraded", Fault.BROWN_OUT, sag(4.5)), 21)
    bench.drive()
    assert bench.robot is not None
    assert list(bench.robot.drive.remarks) == [Fault.BROWN_OUT]
