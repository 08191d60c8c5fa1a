"""What the pauses of a controller make of a robot's numbers."""

from dataclasses import replace

import pytest

from raccoon.core.config import RobotConfig
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.effects.physical import plant_numbers
from raccoon.sim.plant.quantities import Plant

STOCK = Chain.stock()
MODEL = RobotConfig().model


def plant(chain: Chain, inertia: float = 1.0) -> Plant:
    robot = Parameters.from_robot(RobotConfig()).with_effect("drive.inertia", factor=inertia)
    return plant_numbers(robot.with_chain(chain))


def test_motors_that_pause_together_draw_all_of_their_current_in_the_rest_of_the_time() -> None:
    """Currents are means over the pauses: in three quarters of the time a third more of it flows."""
    nominal = MODEL.battery.internal_resistance.value
    assert plant(STOCK).internal_resistance == pytest.approx(nominal / 0.76)
    assert plant(replace(STOCK, together=False)).internal_resistance == nominal


@pytest.mark.parametrize("inertia", [1.0, 2.0])
def test_a_wheel_is_slowed_by_half_of_what_it_loses_in_a_pause(inertia: float) -> None:
    """A N m that one motor does not give turns both wheels: half of the robot's way and half of its turn."""
    straight, turn = (
        1.0 / (inertia * each.value) for each in (MODEL.drive.inertia_straight, MODEL.drive.inertia_turn)
    )
    both, alone = plant(STOCK, inertia), plant(replace(STOCK, together=False), inertia)
    half = 0.5 * STOCK.pause
    assert (both.dip_own, both.dip_other) == pytest.approx(
        (half * 0.5 * (straight + turn), half * 0.5 * (straight - turn))
    )
    assert (alone.dip_own, alone.dip_other) == pytest.approx((both.dip_own, 0.0))
