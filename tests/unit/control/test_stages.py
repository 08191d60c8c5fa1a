"""Profiles along a way whose parts have limits of their own."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from raccoon.control.profile import ProfileState, profile
from raccoon.control.stages import Stage, StagedProfile

STAGES = st.lists(
    st.builds(Stage, st.floats(0.01, 1.0), st.floats(0.05, 1.0), st.floats(0.1, 2.0)), min_size=1, max_size=5
)
JERK = st.sampled_from([0.0, 0.5, 5.0])


@given(STAGES, JERK)
def test_it_arrives_and_keeps_the_limits_of_each_stage(stages: list[Stage], jerk: float) -> None:
    staged = StagedProfile(stages, jerk)
    dt = staged.duration / 100
    before, begins = staged.at(0.0), [sum(each.length for each in stages[:n]) for n in range(len(stages))]
    for step in range(1, 101):
        now = staged.at(step * dt)
        assert now.position >= before.position - 1e-9
        at = max(n for n, begin in enumerate(begins) if now.position >= begin - 1e-9)
        assert now.velocity <= stages[at].speed + 1e-9
        # At a border the acceleration may still be that of the stage before.
        gains = [stages[n].acceleration for n in (at - 1, at) if n == at or now.position < begins[at] + 1e-9]
        assert abs(now.acceleration) <= max(gains) + 1e-9
        assert now.position - before.position == pytest.approx(
            0.5 * (now.velocity + before.velocity) * dt, abs=2.0 * dt * dt
        )
        before = now
    assert staged.at(staged.duration - 1e-9).position == pytest.approx(staged.distance, abs=1e-6)
    assert staged.at(staged.duration - 1e-9).velocity == pytest.approx(0.0, abs=1e-4)


@given(st.floats(0.01, 1.0), st.floats(0.05, 1.0), st.floats(0.1, 2.0), JERK)
def test_one_stage_is_a_plain_profile(length: float, speed: float, gain: float, jerk: float) -> None:
    plain, staged = profile(length, speed, gain, jerk), StagedProfile([Stage(length, speed, gain)], jerk)
    assert staged.duration == pytest.approx(plain.duration)
    for part in (0.1, 0.4, 0.5, 0.9):
        time = part * plain.duration
        assert staged.at(time).position == pytest.approx(plain.at(time).position, abs=1e-6)
        assert staged.at(time).velocity == pytest.approx(plain.at(time).velocity, abs=1e-4)


def test_a_slow_corner_does_not_slow_down_the_straights() -> None:
    """0.4 m at 0.2 m/s, 3 cm at 0.02 m/s and 0.4 m again: 2.0 + 1.5 + 2.0 s, and the changes of speed."""
    straight, corner = Stage(0.4, 0.2, 0.4), Stage(0.03, 0.02, 0.4)
    staged = StagedProfile([straight, corner, straight])
    assert staged.duration == pytest.approx(5.5 + 2 * (0.25 + 0.2025), abs=1e-6)
    assert staged.at(1.5).velocity == pytest.approx(0.2)
    assert staged.at(0.5 * staged.duration).velocity == pytest.approx(0.02)
    assert [staged.at(time).acceleration for time in (0.2, 1.0, staged.duration - 0.2)] == [0.4, 0.0, -0.4]
    assert staged.at(staged.duration + 1.0) == ProfileState(staged.distance, 0.0, 0.0)


@pytest.mark.parametrize("rest", [-0.05, 0.1, 0.41, 0.7, 0.83, 0.9])
def test_what_is_left_of_a_way_has_the_limits_of_its_end(rest: float) -> None:
    """After a pause the motors start again from where the robot is, which may be beyond either end."""
    straight, corner = Stage(0.4, 0.2, 0.4), Stage(0.03, 0.02, 0.4)
    left = StagedProfile([straight, corner, straight]).over(rest)
    assert left.distance == pytest.approx(rest)
    assert left.at(left.duration + 1.0).position == pytest.approx(rest)
    states = [left.at(0.02 * n) for n in range(400)]
    fastest = max(abs(each.velocity) for each in states)
    assert fastest == pytest.approx(min(0.2, (0.4 * abs(rest)) ** 0.5), abs=5e-3)
    in_corner = [each.velocity for each in states if rest - 0.43 < each.position < rest - 0.4]
    assert max(in_corner, default=0.02) == pytest.approx(0.02)


@pytest.mark.parametrize("speed", [0.0, math.nan, math.inf])
def test_a_stage_without_limits_is_refused(speed: float) -> None:
    with pytest.raises(ValueError, match=f"speed={speed}.*above 0 and finite"):
        StagedProfile([Stage(0.4, 0.2, 0.4), Stage(0.4, speed, 0.4)])
