"""The watchers one by one, where a whole robot would hide what they do."""

import math

import pytest

from raccoon.core.readings import BATTERY_VOLTS_PER_COUNT, BEMF_VOLTS_PER_COUNT, GRAVITY
from raccoon.hal.wombat.checks.battery_watch import BatteryWatch
from raccoon.hal.wombat.checks.health import ImuWatch, LifeWatch, MotorWatch
from raccoon.hal.wombat.firmware.stock.dialect import StockDialect

FLAT = (0.0, 0.0, GRAVITY)
RIGHT, WRONG = (0.0, 0.0, 1.0), (0.0, 0.0, 11.0)


def test_an_imu_that_is_wrong_now_and_then_is_found_out_and_a_damaged_frame_is_not() -> None:
    def judged(rates: list[tuple[float, float, float]]) -> bool:
        watch = ImuWatch()
        for number, rate in enumerate(rates):
            watch.update(rate, FLAT, at_rest=False, time=0.02 * number)
        watch.update(RIGHT, FLAT, at_rest=False, time=0.02 * len(rates))
        return watch.is_distrusted(0.02 * len(rates) + 0.5)

    assert judged([WRONG, WRONG, *[RIGHT] * 4, WRONG, WRONG])
    assert not judged([WRONG, WRONG])
    assert not judged([WRONG, *[RIGHT] * 5] * 4)


@pytest.mark.parametrize("word", [math.nan, math.inf, -3e38, 1e4])
def test_an_imu_is_not_given_up_for_one_word_whatever_it_is(word: float) -> None:
    gyro, accel = [(0.0, word, 0.0), RIGHT, RIGHT], [FLAT, (word, 0.0, GRAVITY), (0.0, 0.0, word)]
    for rate, force in zip(gyro, accel, strict=True):
        watch = ImuWatch()
        watch.update(RIGHT, FLAT, at_rest=True, time=0.0)
        watch.update(rate, force, at_rest=True, time=0.02)
        assert watch.is_distrusted(0.02)
        watch.update(RIGHT, FLAT, at_rest=True, time=0.04)
        assert not watch.is_distrusted(0.04)


def test_an_imu_on_edge_tells_no_turn_and_one_on_a_ramp_or_on_its_back_does() -> None:
    def judged(force: tuple[float, float, float]) -> bool:
        watch = ImuWatch()
        for number in range(100):
            watch.update(RIGHT, force, at_rest=True, time=0.02 * number)
        return watch.is_distrusted(2.0)

    assert judged((GRAVITY, 0.0, 0.0))
    assert judged((0.0, -0.9 * GRAVITY, 0.4 * GRAVITY))
    assert not judged((0.5 * GRAVITY, 0.0, 0.86 * GRAVITY))
    assert not judged((0.0, 0.0, -GRAVITY))  # how the robot turns tells that


def test_a_pause_in_which_nobody_looked_is_no_silence_of_a_controller() -> None:
    watch, turning, duty = LifeWatch(), (900.0, 900.0, 0.0, 0.0), (0.5, 0.5, 0.0, 0.0)
    watch.update(b"a", 5.0, turning, duty)
    watch.update(b"a", 7.0, turning, duty)  # one frame that is repeated
    assert not watch.is_stale
    hangs = []
    for look in range(60):
        watch.update(b"a", 7.005 + 0.005 * look, turning, duty)
        hangs.append(watch.has_hung)
    assert 30 <= hangs.index(True) <= 40


def test_a_motor_that_is_to_turn_faster_at_once_is_given_its_time() -> None:
    watch, time = MotorWatch(), 0.0
    counts = 0.27 * 6.6 / BEMF_VOLTS_PER_COUNT

    def drives(duty: float, seconds: float) -> bool:
        nonlocal time
        found = False
        for _ in range(round(seconds / 0.005)):
            time += 0.005
            found = watch.update((duty, 0.0, 0.0, 0.0), (counts, 0.0, 0.0, 0.0), time)
        return found

    assert not drives(0.27, 1.0)
    assert not drives(1.0, 0.05)
    assert drives(1.0, 0.6)  # it never did


def test_a_heavy_robot_that_is_driven_back_is_given_the_time_of_a_start() -> None:
    """Friction, 0.15 of the duty, holds it where it came to rest; then it takes 0.3 s to follow its duty."""
    watch, time, share = MotorWatch(), 0.0, 0.0

    def drives(duty: float) -> bool:
        nonlocal time, share
        time += 0.005
        share += (min(duty + 0.15, 0.0) - share) * 0.005 / 0.3
        counts = share * 6.6 / BEMF_VOLTS_PER_COUNT
        return watch.update((duty, 0.0, 0.0, 0.0), (counts, 0.0, 0.0, 0.0), time)

    assert not any(drives(0.15) for _ in range(100))
    assert not any(drives(max(-0.6, -0.02 * cycle)) for cycle in range(200))
    blocked = [watch.update((-0.6, 0.0, 0.0, 0.0), (0.0,) * 4, time + 0.005 * each) for each in range(1, 8)]
    assert blocked[-1]  # as it turns: missed at once


@pytest.mark.parametrize("stock", [False, True])
def test_a_battery_that_is_low_stays_so_until_it_is_clearly_better(stock: bool) -> None:
    """The filter of the stock firmware keeps the lowest voltage under load, up to 0.17 V too low."""
    held = StockDialect.battery_held * BATTERY_VOLTS_PER_COUNT if stock else 0.0
    watch, time, word = BatteryWatch(held), 0.0, 720

    def reads(volts: float) -> bool:
        nonlocal time, word
        low = False
        for sample in range(1600):
            word = int(0.95 * word + 0.05 * (volts / BATTERY_VOLTS_PER_COUNT + (-1, 1, 0)[sample % 3]))
            if sample % 4 == 0:
                time += 0.005
                low = watch.update(word * BATTERY_VOLTS_PER_COUNT if stock else volts, time)
        return low

    volts = (6.5, 5.55, 5.95, 5.76, 5.85, 5.64, 5.8, 5.98)
    assert [reads(each) for each in volts] == [False, True, False, False, False, True, True, False]
