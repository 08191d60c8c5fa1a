"""An effect at its neutral value changes nothing, not even the last bit."""

import re
import sys
from collections.abc import Callable
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from raccoon.core.config import RobotConfig, TophatConfig
from raccoon.core.readings import Outputs
from raccoon.sim.effects.catalogue import CATALOGUE
from raccoon.sim.effects.effect import Effect, Place
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.effects.physical import plant_numbers, state_at_rest
from raccoon.sim.plant import driver
from raccoon.sim.plant.compiled import advance_cells, advance_one, python_module, source
from raccoon.sim.plant.lanes import GIVING, KINDS, SELDOM, Kind
from raccoon.sim.plant.quantities import State
from raccoon.sim.port import SimPort

ROWS = 80
TIME = [0.005 * row for row in range(ROWS + 1)]
TERMS = sorted(set(re.findall(r"# effect: (\S+)", source())))
ROBOT = RobotConfig(tophats={"front": TophatConfig(analog=3)})


def sided(entry: Effect) -> bool:
    return entry.place is Place.SIDE


def anything(entry: Effect, random: np.random.Generator) -> dict[str, float]:
    """Some value of each parameter, of a usual size."""
    values = {}
    for each in entry.parameters:
        start = Parameters.from_robot(ROBOT).value(entry.id, each.name, "left" if sided(entry) else None)
        start = 1.0 if start == np.inf else start
        value = start + each.prior_width * random.uniform(0.2, 1.5)
        values[each.name] = min(max(value, each.bounds.low), each.bounds.high)
    return values


def everything_but(*ids: str, seed: int) -> Parameters:
    """A robot with every effect switched on somehow, except these."""
    random = np.random.default_rng(seed)
    parameters = Parameters.from_robot(ROBOT)
    for entry in CATALOGUE.values():
        for where in ("left", "right") if sided(entry) else (None,):
            if entry.id not in ids:
                parameters = parameters.with_effect(entry.id, where, **anything(entry, random))
    return parameters


def run(advance: Callable[..., Any], parameters: Parameters) -> list[State]:
    plant = plant_numbers(parameters)
    duty = [0.9 if row < 30 else -0.7 if row < 60 else 0.0 for row in range(ROWS)]
    commands = (duty, [0.4 * each for each in duty], [1.0] * ROWS, [1.0] * ROWS)
    fields = list(range(len(State._fields)))
    out = np.zeros((len(fields), ROWS))
    noise = ([0.5, -1.0, 2.0], [1.0, 0.25, -0.5])
    advance(
        state_at_rest(plant), plant, commands, TIME, 0, ROWS, 0.005, 0.0025, (0.25, 0.5), noise, fields, out
    )
    return [State._make(column.tolist()) for column in out.T]


@cache
def without_term(effect: str) -> ModuleType:
    """The plant whose text has no term of this effect."""
    return python_module(source(Kind((effect,))))


def test_the_terms_are_those_of_the_catalogue() -> None:
    assert set(TERMS) <= set(CATALOGUE)
    assert len(TERMS) >= 14


@pytest.mark.parametrize("effect", TERMS)
def test_without_its_term_the_plant_gives_the_same_bits(effect: str) -> None:
    parameters = everything_but(effect, seed=len(effect))
    assert run(driver.advance, parameters) == run(without_term(effect).advance, parameters)


@pytest.mark.parametrize("kind", KINDS)
def test_a_robot_without_seldom_effects_does_the_same_in_the_text_without_them(kind: str) -> None:
    without = KINDS[kind].without
    assert set(without) < set(TERMS)
    parameters = everything_but(*without, seed=17)
    if not KINDS[kind].creeping:
        parameters = parameters.with_effect(
            "friction.presliding", compliance=0.001, creep=0.0, break_away=0.0
        )
    assert run(driver.advance, parameters) == run(python_module(source(KINDS[kind])).advance, parameters)


FIELDS = {**SELDOM, "friction.presliding": GIVING}


@pytest.mark.parametrize("effect", FIELDS)
def test_a_robot_with_one_of_them_is_told_by_its_numbers(effect: str) -> None:
    neutral = plant_numbers(Parameters.from_robot(ROBOT))._asdict()
    fields = FIELDS[effect]
    assert fields == {name: neutral[name] for name in fields}
    random = np.random.default_rng(len(effect))
    for where in ("left", "right") if sided(CATALOGUE[effect]) else (None,):
        one = Parameters.from_robot(ROBOT).with_effect(effect, where, **anything(CATALOGUE[effect], random))
        assert any(plant_numbers(one)._asdict()[name] != value for name, value in fields.items())


@pytest.mark.parametrize("effect", TERMS)
def test_away_from_neutral_its_term_does_something(effect: str) -> None:
    parameters = everything_but("none", seed=len(effect))
    # Wide enough that the readings of this run fall into it.
    parameters = parameters.with_effect("bemf.dead_zone", counts=80.0)
    assert run(driver.advance, parameters) != run(without_term(effect).advance, parameters)


@pytest.mark.parametrize("entry", CATALOGUE.values(), ids=lambda entry: entry.id)
def test_switched_on_at_its_neutral_value_the_words_are_the_same(entry: Effect) -> None:
    parameters = everything_but(entry.id, seed=5)
    port = "3" if entry.place is Place.TOPHAT else "left" if entry.place is Place.SIDE else None
    neutral = {each.name: parameters.value(entry.id, each.name, port) for each in entry.parameters}
    words = [
        drive(SimPort(each, noise=True, seed=2))
        for each in (parameters, parameters.with_effect(entry.id, None, **neutral))
    ]
    assert words[0] == words[1]


def drive(port: SimPort) -> list[Any]:
    words = []
    for row in range(60):
        port.write(Outputs(duty=(0.8 if row < 40 else -0.5, 0.5, 0.0, 0.0)))
        words.append(port.read())
    return words


def compiled_arguments(parameters: Parameters, out: np.ndarray) -> tuple[Any, ...]:
    plant = plant_numbers(parameters)
    duty = np.array([0.9 if row < 30 else -0.7 if row < 60 else 0.0 for row in range(ROWS)])
    commands = (duty, 0.4 * duty, np.ones(ROWS), np.ones(ROWS))
    noise = (np.array([0.5, -1.0, 2.0]), np.array([1.0, 0.25, -0.5]))
    times, fields = np.array(TIME), np.arange(len(out))
    return (
        state_at_rest(plant), plant, commands, times, 0, ROWS, 0.005, 0.0025, (0.25, 0.5), noise, fields, out,
    )  # fmt: skip


def test_compiled_and_not_give_the_same() -> None:
    pytest.importorskip("numba")
    parameters = everything_but("none", seed=11)
    out = np.zeros((len(State._fields), ROWS))
    advance_one()(*compiled_arguments(parameters, out))
    plain = np.array(run(driver.advance, parameters)).T
    np.testing.assert_allclose(out, plain, rtol=1e-12, atol=1e-12)


def test_no_python_runs_inside_the_compiled_call() -> None:
    # A signal handler could raise in there, and numba does not look whether one did: it crashes.
    pytest.importorskip("numba")
    arguments = compiled_arguments(everything_but("none", seed=11), np.zeros((len(State._fields), ROWS)))
    arguments = np.array(arguments[0]), np.array(arguments[1]), *arguments[2:]
    advance = advance_cells()
    advance(*arguments)  # loads what is compiled, which runs much of it
    called: set[str] = set()
    sys.setprofile(lambda frame, event, _: called.add(frame.f_code.co_name) if event == "call" else None)
    try:
        advance(*arguments)
    finally:
        sys.setprofile(None)
    assert called <= {"advance_cells"}
