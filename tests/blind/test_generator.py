"""The independent plant must be what it claims: deterministic, damaged like real recordings, physically
sound."""

from __future__ import annotations

import numpy as np
import pytest

from blind.generator import Noise, make
from blind.hidden import CAUSES, Hidden, draw
from blind.plant import COUNTS_PER_VOLT, NEUTRAL, parameters, simulate

QUIET = Noise(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def test_the_same_seed_gives_the_same_recording() -> None:
    one, two = make(7, seconds=5.0), make(7, seconds=5.0)
    assert all(np.array_equal(one.columns[key], two.columns[key], equal_nan=True) for key in one.columns)


def test_samples_are_missing_and_the_clock_jitters() -> None:
    steps = np.diff(make(7, seconds=10.0).columns["t"])
    assert steps.max() > 0.009
    assert steps.std() > 5e-5


def test_steady_back_emf_follows_the_textbook() -> None:
    n = 600
    times = 0.005 * np.arange(n, dtype=np.float64)
    zeros = np.zeros((n, 2))
    state = simulate(parameters({"rint": 0.0}), times, np.full((n, 2), 0.5), zeros, zeros, zeros, 0.0)
    k, r = NEUTRAL["ke_l"], NEUTRAL["resistance_l"]
    speed = (k * 0.5 * NEUTRAL["voc"] / r - NEUTRAL["coulomb"]) / (k * k / r + NEUTRAL["viscous"])
    assert state[-2, 0] == pytest.approx(k * speed * 4096 / 3.3 * 2.2 / 9.0, rel=0.002)


def test_below_breakaway_nothing_rolls() -> None:
    n = 400
    zeros = np.zeros((n, 2))
    state = simulate(
        parameters({}),
        0.005 * np.arange(n, dtype=np.float64),
        np.full((n, 2), 0.03),
        zeros,
        zeros,
        zeros,
        0.0,
    )
    assert abs(state[-2, 6]) < 1e-3


@pytest.mark.parametrize("cause", sorted(CAUSES))
def test_every_hidden_cause_changes_the_recording(cause: str) -> None:
    hidden = draw(cause, np.random.default_rng(1))
    clean, damaged = make(2, noise=QUIET, seconds=8.0), make(2, [hidden], noise=QUIET, seconds=8.0)
    names = ("motor.0.bemf", "motor.1.bemf", "imu.gyro.z", "battery.voltage")
    assert any(
        not np.array_equal(clean.columns[each], damaged.columns[each], equal_nan=True) for each in names
    )


def test_a_wheel_with_play_slips_as_well() -> None:
    """Causes that act together must all be in the recording, or finding them would be luck."""
    play = draw("drive.backlash", np.random.default_rng(1))
    slip = draw("drive.wheel_slip", np.random.default_rng(2))
    alone, both = (make(2, hidden, noise=QUIET, seconds=8.0) for hidden in ([play], [play, slip]))
    gyro = [np.nan_to_num(each.columns["imu.gyro.z"]) for each in (alone, both)]
    assert np.abs(gyro[1] - gyro[0]).max() > 0.1


def test_directions_are_counted_from_the_first_row() -> None:
    """A diagnosis sees nothing of what the robot did before; its position counters have it."""
    drawn = [draw(each, np.random.default_rng(4)) for each in ("drive.slope", "drive.wheel_eccentricity")]
    for seed, moves in ((2, True), (3, False)):
        blind = make(seed, drawn, noise=QUIET, seconds=2.0)
        turned = [
            blind.columns[f"motor.{port}.position"][0] / (NEUTRAL["ke_l"] * COUNTS_PER_VOLT)
            for port in (0, 1)
        ]
        assert (abs(turned[0]) > 0.5) == moves
        heading = NEUTRAL["radius_l"] * (turned[1] - turned[0]) / NEUTRAL["track"]
        slope, wheel = ({**before.values} for before in drawn)
        seen = {each.id: each.values for each in blind.hidden}
        before = complex(slope["along_x"], slope["along_y"])
        after = complex(seen["drive.slope"]["along_x"], seen["drive.slope"]["along_y"])
        assert abs(after) == pytest.approx(abs(before))
        assert np.angle(before / after) == pytest.approx(heading, abs=0.05)
        by = seen["drive.wheel_eccentricity"]["phase"] - wheel["phase"] - turned[drawn[1].where == "right"]
        assert np.sin(by) == pytest.approx(0.0, abs=0.15)
        assert np.cos(by) > 0.9
        assert blind.robot["slope_x"] == seen["drive.slope"]["along_x"]


def test_how_much_of_a_drive_was_on_its_rough_patch_is_known() -> None:
    assert make(7, seconds=5.0).patched == 0.0
    patch = Hidden("unknown", "position", {}, {"patch": 0.5, "patch_length": 0.02})
    on = make(7, [patch], seconds=15.0).patched  # a third of the floor is rough
    assert 0.1 < on < 0.6
