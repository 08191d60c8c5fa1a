"""Several recordings as one log: nothing of one reaches the next."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from blind.generator import make
from raccoon.core.config import RobotConfig
from raccoon.core.errors import TraceError
from raccoon.diagnose.drives.features import SETTLING_S, Features
from raccoon.diagnose.drives.log import Load, Log, log_from_columns
from raccoon.diagnose.drives.log_joining import PAUSE_S, join_logs
from raccoon.diagnose.drives.sample_clock import SampleClock
from raccoon.diagnose.findings.held_out import FITTED_SHARE, fitted_bins

ROBOT = RobotConfig()


def log(seed: int, seconds: float = 4.0) -> Log:
    return log_from_columns(make(seed, seconds=seconds).columns, ROBOT)


def test_one_log_stays_as_it_is() -> None:
    one = log(1)
    assert join_logs([one]) is one
    assert one.split_recordings() == [one]


def test_each_recording_comes_out_as_it_went_in() -> None:
    every = [log(1), log(2, 3.0), log(3)]
    both = join_logs(every)
    for before, after in zip(every, both.split_recordings(), strict=True):
        shift = after.time[0] - before.time[0]
        np.testing.assert_allclose(after.time[:-1] - shift, before.time, atol=1e-9)
        np.testing.assert_array_equal(after.duty[:-1], before.duty)
        np.testing.assert_array_equal(after.duty[-1], 0.0)
        for one, two in zip(before.channels, after.channels, strict=True):
            np.testing.assert_array_equal(two.values[:-1], one.values)
            assert np.isnan(two.values[-1])
        assert after.runs == ()
    starts = [each.start for each in both.runs]
    ends = [each.time[-1] for each in both.split_recordings()]
    np.testing.assert_allclose(np.array(starts[1:]) - ends[:-1], PAUSE_S)


def test_nothing_is_compared_between_them_nor_before_the_next_has_settled() -> None:
    both = join_logs([log(1), log(2)])
    features = Features.of(both)
    end, start = both.split_recordings()[0].time[-1], both.runs[1].start
    assert features.starts == (start,)
    between = (features.time > end - 0.01) & (features.time < start + SETTLING_S)
    assert not between.any()
    alone = Features.of(both.split_recordings()[1])
    part = features.measured[features.time > start]
    np.testing.assert_allclose(part, alone.measured[: len(part)], atol=0.3 * np.abs(part).max())


def test_what_was_known_of_each_is_kept_at_its_time() -> None:
    one = replace(log(1), notes=("it is so",), lost=((1.0, 2.0),), held=((0.5, 0.7),))
    two = replace(
        log(2), notes=("it is so",), loads=(Load(1.0, 2.0, 0.1),), stalls=(("motor.0.duty", "stood"),)
    )
    both = join_logs([one, two])
    shift = both.runs[1].start - two.time[0]
    assert both.notes[1:] == ("recordings 1, 2: it is so",)
    assert join_logs([one, log(2)]).notes[1:] == ("recording 1: it is so",)
    assert f"number 2 at {both.runs[1].start:.1f} s" in both.notes[0]
    assert both.lost[0] == (1.0, 2.0)
    assert both.held == ((0.5, 0.7),)
    (load,) = both.loads
    assert (load.start, load.end) == pytest.approx((1.0 + shift, 2.0 + shift))
    assert both.stalls == (("motor.0.duty", "recording 2: stood"),)
    again = join_logs([replace(one, stalls=(("motor.0.duty", "stood too"),)), two])
    assert [text for _, text in again.stalls] == ["recording 1: stood too", "recording 2: stood"]


def test_a_clock_tells_the_same_of_its_recording() -> None:
    clock = SampleClock(0.0055, np.array([0.0, 4.0]), np.array([0.001, 0.002]))
    one, two = log(1), replace(log(2), clocks=(clock, None))
    after = join_logs([one, two]).split_recordings()[1]
    moved = after.clocks[0]
    assert moved is not None
    assert after.clocks[1] is None
    shift = after.time[0] - two.time[0]
    np.testing.assert_allclose(
        moved.times_in_force(after.time[:-1]) - shift, clock.times_in_force(two.time), atol=1e-9
    )


def test_a_channel_that_one_of_them_lacks_is_missing() -> None:
    one = log(1)
    two = replace(one, channels=one.channels[:2], missing=("imu.gyro.z", "battery.voltage"))
    both = join_logs([one, two])
    assert [each.role for each in both.channels] == ["bemf_left", "bemf_right"]
    assert {"imu.gyro.z", "battery.voltage"} <= set(both.missing)
    assert "recording 2 lacks imu.gyro.z, so it is left out of all" in both.notes
    with pytest.raises(TraceError, match="no channel in common"):
        join_logs([replace(one, channels=one.channels[:1]), replace(one, channels=one.channels[1:2])])


def test_more_than_fits_into_memory_is_refused() -> None:
    with pytest.raises(TraceError, match=r"have 6\d\d s; at most 600 s are fitted together.*name fewer"):
        join_logs([log(1)] * 160)


@pytest.mark.parametrize("known", [True, False])
def test_rows_that_brake_are_known_where_any_say_it(known: bool) -> None:
    one = log(1)
    shorted = replace(one, brake=np.ones(one.duty.shape, bool))
    both = join_logs([shorted, shorted if known else one])
    assert both.brake is not None
    assert both.brake.shape == both.duty.shape
    assert join_logs([one, one]).brake is None


def test_the_longest_part_is_of_one_recording() -> None:
    both = join_logs([log(1), log(2, 6.0), log(3)])
    part = both.longest_part()
    assert part.runs == ()
    assert part.lost == ()
    assert part.time[0] == both.runs[1].start
    assert part.time[-1] < both.runs[2].start


def test_the_last_part_of_each_is_kept_for_judging() -> None:
    """A battery's charge is known of no recording that was not seen at all."""
    features = Features.of(join_logs([log(1), log(2)]))
    fitted = fitted_bins(features)
    for inside in (features.time < features.starts[0], features.time >= features.starts[0]):
        assert fitted[inside].mean() == pytest.approx(FITTED_SHARE, abs=0.01)
        assert np.all(np.diff(fitted[inside].astype(int)) <= 0)
