"""The watchers one by one, where a whole robot would hide what they do."""

import math

import pytest

from raccoon.core.readings import BATTERY_VOLTS_PER_COUNT, BEMF_VOLTS_PER_COUNT, GRAVITY
from raccoon.hal.wombat.checks.battery_watch import BatteryWatch
from raccoon.hal.wombat.checks.health import ImuWatch, LifeWatch, Liveness, MotorWatch, RestWatch
from raccoon.hal.wombat.firmware.stock.dialect import StockDialect

CYCLE = 0.005
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


@pytest.mark.parametrize("duty", [0.3, -0.5, 1.0])
def test_a_motor_is_missed_at_once_as_it_turns_and_later_as_it_starts(duty: float) -> None:
    watch, time, free = MotorWatch(), 5.0, duty * 6.6 / BEMF_VOLTS_PER_COUNT
    watch.update((0.0,) * 4, (0.0,) * 4, time)

    def seconds_until_missed(counts: float) -> float | None:
        nonlocal time
        for cycle in range(100):
            time += CYCLE
            if watch.update((0.0, duty, 0.0, 0.0), (0.0, counts, 0.0, 0.0), time):
                return CYCLE * cycle
        return None

    from_rest, from_motion = (pytest.approx(limit, abs=2.01 * CYCLE) for limit in (0.25, 0.02))
    assert seconds_until_missed(0.0) == from_rest
    assert seconds_until_missed(free) is None
    assert seconds_until_missed(0.0) == from_motion
    time += 0.2  # a pause, in which the supervisor may have stopped it
    assert seconds_until_missed(0.0) == from_rest
    duty *= 0.2
    assert seconds_until_missed(0.0) is None
    duty *= 5.0
    assert seconds_until_missed(0.0) == from_rest


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


@pytest.mark.parametrize(("every", "limit"), [(1, 0.06), (4, 0.1), (200, 3.0)])
def test_words_are_dead_after_a_number_of_their_usual_intervals(every: int, limit: float) -> None:
    """Five of them, from 0.06 to 3 s; a pause in which nobody looked is no part of it."""
    watch = Liveness(0.06, 3.0, 5.0)
    for cycle in range(20 * every):
        time = 10.0 + CYCLE * cycle + (1.0 if cycle >= 8 * every + every // 2 else 0.0)
        assert not watch.update(bytes([cycle // every]), time)
        assert watch.fresh is (cycle % every == 0)
    assert watch.rate_hz == pytest.approx(1.0 / (CYCLE * every), rel=0.06)  # the pause takes a cycle with it
    changed = time - CYCLE * (every - 1)
    while not watch.update(bytes([19]), time):
        time += CYCLE
    assert limit < time - changed < limit + 1.01 * CYCLE
    assert watch.age == pytest.approx(time - changed)


@pytest.mark.parametrize(
    ("counts", "duty", "stale", "hangs"),
    [
        (30.0, 0.0, None, None),
        (30.0, 0.1, 0.5, 1.0),
        (30.0, -0.5, 0.3, 0.5),
        (30.0, 0.25, 0.3, 0.5),
        (-100.0, 0.0, 0.05, 0.2),
    ],
)
def test_a_controller_without_a_sign_of_life_hangs_where_a_motor_is_driven_or_turned(
    counts: float, duty: float, stale: float | None, hangs: float | None
) -> None:
    watch, told = LifeWatch(), []
    watch.update(b"at rest", 1.995, (0.0,) * 4, (0.0,) * 4)
    for cycle in range(300):
        watch.update(b"a", 2.0 + CYCLE * cycle, (0.0, counts, 0.0, 0.0), (0.0, 0.0, duty, 0.0))
        told.append((watch.is_stale, watch.has_hung))
    for number, limit in enumerate((stale, hangs)):
        seconds = next((CYCLE * n for n, each in enumerate(told) if each[number]), None)
        assert seconds == (None if limit is None else pytest.approx(limit, abs=1.01 * CYCLE))


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_robot_at_rest_is_turned_less_fast_than_one_that_drives(axis: int, sign: float) -> None:
    def judged(rate: float, at_rest: bool) -> bool:
        watch, gyro = ImuWatch(), [0.0, 0.0, 0.0]
        gyro[axis] = sign * rate
        watch.update((gyro[0], gyro[1], gyro[2]), FLAT, at_rest, 0.0)
        return watch.is_distrusted(0.0)

    told = judged(5.0, True), judged(7.0, True), judged(7.0, False), judged(11.0, False)
    assert told == (False, True, False, True)


@pytest.mark.parametrize("after", [(0.0, 0.0, 2.0 * GRAVITY), (GRAVITY, 0.0, 0.0)])
def test_a_blow_is_believed_and_another_gravity_or_a_fall_is_not(after: tuple[float, float, float]) -> None:
    watch, told = ImuWatch(), []
    for number, force in enumerate([FLAT, (40.0, 0.0, 0.0), FLAT, *[after] * 100]):
        watch.update(RIGHT, force, at_rest=False, time=0.02 * number)
        told.append(watch.is_distrusted(0.02 * number))
    assert not any(told[:4])
    assert told[-1]


@pytest.mark.parametrize("at_rest", [True, False])
def test_an_imu_that_failed_at_rest_is_believed_after_good_words_at_rest_alone(at_rest: bool) -> None:
    watch = ImuWatch()
    for number in range(4):
        watch.update(WRONG, FLAT, at_rest, 0.02 * number)
    for time, resting, distrusted in ((0.5, False, True), (1.2, False, at_rest), (1.3, True, False)):
        watch.update(RIGHT, FLAT, resting, time)
        assert watch.is_distrusted(time) is distrusted


@pytest.mark.parametrize(
    ("known", "counts", "duty", "moves", "offset"),
    [
        (0.0, 30.0, 0.0, True, 30.0),
        (0.0, -30.0, 0.0, True, -30.0),
        (30.0, 30.0, 0.0, False, 30.0),
        (30.0, 0.0, 0.0, False, 0.0),  # hidden by a dead zone
        (0.0, 10.0, 0.0, False, 10.0),  # too little to matter
        (0.0, 30.0, 0.1, False, 0.0),
    ],
)
def test_a_motor_at_rest_that_reads_another_offset_than_is_known_moves_without_a_command(
    known: float, counts: float, duty: float, moves: bool, offset: float
) -> None:
    watch = RestWatch((known, 0.0, 0.0, 0.0))
    for cycle in range(300):
        found = watch.update((duty, 0.0, 0.0, 0.0), (counts, 0.0, 0.0, 0.0), CYCLE * cycle)
    assert found is moves
    assert watch.offset[0] == pytest.approx(offset, abs=0.1)


def test_a_wheel_that_rolls_out_is_not_at_rest() -> None:
    watch, counts = RestWatch(), 900.0
    for cycle in range(300):
        counts *= 0.97
        assert not watch.update((0.0,) * 4, (counts, 0.0, 0.0, 0.0), CYCLE * cycle)
        assert cycle > 100 or not watch.is_resting(CYCLE * cycle)
    assert watch.is_resting(CYCLE * 300)


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
