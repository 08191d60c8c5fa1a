"""How a motion ends whose robot stays a little beside its goal: friction gives in steps, or not at all."""

from contextlib import suppress
from dataclasses import replace

import pytest

from raccoon import MotionTimeout, Pose, open_robot, straight
from raccoon.control.profile import profile
from raccoon.core.readings import Fault, Inputs
from raccoon.robot.motions.pacing import LAG_LIMIT, Pace
from raccoon.sim.port import SimPort
from robots import CONFIG, simulated_port


@pytest.mark.parametrize(
    ("off", "tolerance", "ends"),
    [(0.0009, None, 0.0), (0.003, None, 1.5), (0.0045, None, None), (0.003, 0.001, None)],
)
def test_a_robot_that_rests_beside_its_goal_is_let_go(
    off: float, tolerance: float | None, ends: float | None
) -> None:
    walk = profile(0.1, 0.2, 0.5, 0.0)
    with open_robot(CONFIG, port=simulated_port()) as robot:
        robot.tick()
        pace, ended = Pace(robot, walk, LAG_LIMIT), None
        states = pace.states(lambda: 0.1 - off, lambda _: Pose(0.0, 0.0, 0.0))
        with suppress(MotionTimeout):
            for _ in states:
                if ended is None and pace.may_end(off, tolerance):
                    ended = robot.time - pace.begin - walk.duration
                robot.tick()
        assert robot.time - pace.begin > 2.0 * walk.duration + 2.0
    assert ended == (None if ends is None else pytest.approx(ends, abs=0.02))


@pytest.mark.parametrize("sign", [1.0, -1.0], ids=["forwards", "backwards"])
def test_a_profile_waits_for_a_robot_that_stays_and_gives_up_some_time_after_it_last_moved(
    sign: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    patience, moves_at, catch_up = 0.5, 0.8, 0.05  # s; then the profile is as far ahead again
    monkeypatch.setattr("raccoon.robot.motions.pacing.HELD_PATIENCE_S", patience)
    with open_robot(CONFIG, port=simulated_port()) as robot:
        robot.tick()
        pace = Pace(robot, profile(0.4 * sign, 0.2, 0.5, 0.0), LAG_LIMIT)

        def progress() -> float:
            return sign * (0.03 if robot.time - pace.begin < moves_at else 0.04)

        with suppress(MotionTimeout):
            for state in pace.states(progress, lambda _: Pose(0.0, 0.0, 0.0)):
                assert sign * (state.position - progress()) < LAG_LIMIT + 0.004  # it goes 2 mm a tick
                robot.tick()
        assert robot.time - pace.begin == pytest.approx(moves_at + catch_up + patience, abs=0.02)


def test_a_motion_that_gives_up_says_what_was_strange_on_its_way(monkeypatch: pytest.MonkeyPatch) -> None:
    """A push or a slip at its beginning may be why, and the odometry speaks of neither for long."""
    read = SimPort.read

    def restarted(port: SimPort) -> Inputs:
        inputs = read(port)
        return replace(inputs, faults=(Fault.STALE,)) if 0.2 < inputs.time < 0.25 else inputs

    monkeypatch.setattr(SimPort, "read", restarted)
    with (
        open_robot(CONFIG, port=simulated_port()) as robot,
        pytest.raises(MotionTimeout, match=r"the wheels follow; on the way: port: stale$"),
    ):
        robot.run(straight(0.5, timeout=1.0))
