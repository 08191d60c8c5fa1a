"""What holds for any robot and any command: no energy from nothing, no difference between left and right."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.effects.physical import plant_numbers, state_at_rest
from raccoon.sim.plant import driver
from raccoon.sim.plant.friction import settled
from raccoon.sim.plant.quantities import Plant, Rubbing, State

Array = NDArray[np.float64]

ROWS = 40
TIME = [0.005 * row for row in range(ROWS + 1)]
DUTIES = st.lists(st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0)), min_size=4, max_size=4)


@st.composite
def robots(draw: st.DrawFn) -> Parameters:
    """A robot with friction, battery and drive-train effects of any size on either side."""
    parameters = Parameters.from_robot(RobotConfig())
    sized = (
        ("friction.coulomb", "torque", 0.5),
        ("friction.viscous", "coefficient", 0.1),
        ("friction.quadratic", "coefficient", 0.05),
        ("friction.stiction", "torque", 0.3),
        ("friction.load_dependent", "coefficient", 0.8),
        ("friction.direction_dependent", "asymmetry", 0.9),
        ("motor.heating", "gain", 2.0),
        ("drive.backlash", "angle", 0.3),
        ("drive.wheel_slip", "time", 0.03),
    )
    for effect, name, most in sized:
        for side in ("left", "right"):
            parameters = parameters.with_effect(effect, side, **{name: draw(st.floats(0.0, most))})
    parameters = parameters.with_effect(
        "battery.internal_resistance", resistance=draw(st.floats(0.0, 0.5))
    ).with_effect("drive.turn_scrub", torque=draw(st.floats(0.0, 0.2)))
    return parameters.with_effect("drive.inertia", factor=draw(st.floats(0.5, 3.0)))


def run(plant: Plant, duties: list[tuple[float, float]], closed: float = 1.0) -> list[State]:
    rows = [duties[row * len(duties) // ROWS] for row in range(ROWS)]
    commands = ([each[0] for each in rows], [each[1] for each in rows], [closed] * ROWS, [closed] * ROWS)
    fields = list(range(len(State._fields)))
    out = np.zeros((len(fields), ROWS))
    rest = state_at_rest(plant)
    driver.advance(
        rest, plant, commands, TIME, 0, ROWS, 0.005, 0.0025, (1.0, 1.0), ([0.0], [0.0]), fields, out
    )
    return [State._make(column.tolist()) for column in out.T]


def kinetic_energy(plant: Plant, state: State) -> float:
    left, right = state.speed_left, state.speed_right
    return 0.5 * plant.inertia_own * (left * left + right * right) + plant.inertia_other * left * right


@settings(max_examples=30, deadline=None)
@given(robots(), DUTIES)
def test_kinetic_energy_comes_out_of_the_battery(
    parameters: Parameters, duties: list[tuple[float, float]]
) -> None:
    plant = plant_numbers(parameters)
    for state in run(plant, duties):
        drawn = plant.open_circuit_voltage * state.charge
        assert kinetic_energy(plant, state) <= drawn + 1e-12


@settings(max_examples=20, deadline=None)
@given(robots(), st.floats(-8.0, 8.0), st.floats(-8.0, 8.0), st.sampled_from([0.0, 1.0]))
def test_without_power_a_robot_only_slows_down(
    parameters: Parameters, left: float, right: float, closed: float
) -> None:
    plant = plant_numbers(parameters)
    state = state_at_rest(plant)._replace(speed_left=left, speed_right=right)
    energy = kinetic_energy(plant, state)
    out = np.zeros((0, ROWS))
    commands = ([0.0], [0.0], [closed], [closed])
    for _ in range(30):
        after = driver.advance(
            state, plant, commands, TIME, 0, 1, 0.005, 0.0025, (1.0, 1.0), ([0.0], [0.0]), [], out
        )
        state = State._make(after)
        assert kinetic_energy(plant, state) <= energy * (1.0 + 1e-12)
        energy = kinetic_energy(plant, state)


@settings(max_examples=15, deadline=None)
@given(robots(), DUTIES)
def test_the_mirrored_robot_drives_the_mirrored_path(
    parameters: Parameters, duties: list[tuple[float, float]]
) -> None:
    plant = plant_numbers(parameters)
    there = run(plant, duties)[-1]
    back = run(mirrored(plant), [(right, left) for left, right in duties])[-1]
    for name in ("x", "bus"):
        assert getattr(back, name) == pytest.approx(getattr(there, name), abs=1e-12)
    for name in ("y", "heading"):
        assert getattr(back, name) == pytest.approx(-getattr(there, name), abs=1e-12)


INERTIAS = st.tuples(*2 * [st.floats(0.1, 3.0)])
TORQUES = st.tuples(*2 * [st.floats(-3.0, 3.0)])
FRICTIONS = st.tuples(*4 * [st.floats(0.0, 1.0)])
Numbers = tuple[float, ...]


@settings(max_examples=150, deadline=None)
@given(INERTIAS, st.floats(-0.95, 0.95), TORQUES, FRICTIONS)
def test_two_wheels_under_dry_friction_move_as_the_one_case_that_holds(
    own: Numbers, coupled: float, push: Numbers, dry: Numbers
) -> None:
    other = coupled * float(np.sqrt(own[0] * own[1]))
    left, right = Rubbing(dry[0], dry[2], 0.0), Rubbing(dry[1], dry[3], 0.0)
    matrix = np.array([[own[0], other], [other, own[1]]])
    expected = _by_trying(matrix, np.array(push), np.array(dry[:2]), np.array(dry[2:]))
    found = settled(own[0], own[1], other, push[0], push[1], left, right)
    np.testing.assert_allclose(found, expected, atol=1e-9)


def _by_trying(matrix: Array, push: Array, forward: Array, backward: Array) -> Array:
    """The speeds of the case that violates least, of the nine of forward, backward and at rest."""
    best, least = np.zeros(2), np.inf
    for ways in itertools.product((1.0, 0.0, -1.0), repeat=2):
        way, moving = np.array(ways), np.array(ways) != 0.0
        speed = np.zeros(2)
        sliding = np.where(way > 0.0, forward, -backward)
        if moving.any():
            held = np.ix_(moving, moving)
            speed[moving] = np.linalg.solve(matrix[held], (push - sliding)[moving])
        needed = push - matrix @ speed
        wrong = np.where(moving, -way * speed, np.maximum(needed - forward, -backward - needed))
        if wrong.max() < least:
            best, least = speed, float(wrong.max())
    return best


def mirrored(plant: Plant) -> Plant:
    values = plant._asdict()
    other = {"left": "right", "right": "left"}
    for name in plant._fields:
        stem, _, side = name.rpartition("_")
        if side in other:
            values[name] = getattr(plant, f"{stem}_{other[side]}")
    return Plant(**values)
