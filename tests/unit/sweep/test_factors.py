"""What varies from match to match."""

import numpy as np
import pytest

from raccoon.core.errors import ConfigError
from raccoon.sim.effects.parameters import Parameters
from raccoon.sweep.factors import Factor, parse_factor, robot_with


def draws(text: str, count: int = 2000) -> np.ndarray:
    factor, random = parse_factor(text), np.random.default_rng(1)
    return np.array([factor.draw(random) for _ in range(count)])


def test_a_range_is_uniform() -> None:
    values = draws("battery.open_circuit_voltage=6:7")
    assert 6.0 <= values.min() < 6.01 < 6.99 < values.max() <= 7.0
    assert np.std(values) == pytest.approx(1 / np.sqrt(12), rel=0.05)


def test_a_mean_and_sd_are_normal() -> None:
    values = draws("motor.back_emf_constant.factor@left=1.0~0.03")
    assert np.mean(values) == pytest.approx(1.0, abs=0.002)
    assert np.std(values) == pytest.approx(0.03, rel=0.05)


def test_a_normal_stays_inside_the_bounds() -> None:
    values = draws("friction.coulomb=0.05~0.1")
    assert values.min() >= 0.0
    assert draws("light.ambient=0.1~0.2").min() >= 0.0


def test_a_number_is_itself() -> None:
    assert set(draws("drive.slope.along_x=0.02", 5)) == {0.02}


def test_a_fault_is_there_in_its_share_of_matches() -> None:
    values = draws("fault.imu_silent=0.25")
    assert set(values) == {0.0, 1.0}
    assert np.mean(values) == pytest.approx(0.25, abs=0.03)


@pytest.mark.parametrize(
    ("text", "name", "unit"),
    [
        ("battery.open_circuit_voltage=6:7", "battery.open_circuit_voltage.voltage", "V"),
        ("tophat.gain@0=0.9:1.1", "tophat.gain.factor@0", ""),
        ("light.ambient=0:1", "light.ambient", ""),
        ("fault.lost_cycles=0.1", "fault.lost_cycles", ""),
    ],
)
def test_names_and_units(text: str, name: str, unit: str) -> None:
    factor = parse_factor(text)
    assert (factor.name, factor.unit) == (name, unit)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("nonsense", "write EFFECT"),
        ("battery.voltage=6:7", "there is no such id"),
        ("drive.slope=0:1", "say which parameter of drive.slope: along_x, along_y"),
        ("drive.wheel_radius.factr=1", r"there is no parameter factr \(did you mean factor\?\); allowed"),
        ("battery.open_circuit_voltage=7:6", "the lower first"),
        ("battery.open_circuit_voltage=nan", "two numbers"),
        ("battery.open_circuit_voltage=6:7:8", "neither LOW:HIGH"),
        ("battery.open_circuit_voltage=-1:7", "voltage is -1 V: allowed are numbers from 1 to 30"),
        ("battery.internal_resistance=-0.1~0.05", r"resistance is -0\.1\d* ohm"),
        ("battery.open_circuit_voltage=7~-0.1", "the standard deviation -0.1 must be 0 or more"),
        ("light.ambient=0:3", "light.ambient is 3.0: allowed are numbers from 0 to 1"),
        ("light.ambient@left=0:1", "neither parameters nor places"),
        (
            "wheel_radus=1:2",
            r"effect 'wheel_radus': .* id \(did you mean drive.wheel_radius\?\); ",
        ),
        ("foo@left=1", "effect 'foo': there is no such id"),
        ("foo:1:2", "write EFFECT"),
        ("fault.imu_silnt=0.1", r"there is no such fault \(did you mean fault.imu_silent\?\); allowed"),
        ("fault.imu_silent=0:0.1", "give one number"),
        ("fault.imu_silent=2", "fault.imu_silent is 2.0"),
    ],
)
def test_impossible_ones_are_named(text: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        parse_factor(text)


def test_numbers_that_are_none_are_refused() -> None:
    with pytest.raises(ConfigError, match="two numbers"):
        Factor("friction.coulomb", "torque", 0.1, float("inf"))


def test_one_side_differs_from_both_in_whichever_order_they_are_named() -> None:
    names = ("friction.coulomb@left=0.25", "friction.coulomb=0.2")
    for factors in (tuple(map(parse_factor, names)), tuple(map(parse_factor, names[::-1]))):
        values = {each.name: each.low for each in factors}
        made = robot_with(Parameters(), factors, values)
        assert [made.value("friction.coulomb", "torque", side) for side in ("left", "right")] == [0.25, 0.2]
