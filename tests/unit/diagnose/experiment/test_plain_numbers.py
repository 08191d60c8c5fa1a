"""A drive is planned for a robot.toml as teams write it: numbers without a standard deviation."""

from raccoon.core.config import parse_robot
from raccoon.diagnose.experiment.advice import DrivePlan
from raccoon.diagnose.experiment.manoeuvres import manoeuvre


def test_a_plain_number_is_not_taken_for_an_exact_one() -> None:
    """The diagnosis refits it within the default's deviation, so less than that would not be named."""
    plain, known = (
        parse_robot({"model": {"battery": {"open_circuit_voltage": volts}}})
        for volts in (6.8, {"value": 6.8, "std": 0.03})
    )
    shown = [DrivePlan.of(robot, manoeuvre("steps")).visible_sizes() for robot in (plain, known)]
    assert shown[0] == shown[1]
