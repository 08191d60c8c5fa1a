"""A motor that is plugged in the other way round shows in the gyro, and slip is not taken for it."""

import pytest

from raccoon.estimate.drive.wiring import Wiring

STEP = 0.02
TURN, STRAIGHT, PIVOT = (0.75, 0.75), (-0.9, 0.9), (0.0, 1.5)
"""rad/s that the left and the right wheel turn the robot by."""


def fed(*motions: tuple[tuple[float, float], float], seconds: float = 0.5) -> Wiring:
    """Motions with what the gyro reads in each, and a moment of rest after each."""
    wiring = Wiring()
    for (left, right), gyro in motions:
        for _ in range(round(seconds / STEP)):
            wiring.update(STEP, left, right, gyro)
        for _ in range(10):
            wiring.update(STEP, 0.0, 0.0, 0.0)
    return wiring


@pytest.mark.parametrize(
    ("motion", "gyro", "turned"),
    [
        (STRAIGHT, 0.0, ()),
        (STRAIGHT, 1.8, ("left",)),
        (STRAIGHT, -1.8, ("right",)),
        (TURN, 1.5, ()),
        (TURN, -1.5, ("left", "right")),
        (PIVOT, -1.5, ("right",)),
        (TURN, 0.75, ()),
        (STRAIGHT, 0.9, ()),
    ],
)
def test_what_is_turned_is_told_within_half_a_second(
    motion: tuple[float, float], gyro: float, turned: tuple[str, ...]
) -> None:
    assert fed((motion, gyro)).turned == turned


def test_a_robot_that_does_not_turn_may_be_stuck_and_is_asked_anew() -> None:
    wiring = Wiring()
    for _ in range(20):
        wiring.update(STEP, *TURN, 0.0)
    assert wiring.suspects
    assert wiring.turned == ()
    assert fed((TURN, 0.0)).suspects == ()
    assert fed((TURN, 0.0), (STRAIGHT, 1.8)).turned == ("left",)


def test_what_was_right_once_is_not_asked_again() -> None:
    assert fed((TURN, 1.5), (TURN, 0.0), (TURN, -1.5), (STRAIGHT, 1.8)).suspects == ()
    # Straight ahead nothing tells whether both are turned.
    assert fed((STRAIGHT, 0.0), (STRAIGHT, 1.8)).suspects == ()
    assert fed((STRAIGHT, 0.0), (TURN, -1.5)).turned == ("left", "right")


def test_what_a_robot_runs_into_is_no_plug() -> None:
    """Straight ahead against an edge: it turns one way, and the wheels already correct that the other way."""
    wiring = fed()
    for _ in range(20):
        wiring.update(STEP, *STRAIGHT, 0.0)
    for _ in range(25):
        wiring.update(STEP, -0.2, 1.2, -1.0)
        assert wiring.suspects == ()
    for _ in range(50):  # what lasts is no blow
        wiring.update(STEP, -0.2, 1.2, -1.0)
    assert wiring.turned == ("left", "right")
    # The next motion is judged by itself.
    assert fed((STRAIGHT, 0.0), (TURN, -1.5)).turned == ("left", "right")


def test_a_verdict_that_was_wrong_is_taken_back() -> None:
    wiring = fed((STRAIGHT, 1.8))
    assert wiring.turned == ("left",)
    for _ in range(15):
        wiring.update(STEP, *STRAIGHT, 0.0)
    assert wiring.suspects == ()
