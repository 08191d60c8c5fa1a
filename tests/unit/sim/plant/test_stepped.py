"""One step at a time: the plant's own equations, to the last bit, with numba and without."""

import pytest

from raccoon.core.config import RobotConfig
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.effects.physical import plant_numbers, state_at_rest
from raccoon.sim.plant.equations import substep
from raccoon.sim.plant.quantities import Command, Plant, State
from raccoon.sim.plant.sensing import duty_at_motor
from raccoon.sim.plant.stepped import Steps

SAMPLED = State._fields.index("sampled_left")
"""From here on a state holds what a controller sampled."""
DRIVES: tuple[tuple[float, float | None, float | None], ...] = (
    (0.0012, 0.8, 0.6), (0.0025, 0.8, -0.6), (0.0004, None, None), (0.0012, 0.0, None), (0.002, 0.01, 0.4),
)  # fmt: skip
"""s, duties."""


@pytest.fixture
def plant() -> Plant:
    robot = Parameters.from_robot(RobotConfig())
    for effect, numbers in {
        "actuation.deadband": {"duty": 0.03},
        "drive.backlash": {"angle": 0.02},
        "motor.current_limit": {"limit": 1.5},
        "imu.latency": {"seconds": 0.004},
    }.items():
        robot = robot.with_effect(effect, None, **numbers)
    return plant_numbers(robot)


def _by_equations(plant: Plant) -> list[State]:
    states = [state_at_rest(plant)]
    for seconds, left, right in DRIVES * 40:
        command = Command(
            duty_at_motor(left or 0.0, plant.deadband_left, 1.0, 1.0),
            duty_at_motor(right or 0.0, plant.deadband_right, 1.0, 1.0),
            float(left is not None), float(right is not None), 0.0, 0.0, 0.0,
        )  # fmt: skip
        states.append(substep(states[-1], plant, command, seconds, 1.0 / seconds))
    return states


def _by_steps(plant: Plant) -> list[State]:
    steps, states = Steps(), [state_at_rest(plant)]
    for seconds, left, right in DRIVES * 40:
        states.append(steps.after(states[-1], plant, seconds, left, right))
    return states


def _motion(states: list[State]) -> list[tuple[float, ...]]:
    return [each[:SAMPLED] for each in states]


def test_compiled_it_is_the_equations(plant: Plant) -> None:
    assert _motion(_by_steps(plant)) == _motion(_by_equations(plant))


def test_it_is_without_numba(plant: Plant, without_numba: None) -> None:
    assert _motion(_by_steps(plant)) == _motion(_by_equations(plant))


def test_what_it_is_given_counts_and_not_what_it_gave_last(plant: Plant) -> None:
    other = plant._replace(coulomb_left=2.0 * plant.coulomb_left)
    steps, one, two = Steps(), [state_at_rest(plant)], [state_at_rest(other)]
    for seconds, left, right in DRIVES * 4:
        one.append(steps.after(one[-1], plant, seconds, left, right))
        two.append(steps.after(two[-1], other, seconds, left, right))
    assert one == _by_steps(plant)[: len(one)]
    assert two == _by_steps(other)[: len(two)]
