"""Backgrounds are made here: level, noise, lamps' flicker, flashes, shadows, people, sun."""

import math

import numpy as np
import pytest

from raccoon.core.errors import CalibrationError, ConfigError
from raccoon.core.readings import Status
from raccoon.estimate.start_light import (
    StartLight,
    StartLightCalibration,
    StartLightReading,
    calibrate_start_light,
)
from raccoon.estimate.start_light.bulb import SlowBulb
from raccoon.estimate.start_light.history import History
from raccoon.model.reflectance import light_of

RATE = 200
LAMP_ON = 1.5  # s, in the tests with a lamp over steady ambient light
LEVELS = ((3000.0, 150.0), (3000.0, 500.0), (3000.0, 1500.0), (3500.0, 1800.0), (800.0, 500.0))


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
    read: list[float] = np.clip(np.round(4095 / (1 + light) + rng.normal(0, 3, len(light))), 0, 4095).tolist()
    return read


def first_fire(readings: list[float], light: StartLight) -> float | None:
    for index, reading in enumerate(readings):
        if light.update(index / RATE, reading).fired:
            return index / RATE
    return None


@pytest.mark.parametrize("calibrated", [True, False])
def test_fires_on_the_lamp_alone(calibrated: bool) -> None:
    known = calibrate_start_light([3000.0] * 20, [150.0] * 20) if calibrated else None
    for seed in range(25):
        rng = np.random.default_rng(seed)
        dark = background(rng, 5.0)
        lamp = np.concatenate([dark, dark[-1] + 25.0 * np.clip(np.arange(40) / 2.0, 0, 1)])
        fired = first_fire(counts(rng, lamp), StartLight(known))
        assert fired is not None
        assert 5.0 <= fired <= (5.05 if calibrated else 5.12)


def test_fires_once_and_stays() -> None:
    light = StartLight()
    readings = [3000.0] * 200 + [200.0] * 40 + [3000.0] * 100 + [200.0] * 40
    fired = [light.update(index / RATE, reading).fired for index, reading in enumerate(readings)]
    assert fired.index(True) in range(200, 223)
    assert all(fired[fired.index(True) :])
    assert light.fires == 1


def test_rehearsal_counts_every_lamp() -> None:
    light = StartLight(rehearsal=True)
    readings = ([3000.0] * 200 + [200.0] * 40) * 3
    fired = [light.update(index / RATE, reading).fired for index, reading in enumerate(readings)]
    assert fired.count(True) == 3
    assert light.fires == 3


@pytest.mark.parametrize("begin", [0.0, 100.0])
def test_nothing_fires_before_the_ambient_light_is_known(begin: float) -> None:
    light = StartLight()
    for index, reading in enumerate([3000.0] * 20 + [100.0] * 40):
        told = light.update(begin + index / RATE, reading)
        assert (told.status, told.fired) == (Status.INVALID, False)
    assert not light.update(begin + 0.31, None).fired


def test_leaving_shadow_is_no_lamp() -> None:
    light = StartLight()
    readings = [800.0] * 200 + [3500.0] * 400 + [800.0] * 200
    assert first_fire(readings, light) is None


def test_lamp_without_effect_is_refused() -> None:
    with pytest.raises(CalibrationError, match="shade the sensor"):
        calibrate_start_light([1000.0] * 20, [900.0] * 20)
    with pytest.raises(CalibrationError, match="shade the sensor"):  # a white sleeve makes as much
        calibrate_start_light([800.0] * 20, [590.0] * 20)
    with pytest.raises(CalibrationError, match="3 readings"):
        calibrate_start_light([1000.0] * 3, [100.0] * 20)
    with pytest.raises(ConfigError, match="5000"):
        calibrate_start_light([5000.0] * 20, [100.0] * 20)


def level(off: float, on: float, lamp: np.ndarray, seed: int = 0) -> np.ndarray:
    """Counts where the lamp gives the share `lamp` of its light, with noise of 3 counts."""
    light = 4095 / off - 1 + (4095 / on - 4095 / off) * lamp
    return np.round(4095 / (1 + light) + np.random.default_rng(seed).normal(0, 3, len(lamp)))


def bulb(time: np.ndarray, time_constant: float) -> np.ndarray:
    """Share of its light that a lamp which goes on at LAMP_ON gives."""
    return np.where(time >= LAMP_ON, 1 - np.exp(-np.maximum(time - LAMP_ON, 0) / time_constant), 0)


def delay(time: np.ndarray, readings: np.ndarray, light: StartLight) -> float | None:
    """Time from the lamp to the fire, s; below 0 where it fired before."""
    for at, counts in zip(time, readings, strict=True):
        if light.update(float(at), float(counts)).fired:
            return float(at) - LAMP_ON
    return None


def times(rate: float, phase: float = 0.0, seconds: float = LAMP_ON + 2.0) -> np.ndarray:
    return (np.arange(int(seconds * rate)) + phase) / rate


@pytest.mark.parametrize("rate", [10, 25, 50, 200, 1000])
@pytest.mark.parametrize("time_constant", [1e-4, 0.02, 0.05, 0.1, 0.15, 0.2])
def test_calibrated_lamp_may_warm_up_at_any_rate(rate: int, time_constant: float) -> None:
    for off, on in LEVELS:
        for phase in (0.0, 0.4, 0.8) if rate < 200 else (0.0,):
            time = times(rate, phase)
            light = StartLight(StartLightCalibration(off, on))
            found = delay(time, level(off, on, bulb(time, time_constant)), light)
            assert found is not None, (off, on, phase)
            assert 0.03 <= found <= 0.55 + 2.0 / rate


@pytest.mark.parametrize("rate", [50, 200])
@pytest.mark.parametrize("time_constant", [0.02, 0.05, 0.1])
def test_lamp_that_was_not_shown_may_warm_up_for_a_tenth_of_a_second(rate: int, time_constant: float) -> None:
    time = times(rate)
    for off, on in LEVELS[:4]:  # brighter than what is asked of an unknown lamp
        found = delay(time, level(off, on, bulb(time, time_constant)), StartLight())
        assert found is not None, (off, on)
        assert 0.03 <= found <= 0.5


@pytest.mark.parametrize("share", [0.2, 0.4])
def test_light_far_less_than_that_of_the_lamp_that_was_shown_is_none(share: float) -> None:
    time = times(RATE)
    for time_constant in (0.05, 0.15):
        readings = level(3000.0, 500.0, share * bulb(time, time_constant))
        assert delay(time, readings, StartLight(StartLightCalibration(3000.0, 500.0))) is None


@pytest.mark.parametrize("rate", [10, 25, 50, 200, 1000])
@pytest.mark.parametrize("calibrated", [True, False])
def test_lamp_that_comes_at_once_fires_within_three_readings(rate: int, calibrated: bool) -> None:
    for phase in np.arange(0.0, 1.0, 0.1 if rate < 1000 else 0.5):
        time = times(rate, float(phase))
        light = StartLight(StartLightCalibration(3000.0, 500.0) if calibrated else None)
        found = delay(time, level(3000.0, 500.0, bulb(time, 1e-4)), light)
        assert found is not None
        still = 0.04 if calibrated else 0.1  # without calibration it must stand still for longer
        assert 0.03 <= found <= max(3.0 / rate, still + 2.0 / rate) + 1e-6


@pytest.mark.parametrize("gap", [0.01, 0.02, 0.03, 0.05, 0.07, 0.1])
@pytest.mark.parametrize("rate", [10, 50, 200])
@pytest.mark.parametrize("calibrated", [True, False])
def test_readings_may_be_missing_around_the_lamp(gap: float, rate: int, calibrated: bool) -> None:
    for begin in np.arange(-1.0, 0.9, 0.2) * gap + LAMP_ON:
        time = times(rate)
        silent = (time >= begin) & (time < begin + gap)
        light = StartLight(StartLightCalibration(3000.0, 500.0) if calibrated else None)
        readings = level(3000.0, 500.0, bulb(time, 1e-4))
        found = None
        for at, counts, missing in zip(time, readings, silent, strict=True):
            if light.update(float(at), None if missing else float(counts)).fired:
                found = float(at) - LAMP_ON
                break
        assert found is not None, begin
        assert 0.03 <= found <= (0.06 if calibrated else 0.1) + 2.0 * gap + 3.0 / rate


def test_lamp_that_warms_up_behind_a_gap_is_seen() -> None:
    time = times(RATE)
    for begin in np.arange(-0.1, 0.3, 0.05) + LAMP_ON:
        for off, on in LEVELS:
            heard = (time < begin) | (time >= begin + 0.1)
            readings = level(off, on, bulb(time, 0.1))
            light = StartLight(StartLightCalibration(off, on))
            assert delay(time[heard], readings[heard], light) is not None, (begin, off, on)


@pytest.mark.parametrize("rate", [10, 25, 50, 200, 1000])
@pytest.mark.parametrize("calibrated", [True, False])
def test_slow_cloud_is_no_lamp(rate: int, calibrated: bool) -> None:
    for off, on in LEVELS if rate < 200 else LEVELS[1:4] if rate < 1000 else LEVELS[1:2]:
        for seconds in (
            1.0,
            2.0,
            10.0 if rate < 200 else 3.0,
        ):  # a cloud leaves; the sun is as bright as the lamp, or less
            for share in (0.3, 1.0) if calibrated else (0.1,):
                time = times(rate, seconds=LAMP_ON + seconds + 1.5)
                sun = share * np.clip((time - LAMP_ON) / seconds, 0, 1)
                light = StartLight(StartLightCalibration(off, on) if calibrated else None)
                assert delay(time, level(off, on, sun), light) is None, (off, on, seconds, share)


@pytest.mark.parametrize("rate", [10, 25, 50, 200, 1000])
@pytest.mark.parametrize("calibrated", [True, False])
def test_hand_that_passes_is_no_lamp(rate: int, calibrated: bool) -> None:
    for off, on in LEVELS if rate < 200 else LEVELS[3:4]:
        for edge in (0.03, 0.1, 0.3):
            for depth in (0.9, -0.4):  # its shadow; a white sleeve that sends light back
                time = times(rate)
                inside = np.clip(np.minimum(time - 1.5, 2.5 - time) / edge, 0, 1)
                ambient = (4095 / off - 1) * (1 - depth * inside)
                readings = np.clip(np.round(4095 / (1 + ambient)), 0, 4095)
                light = StartLight(StartLightCalibration(off, on) if calibrated else None)
                assert delay(time, readings, light) is None, (off, on, edge, depth)


@pytest.mark.parametrize("rate", [10, 25, 50, 200])
@pytest.mark.parametrize("calibrated", [True, False])
def test_flashes_and_outliers_are_no_lamp(rate: int, calibrated: bool) -> None:
    for gap in (0.0, 0.1):
        time = times(rate)
        flash = ((time % 0.5) < 0.02) & (time > 0.6)
        silent = ((time % 0.5) >= 0.02) & ((time % 0.5) < 0.02 + gap)
        readings = np.where(flash, 100.0, level(3000.0, 150.0, np.zeros(len(time))))
        light = StartLight(StartLightCalibration(3000.0, 150.0) if calibrated else None)
        assert delay(time[~silent], readings[~silent], light) is None
        # And they do not hide the lamp that comes after them.
        later = time + float(time[-1]) + 1.0 / rate
        assert delay(later, np.full(len(time), 150.0), light) is not None


def test_daylight_that_was_learnt_halfway_is_no_lamp() -> None:
    time = times(RATE)
    for begin in np.arange(0.0, 0.5, 0.1):
        for seconds in (0.6, 1.0, 2.0):
            sun = np.clip((time - begin) / seconds, 0, 1)
            light = StartLight(StartLightCalibration(3000.0, 1200.0))
            assert delay(time, level(3000.0, 700.0, sun), light) is None, (begin, seconds)


def test_lamp_over_daylight_that_was_refused_is_seen() -> None:
    time = times(RATE)
    sun = 0.25 * np.clip((time - 1.0) / 1.2, 0, 1)
    for known in (StartLightCalibration(3000.0, 150.0), None):
        light = StartLight(known)
        found = delay(time, level(3000.0, 150.0, sun + bulb(time, 1e-4)), light)
        assert found is not None
        assert 0.03 <= found < (0.06 if known else 0.11)


@pytest.mark.parametrize("rate", [50, 200])
@pytest.mark.parametrize("time_constant", [0.2, 0.3, 0.45, 0.6])
def test_a_bulb_that_warms_up_slowly_is_seen(rate: int, time_constant: float) -> None:
    """It has 95 % of its light after 0.6 to 1.8 s; it was shown before, or not."""
    for off, on in ((3000.0, 150.0), (3000.0, 300.0), (2000.0, 100.0)):
        for known in (None, StartLightCalibration(off, on)):
            for seed in range(2):
                time = times(rate, seed / 2.0, LAMP_ON + 4.0)
                light = StartLight(known)
                found = delay(time, level(off, on, bulb(time, time_constant), seed), light)
                assert found is not None, (off, on, known, seed)
                assert 0.03 <= found < 4.0 * time_constant + 0.5


@pytest.mark.parametrize("rate", [25, 200])
@pytest.mark.parametrize("seconds", [0.5, 1.0, 2.0, 4.0])
def test_the_sun_comes_out_over_a_lamp_that_was_not_shown(rate: int, seconds: float) -> None:
    """As bright as a lamp, and evenly or with a soft edge: a start in the middle of somebody's set-up."""
    time = times(rate, seconds=LAMP_ON + seconds + 2.0)
    evenly = np.clip((time - LAMP_ON) / seconds, 0, 1)
    for off, on in ((3000.0, 150.0), (3000.0, 700.0)):
        for share in (0.3, 0.6, 1.0):
            for come in (evenly, evenly**2 * (3 - 2 * evenly)):
                assert delay(time, level(off, on, share * come), StartLight()) is None, (off, on, share)


@pytest.mark.parametrize("depth", [0.5, 0.8])
@pytest.mark.parametrize("edge", [0.4, 0.8, 1.6])
def test_one_who_shaded_it_from_the_start_leaves(depth: float, edge: float) -> None:
    time = times(RATE, seconds=LAMP_ON + edge + 2.0)
    gone = np.clip((time - LAMP_ON) / edge, 0, 1)
    for off in (800.0, 2000.0, 3000.0):
        for leaving in (gone, gone**2 * (3 - 2 * gone), np.sin(0.5 * math.pi * gone)):
            ambient = (4095 / off - 1) * (1 - depth * (1 - leaving))
            readings = np.clip(np.round(4095 / (1 + ambient)), 0, 4095)
            assert delay(time, readings, StartLight()) is None, off


def replies(readings: np.ndarray, light: StartLight) -> list[StartLightReading]:
    return [light.update(index / RATE, float(counts)) for index, counts in enumerate(readings)]


@pytest.mark.parametrize("seconds", [0.6, 10.0])
def test_the_threshold_is_eight_deviations_of_the_noise_below_the_light(seconds: float) -> None:
    """Both by what the first half of a second tells of the noise, and where it is another one since."""
    rng = np.random.default_rng(2)
    sd = np.where(np.arange(round(seconds * RATE)) < RATE, 50.0, 90.0)
    told = replies(
        3000.0 + sd * rng.standard_normal(len(sd)), StartLight(StartLightCalibration(3000.0, 2950.0))
    )
    assert told[-1].threshold == pytest.approx(3000.0 - 8.0 * sd[-1], abs=120.0)
    assert told[-1].status is Status.UNCERTAIN  # it is above neither


def test_a_lamp_that_was_not_shown_takes_35_percent_of_the_reading() -> None:
    assert replies(np.full(200, 3000.0), StartLight())[-1].threshold == pytest.approx(0.65 * 3000.0)


def test_the_ambient_light_is_learnt_within_half_a_second_and_in_a_pause() -> None:
    light, time = StartLight(), 0.0
    for counts, seconds in ((3000.0, 1.0), (3400.0, 0.5)):
        for _ in range(round(seconds * RATE)):
            time += 1.0 / RATE
            ambient = light.update(time, counts).ambient
    assert ambient == pytest.approx(3400.0 - 400.0 * math.exp(-1.0), abs=2.0)
    assert light.update(time + 3.0, 3200.0).ambient == 3200.0


def test_light_that_stays_and_is_no_lamp_is_refused_once() -> None:
    time = times(RATE, seconds=LAMP_ON + 3.0)
    slow = level(3000.0, 500.0, np.clip((time - LAMP_ON) / 0.7, 0, 1))
    for known in (StartLightCalibration(3000.0, 500.0), None):
        told = replies(slow, StartLight(known))
        assert not any(each.fired for each in told)
        refused = [index / RATE - LAMP_ON for index, each in enumerate(told) if each.refused]
        assert len(refused) == 1
        assert 0.6 < refused[0] < 1.5
        assert told[-1].ambient == pytest.approx(500.0, abs=300.0)  # it is learnt


def test_what_does_not_stay_is_not_refused() -> None:
    time = times(RATE)
    hand = np.where((time > 1.5) & (time < 2.0), 3900.0, 3000.0)
    flash = np.where((time > 1.5) & (time < 1.52), 100.0, 3000.0)
    lamp = level(3000.0, 500.0, bulb(time, 0.15))
    for readings in (hand, flash, lamp):
        light = StartLight(StartLightCalibration(3000.0, 500.0))
        assert not any(each.refused for each in replies(readings, light))


@pytest.mark.parametrize("calibrated", [True, False])
@pytest.mark.parametrize("depth", [0.3, 0.6, 0.95])
def test_lamp_is_seen_in_a_room_whose_lamps_flicker(calibrated: bool, depth: float) -> None:
    time = times(RATE)
    for hertz in (99.9, 100.0, 100.1, 119.9, 120.0):
        for phase in (0.0, 1.0, 2.0):
            room = 0.5 * (1.0 + depth * np.sin(2.0 * math.pi * hertz * time + phase))
            readings = np.round(4095 / (1 + room + 8.0 * bulb(time, 1e-4)))
            light = StartLight(StartLightCalibration(2700.0, 430.0) if calibrated else None)
            found = delay(time, readings, light)
            assert found is not None, (hertz, phase)
            assert 0.0 < found < (0.06 if calibrated else 0.13)


def test_flash_while_the_sun_comes_out_is_no_lamp() -> None:
    time = times(RATE, seconds=4.0)
    for begin in np.arange(LAMP_ON + 0.2, LAMP_ON + 1.2, 0.1):
        for spacing in (0.06, 0.08, 0.1, 0.12):
            sun = 3.0 * np.clip((time - LAMP_ON) / 1.5, 0, 1)
            since = time - begin + 1e-6
            flash = 25.0 * ((since >= 0) & (since < 2 * spacing) & (since % spacing < 0.02))
            light = StartLight()
            assert delay(time, np.round(4095 / (1.2 + sun + flash)), light) is None, (begin, spacing)


def test_shadow_that_passes_while_the_sun_is_coming_is_no_lamp() -> None:
    time = times(RATE, seconds=7.0)
    for seconds, begin, edge, depth in ((0.8, 0.6, 0.12, 0.8), (0.8, 1.2, 0.2, 0.9), (1.0, 0.8, 0.15, 0.6)):
        come = np.clip((time - LAMP_ON) / seconds, 0, 1)
        since = time - LAMP_ON - begin
        shadow = np.clip(np.minimum(since, 0.4 - since) / edge, 0, 1)
        light = (0.3 + 2.0 * come**2 * (3 - 2 * come)) * (1 - depth * shadow)
        assert delay(time, np.round(4095 / (1 + light)), StartLight()) is None, (seconds, begin)


@pytest.mark.parametrize("calibration", [None, StartLightCalibration(3000.0, 200.0)])
def test_wires_that_touch_are_no_lamp(calibration: StartLightCalibration | None) -> None:
    light = StartLight(calibration)
    readings = [light.update(0.005 * n, 0.0 if 300 <= n < 500 else 3000.0) for n in range(700)]
    assert not any(each.fired for each in readings)
    assert [each.shorted for each in readings].index(True) == pytest.approx(320, abs=2)
    assert not readings[-1].shorted
    assert any(light.update(3.5 + 0.005 * n, 200.0).fired for n in range(30))


def test_a_calibration_of_touching_wires_is_refused() -> None:
    for off in (0.0, 3000.0):
        with pytest.raises(CalibrationError, match="wires that touch"):
            calibrate_start_light([off] * 20, [0.0] * 20)


@pytest.mark.parametrize(("tail", "warm"), [(0.12, False), (0.36, True), (0.72, False)])
def test_a_bulb_is_told_by_how_its_light_comes_to_rest(tail: float, warm: bool) -> None:
    """From 15 to 75 % in 0.6 s, and from there to 90 % in so many; an exponential takes 0.75 of that."""
    times, shares = np.cumsum([0.0, 1.0, 0.75, tail, 0.2]), [0.0, 0.0, 0.75, 0.9, 1.0]
    bulb, seen = SlowBulb(), False
    for time in np.arange(0.0, 4.0, 0.005):
        light = 1.0 + 30.0 * float(np.interp(time, times, shares))
        bulb.add(float(time), 4095.0 / (1.0 + light))
        seen = seen or bulb.is_warm(1.0)
    assert seen is warm


@pytest.mark.parametrize(
    ("off", "on"), [(500.0, 3000.0), (500.0, 500.0), (5000.0, 300.0), (3000.0, math.nan)]
)
def test_levels_that_are_exchanged_or_no_counts_are_refused(off: float, on: float) -> None:
    with pytest.raises(
        ConfigError, match=f"off is {off}, on is {on}: allowed are .* 0 to 4095, on below off"
    ):
        StartLightCalibration(off, on)


def test_what_was_long_before_is_forgotten() -> None:
    seen = History()
    for index in range(1400):
        seen.add(index / RATE, 3000.0 if index < 1000 else 1000.0)
    assert seen.least_light(0.0) == seen.light_at(0.0) == light_of(1000.0)
