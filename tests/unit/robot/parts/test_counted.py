"""The angle of a mechanism, across cycles in which its controller says nothing or restarts."""

import math

import pytest

from raccoon import RobotConfig, deg, move, open_robot
from raccoon.core.clock import SteppedClock
from raccoon.core.config import Measured, MechanismConfig, MotorConfig
from raccoon.core.readings import SIMULATOR, Fault, Inputs
from raccoon.hal.wombat.emulator import Emulator, Firmware
from raccoon.hal.wombat.port import WombatPort
from raccoon.robot.emulated import SimulatedPlant
from raccoon.robot.parts.counted import CountedAngle
from raccoon.sim.effects.parameters import Parameters

CONFIG = RobotConfig(mechanisms={"arm": MechanismConfig(motor=3)})
CYCLE = 0.005


class Restarting(WombatPort):
    """An emulated Wombat that restarts in its 40th cycle, in the middle of a move."""

    def __init__(self, firmware: Firmware) -> None:
        clock = SteppedClock()
        self.plant = SimulatedPlant(Parameters.from_robot(CONFIG))
        self.emulator = Emulator(self.plant, firmware, clock=clock)
        super().__init__(self.emulator, clock=clock)
        self.cycle = 0

    def read(self) -> Inputs:
        self.cycle += 1
        if self.cycle == 40:
            self.emulator.reset()
        return super().read()


@pytest.mark.parametrize("firmware", ["stock", 17, 21])
def test_an_arm_arrives_across_a_restart_and_it_is_said(firmware: Firmware) -> None:
    port = Restarting(firmware)
    with open_robot(CONFIG, port=port) as robot:
        robot.run(move("arm", deg(90.0)))
        assert math.degrees(port.plant.free_motors[3].angle) == pytest.approx(90.0, abs=2.0)
        (said,) = robot.drive.remarks.values()
        assert "restarted" in said
        assert "how far arm turned" in said


def test_a_known_offset_adds_nothing_in_a_gap() -> None:
    motor = MotorConfig(bemf_offset=Measured(50.0, 1.0))
    config = RobotConfig(motors={3: motor}, mechanisms=CONFIG.mechanisms)
    counted = CountedAngle(config, config.mechanisms["arm"], 1.0)
    ticks = 0.0
    for cycle in range(100):
        ticks += 50.0 * CYCLE / SIMULATOR.position_counts_seconds
        read = cycle % 10 == 0
        words = (None, None, None, ticks if read else None)
        counted.sense(Inputs(CYCLE * cycle, SIMULATOR, position=words), CYCLE, powered=True)
    assert counted.angle == pytest.approx(0.0, abs=1e-9)


def test_a_counter_that_jumped_goes_on_at_the_rate_before() -> None:
    counted = CountedAngle(CONFIG, CONFIG.mechanisms["arm"], 1.0)
    bemf = (None, None, None, 300.0)
    for cycle in range(2):
        faults = (Fault.POSITION_JUMP,) if cycle else ()
        position = (None, None, None, 7.0)
        counted.sense(
            Inputs(CYCLE * cycle, SIMULATOR, bemf=bemf, position=position, faults=faults), CYCLE, True
        )
    assert counted.angle == pytest.approx(counted.rate * CYCLE)
