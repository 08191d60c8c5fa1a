"""A wheel whose counter and back-EMF stay the same to the bit, and nobody says so."""

from dataclasses import replace

import pytest

from drive_traces import drive
from raccoon.core.config import RobotConfig
from raccoon.core.readings import BEMF_FROZEN_SECONDS, Inputs, Status, Words
from raccoon.estimate.drive.estimate import DriveEstimate
from raccoon.estimate.drive.odometry import Odometry
from raccoon.estimate.drive.wheel_track import HOLD_S, WheelTrack

AT = 2.5


def driven(frozen: int) -> tuple[DriveEstimate, Inputs]:
    """The end of a straight drive in which the first so many motors' words stop changing at `AT`."""
    bemf: Words = (0.0,) * frozen
    odometry, position = Odometry(RobotConfig()), bemf
    for inputs, command in drive([(1.5, 0.0, 0.0), (3.0, 0.18, 0.0), (1.0, 0.0, 0.0)]):
        if inputs.time < AT:
            bemf, position = inputs.bemf[:frozen], inputs.position[:frozen]
        read = replace(inputs, bemf=bemf + inputs.bemf[frozen:], position=position + inputs.position[frozen:])
        estimate = odometry.update(read, command)
    return estimate, inputs


@pytest.mark.parametrize(("frozen", "status"), [(1, Status.UNCERTAIN), (2, Status.INVALID)])
def test_words_that_stay_the_same_are_no_readings(frozen: int, status: Status) -> None:
    """The counter was called dead, and a back-EMF as dead was believed: robots that stood drove on."""
    estimate, inputs = driven(frozen)
    assert inputs.truth is not None
    assert estimate.status is status
    assert "the left wheel is silent" in estimate.reasons
    assert estimate.velocity == pytest.approx(0.0, abs=0.01)
    assert abs(estimate.x - inputs.truth.x) < 2.0 * estimate.x_std
    if frozen == 1:
        assert abs(estimate.x - inputs.truth.x) < 0.02


def test_a_wheel_is_silent_while_its_words_are_the_same_and_heard_again_when_they_change() -> None:
    track = WheelTrack(0.01)
    for _ in range(round((BEMF_FROZEN_SECONDS + 2.0 * HOLD_S) / 0.01)):
        track.update(0.01, 5.0, 0.0)
    assert track.silence > 0.5 * HOLD_S
    track.update(0.01, 4.9, 0.05)
    assert track.silence == 0.0


@pytest.mark.parametrize(("speed", "angle"), [(5.0, 0.05), (0.1, 0.0)])
def test_words_without_noise_are_read_while_their_counter_counts_and_near_rest(
    speed: float, angle: float
) -> None:
    track = WheelTrack(0.01)
    for _ in range(300):
        track.update(0.01, speed, angle)
        assert track.silence == 0.0
