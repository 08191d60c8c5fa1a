"""State of charge and internal resistance from sag, on a pack made here."""

import math

import numpy as np
import pytest

from raccoon.core.readings import Status
from raccoon.estimate.battery.curves import CURVES, charge_at
from raccoon.estimate.battery.state import PackState

CELLS = {"lifepo4": 2.0, "lipo": 2.0, "nimh": 5.0}
"""In a pack that a controller runs on."""


def voltage_at(chemistry: str, charge: float) -> float:
    """Resting V of a cell."""
    charges, volts = zip(*CURVES[chemistry], strict=True)
    return float(np.interp(charge, charges, volts))


def drive(pack: PackState, chemistry: str, resistance: float, charge: float, seconds: float = 40.0) -> None:
    random = np.random.default_rng(3)
    for cycle in range(int(seconds * 100)):
        current = 1.2 if (cycle // 150) % 2 else 0.1
        voltage = CELLS[chemistry] * voltage_at(chemistry, charge) - resistance * current
        pack.update(cycle * 0.01, voltage + 0.013 * random.standard_normal(), current)


def test_a_reading_that_is_still_moving_after_a_change_of_load_is_passed_over() -> None:
    pack = PackState(resistance_std=1.0)
    for cycle in range(3000):
        loaded, since = divmod(cycle, 100)[0] % 2, cycle % 100
        sagged = loaded if since >= 14 else 1 - loaded  # the board's filter shows it 0.14 s later
        pack.update(0.01 * cycle, 6.8 - 0.1 * 2.0 * sagged, 2.0 * loaded)
    found = pack.estimate
    assert found.internal_resistance == pytest.approx(0.1, abs=1e-3)
    assert found.open_circuit_voltage == pytest.approx(6.8, abs=1e-3)


def test_what_is_known_of_the_open_voltage_is_of_the_last_minute() -> None:
    pack = PackState(reading_std=0.004)
    for cycle in range(6000):
        pack.update(0.06 * cycle, 6.8, 0.0)  # windows of 0.12 s
    assert pack.estimate.open_circuit_voltage_std == pytest.approx(0.004 / 601**0.5, rel=0.02)


@pytest.mark.parametrize("wrong", [None, 0.0, 2.0, 40.0, math.nan])
def test_a_voltage_that_no_controller_runs_on_is_no_reading(wrong: float | None) -> None:
    """As a converter gives it that dies, or whose wire is loose."""
    pack = PackState()
    for cycle in range(500):
        pack.update(0.01 * cycle, wrong if cycle % 5 == 4 else 6.8, 0.0)
    assert pack.estimate.open_circuit_voltage == pytest.approx(6.8)


@pytest.mark.parametrize("chemistry", sorted(CURVES))
@pytest.mark.parametrize("resistance", [0.05, 0.15])
def test_charge_and_resistance_are_found_within_their_deviations(chemistry: str, resistance: float) -> None:
    pack = PackState(chemistry, CELLS[chemistry])
    drive(pack, chemistry, resistance, 0.35)
    found = pack.estimate
    assert found.status is Status.OK
    assert found.internal_resistance == pytest.approx(resistance, abs=0.015)
    assert abs(found.charge - 0.35) < max(0.05, 2.0 * found.charge_std)


def test_the_deviation_of_the_charge_is_that_of_the_voltage_by_the_curve_s_slope() -> None:
    """Of a lipo between 3.77 V (0.3) and 3.80 V (0.4) a cell, with the 20 mV by which packs differ."""
    pack = PackState("lipo", 2.0)
    for cycle in range(500):
        pack.update(cycle * 0.01, 2.0 * 3.785, 0.0)
    found = pack.estimate
    of_a_cell = 0.5 * (found.open_circuit_voltage_std + 0.02)
    assert found.charge == pytest.approx(0.35)
    assert found.charge_std == pytest.approx(0.1 / 0.03 * of_a_cell)


def test_without_a_change_of_load_the_resistance_stays_unsure() -> None:
    pack = PackState("lipo", 2.0)
    for cycle in range(500):
        pack.update(cycle * 0.01, 7.6, 0.1)
    assert pack.estimate.status is Status.UNCERTAIN
    assert pack.estimate.internal_resistance_std > 0.03


def test_before_any_reading_it_is_invalid() -> None:
    assert PackState().estimate.status is Status.INVALID


@pytest.mark.parametrize("chemistry", sorted(CURVES))
def test_curves_rise_and_are_their_own_inverse(chemistry: str) -> None:
    for charge in (0.0, 0.13, 0.5, 0.77, 1.0):
        assert charge_at(chemistry, voltage_at(chemistry, charge)) == pytest.approx(charge, abs=1e-9)
    assert charge_at(chemistry, 0.1) == 0.0
    assert charge_at(chemistry, 9.0) == 1.0


def test_an_unknown_chemistry_is_refused() -> None:
    with pytest.raises(ValueError, match="chemistry is 'lead'"):
        PackState("lead")
