"""What is ended early ends cleanly: errors in one of several, limits within limits, Ctrl-C in the middle."""

import math
from collections.abc import Callable

import pytest

from raccoon import (
    Action,
    MotionTimeout,
    Robot,
    after_angle,
    after_distance,
    after_time,
    align_on_wall,
    arc,
    background,
    deg,
    do,
    drive,
    follow_path,
    motors,
    open_robot,
    parallel,
    race,
    repeat,
    seq,
    straight,
    turn,
    wait,
)
from robots import CONFIG, endless_action, run, simulated_port


def raises(error: BaseException, after: float = 0.3) -> Action[None]:
    """Stands for a bug in one branch of a program."""

    def fail(_robot: Robot) -> None:
        raise error

    return seq(wait(after), do(fail)).then(lambda _: wait(0.0))


class Told(Exception):
    """A team's own error."""


@pytest.mark.parametrize(
    "program",
    [
        lambda error: parallel(straight(0.5), raises(error)),
        lambda error: parallel(raises(error), straight(0.5)),
        lambda error: race(straight(0.5), parallel(wait(5.0), raises(error))),
        lambda error: seq(background(raises(error)), straight(0.5)),
        lambda error: repeat(seq(drive(0.1).until(after_time(0.2)), raises(error, 0.05))),
    ],
    ids=["beside a motion", "before it", "deep inside", "in the background", "in a repeat"],
)
@pytest.mark.parametrize("error", [Told("a bug"), KeyboardInterrupt()], ids=["bug", "Ctrl-C"])
def test_an_error_anywhere_stops_the_motors_and_the_rest(
    program: Callable[[BaseException], Action[object]], error: BaseException
) -> None:
    with open_robot(CONFIG, port=simulated_port()) as robot:
        robot.run(wait(0.2))
        with pytest.raises(type(error)):
            robot.run(program(error))
        assert robot.outputs.duty == (0.0, 0.0, 0.0, 0.0)
        begin = robot.estimate.distance
        robot.run(wait(0.5))  # nothing runs on in the background
        assert robot.estimate.distance == pytest.approx(begin, abs=0.02)
        assert robot.run(straight(0.05)).along == pytest.approx(0.0, abs=0.002)


@pytest.mark.parametrize(
    ("motion", "said"),
    [
        (
            straight(1.0, timeout=0.5),
            r"straight not done after 0\.5 s: 0\.\d+ of 1\.000 m; the wheels follow",
        ),
        (turn(3.0, timeout=0.5), r"turn not done after 0\.5 s: \d+\.\d of 171\.9 deg; the wheels follow"),
    ],
    ids=["straight", "turn"],
)
def test_a_motion_that_is_late_says_how_far_it_came(motion: Action[object], said: str) -> None:
    with pytest.raises(MotionTimeout, match=said):
        run(motion)


def test_the_inner_limit_comes_first() -> None:
    result, end, robot = run(straight(1.0).timeout(1.0).timeout_or(5.0, turn(0.2)))
    assert end.heading == pytest.approx(0.2, abs=0.02)
    assert end.x < 0.2
    assert robot.time < 4.0
    assert result.duration < 2.0


def test_the_outer_limit_comes_first() -> None:
    with pytest.raises(MotionTimeout, match=r"not done after 0\.5 s"):
        run(repeat(straight(0.05).timeout_or(3.0, wait(0.0))).timeout(0.5))


def test_a_limit_holds_for_all_that_is_inside() -> None:
    inside = parallel(seq(straight(0.05), straight(0.5)), wait(60.0))
    result, _, robot = run(inside.timeout_or(1.5, do(lambda _: "rescued")))
    assert result == "rescued"
    assert robot.time < 2.5


def test_what_was_started_is_ended_also_where_ending_one_of_them_fails() -> None:
    ended: list[str] = []

    bad, good = endless_action(ended, "bad", Told("while it was ended")), endless_action(ended, "good")
    for together in (race, parallel):
        with pytest.raises(Told, match="while it was ended"):
            run(together(bad, good, wait(0.1)).timeout_or(0.2, wait(0.0)))
        assert sorted(ended) == ["bad", "good"]
        ended.clear()


def test_what_follows_a_motion_that_lost_a_race_drives_in_the_same_tick() -> None:
    """The motion has asked for its speed in the tick in which the other action ended."""
    motions = drive(0.1), motors(0.3, 0.3), straight(0.5), turn(1.0), arc(0.3, 1.0), align_on_wall(0.1)
    with open_robot(CONFIG, port=simulated_port()) as robot:
        for motion in motions:
            robot.run(seq(race(motion, wait(0.05)), drive(0.1).until(after_time(0.02))))
            assert robot.outputs.duty == (0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize("reached", [0.02, 0.08])
def test_what_follows_a_straight_that_was_ended_starts_where_that_came_to(reached: float) -> None:
    _, end, _ = run(seq(straight(0.6).until(after_distance(reached)), straight(0.1)))
    assert end.x == pytest.approx(reached + 0.1, abs=0.005)


@pytest.mark.parametrize(
    ("motion", "reached"),
    [
        (turn(deg(90)), 5.0),
        (drive(0.1, 1.0), 5.0),
        (arc(0.3, deg(90)), 15.0),
        (follow_path([(0.3, 0.0), (0.3, 0.6)], rounding=0.3), 5.0),
        (follow_path([(0.3, 0.0), (0.3, 0.6)], rounding=0.3), 25.0),
    ],
)
def test_what_follows_a_turn_that_was_ended_keeps_it(motion: Action[object], reached: float) -> None:
    _, end, _ = run(seq(motion.until(after_angle(deg(reached))), straight(0.1)))
    assert math.degrees(end.heading) == pytest.approx(reached, abs=2.5)
