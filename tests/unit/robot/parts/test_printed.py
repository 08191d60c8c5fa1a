"""What a program prints of a robot's parts says what they are at."""

from raccoon.core.config import MechanismConfig, RobotConfig, ServoConfig, TophatConfig
from raccoon.robot.parts.mechanism import Mechanism
from raccoon.robot.parts.servos import Servo
from raccoon.robot.parts.tophats import TophatSensor


def test_a_part_that_is_printed_says_its_name_and_what_it_is_at() -> None:
    tophat, claw = TophatSensor("front", TophatConfig(analog=1)), Servo("claw", ServoConfig(port=0))
    arm = Mechanism("arm", MechanismConfig(motor=2), RobotConfig())
    assert str(tophat) == "<tophat front: None counts, not calibrated or not known, invalid>"
    assert str(claw) == "<servo claw: off>"
    assert str(arm) == "<mechanism arm: 0.000 rad, 0.00 rad/s, released>"
    tophat.counts = 1571.0
    claw.send(1200.0, 0.0)
    arm.count_from(0.5)
    assert str(tophat).startswith("<tophat front: 1571.0 counts, ")
    assert str(claw) == "<servo claw: 1200 us>"
    assert str(arm).startswith("<mechanism arm: 0.500 rad, ")
