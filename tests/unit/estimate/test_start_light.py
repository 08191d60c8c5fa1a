"""Backgrounds are made here: level, noise, lamps' flicker, flashes, shadows, people, sun."""

import numpy as np
import pytest

from raccoon.core.errors import CalibrationError, ConfigError, MotionTimeout
from raccoon.core.readings import Status
from raccoon.estimate.start_light import StartLight, calibrate_start_light, wait_for_light

RATE = 200


def background(rng: np.random.Generator, seconds: float) -> np.ndarray:
    """Light without the lamp, in units where 1 halves the reading."""
    time = np.arange(0.0, seconds, 1.0 / RATE)
    light = np.full(len(time), rng.uniform(0.1, 0.5))
    light *= 1.0 + rng.uniform(0.0, 0.1) * np.sin(2.0 * np.pi * rng.uniform(99.0, 101.0) * time)
    for _ in range(rng.integers(0, 4)):  # people: shadows with edges of 0.06..0.4 s
        start, width, edge = rng.uniform(0.5, seconds), rng.uniform(0.2, 2.0), rng.uniform(0.06, 0.4)
        inside = np.clip((time - start) / edge, 0, 1) * np.clip((start + width - time) / edge, 0, 1)
        light *= 1.0 - rng.uniform(0.2, 0.7) * inside
    if rng.random() < 0.3:  # the sun comes out within 0.5..3 s
        start = rng.uniform(0.5, seconds)
        light += rng.uniform(0.2, 3.0) * np.clip((time - start) / rng.uniform(0.5, 3.0), 0, 1)
    for _ in range(rng.integers(0, 6)):  # flashes of up to 20 ms
        at = rng.integers(0, len(time) - 5)
        light[at : at + rng.integers(1, 5)] += rng.uniform(1.0, 30.0)
    return light


def counts(rng: np.random.Generator, light: np.ndarray) -> list[float]:
    return np.clip(np.round(4095 / (1 + light) + rng.normal(0, 3, len(light))), 0, 4095).tolist()  # type: ignore[no-any-return]


def first_fire(readings: list[float], light: StartLight) -> float | None:
    for index, reading in enumerate(readings):
        if light.update(index / RATE, reading).fired:
            return index / RATE
    return None


@pytest.mark.parametrize("calibrated", [True, False])
def test_fires_on_the_lamp_alone(calibrated: bool) -> None:
    known = calibrate_start_light([3000.0] * 20, [150.0] * 20) if calibrated else None
    for seed in range(60):
        rng = np.random.default_rng(seed)
        dark = background(rng, 5.0)
        lamp = np.concatenate([dark, dark[-1] + 25.0 * np.clip(np.arange(20) / 2.0, 0, 1)])
        assert first_fire(counts(rng, dark), StartLight(known)) is None
        fired = first_fire(counts(rng, lamp), StartLight(known))
        assert fired is not None
        assert 5.0 <= fired <= 5.05


def test_fires_once_and_stays() -> None:
    light = StartLight()
    readings = [3000.0] * 200 + [200.0] * 20 + [3000.0] * 100 + [200.0] * 20
    fired = [light.update(index / RATE, reading).fired for index, reading in enumerate(readings)]
    assert fired.index(True) in range(200, 211)
    assert all(fired[fired.index(True) :])
    assert light.fires == 1


def test_rehearsal_counts_every_lamp() -> None:
    light = StartLight(rehearsal=True)
    readings = ([3000.0] * 200 + [200.0] * 40) * 3
    fired = [light.update(index / RATE, reading).fired for index, reading in enumerate(readings)]
    assert fired.count(True) == 3
    assert light.fires == 3


def test_nothing_fires_before_the_ambient_light_is_known() -> None:
    light = StartLight()
    assert light.update(0.0, 3000.0).status is Status.INVALID
    assert not light.update(0.01, 100.0).fired
    assert not light.update(0.2, None).fired


def test_leaving_shadow_is_no_lamp() -> None:
    light = StartLight()
    readings = [800.0] * 200 + [3500.0] * 400 + [800.0] * 200
    assert first_fire(readings, light) is None


def test_wait_returns_the_time_or_gives_up() -> None:
    readings = iter([3000.0] * 200 + [200.0] * 20)
    ticks = iter(range(1000))
    assert wait_for_light(lambda: (next(ticks) / RATE, next(readings)), StartLight()) == pytest.approx(1.04)
    with pytest.raises(MotionTimeout, match="no start light"):
        wait_for_light(lambda: (next(ticks) / RATE, 3000.0), StartLight(), timeout=0.5)


def test_lamp_without_effect_is_refused() -> None:
    with pytest.raises(CalibrationError, match="shade the sensor"):
        calibrate_start_light([1000.0] * 20, [900.0] * 20)
    with pytest.raises(CalibrationError, match="3 readings"):
        calibrate_start_light([1000.0] * 3, [100.0] * 20)
    with pytest.raises(ConfigError, match="5000"):
        calibrate_start_light([5000.0] * 20, [100.0] * 20)
    with pytest.raises(ConfigError, match="hold"):
        StartLight(hold=0.0)
