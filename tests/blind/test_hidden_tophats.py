"""Tophats with something hidden, over floors as they are."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from blind.generator import make
from blind.tophats import tophat
from raccoon.core.config import parse_robot
from raccoon.core.errors import TraceError
from raccoon.diagnose.recordings.diagnosis import diagnose_recording
from raccoon.diagnose.result import Diagnosis, Verdict

ROBOT = parse_robot({"tophat": {"front": {"analog": 2}}})
BOTH_WAYS = pytest.mark.parametrize("truth_free", [False, True])


def found_in(columns: dict[str, np.ndarray], truth_free: bool = False) -> Diagnosis:
    return diagnose_recording(columns, ROBOT, truth_free=truth_free)


@BOTH_WAYS
@pytest.mark.parametrize(
    "how",
    [
        {"rate": 250.0}, {"rate": 100.0}, {"rate": 50.0}, {"rate": 25.0}, {"grain": 0.05, "rate": 50.0},
        {"held": True}, {"seconds": 4.0}, {"noise": 6.0},
    ],
)  # fmt: skip
def test_a_sound_sensor_over_an_uneven_floor_is_adequate(how: dict[str, Any], truth_free: bool) -> None:
    """Paper is brighter here than there by 2 %, which is no noise, no height and no drift of the sensor."""
    found = found_in(tophat(int(truth_free), **how), truth_free)
    assert found.causes == ()
    assert found.verdict is Verdict.ADEQUATE


@BOTH_WAYS
@pytest.mark.parametrize(
    ("hidden", "cause"),
    [
        ({"offset": 120.0, "held": True}, "tophat.ambient_light"),
        ({"offset": -150.0}, "tophat.ambient_light"),
        ({"factor": 0.9}, "tophat.gain"),
        ({"factor": 1.05, "held": True}, "tophat.gain"),
        ({"height": 0.010, "held": True}, "tophat.height"),
        ({"height": 0.018}, "tophat.height"),
        ({"noise": 30.0, "held": True}, "tophat.noise"),
    ],
)
def test_one_hidden_cause_is_named_alone(hidden: dict[str, Any], cause: str, truth_free: bool) -> None:
    found = found_in(tophat(5, **hidden), truth_free)
    assert [each.id for each in found.causes] == [cause]
    assert not found.causes[0].confounded_with
    assert found.verdict is Verdict.EXPLAINED


@pytest.mark.parametrize("seed", range(4))
def test_a_sensor_of_the_older_make_is_said_to_be_one(seed: int) -> None:
    """It is no newer one that sits 2 mm above the floor and reads 38 % more."""
    found = found_in(tophat(seed, make="old"), truth_free=seed % 2 == 0)
    (cause,) = found.causes
    assert cause.id == "tophat.gain"
    assert "older make" in cause.explanation
    assert cause.confounded_with
    assert found.verdict is Verdict.PARTLY


@pytest.mark.parametrize(("height", "sun"), [(0.010, 0.01), (0.013, 0.03), (0.012, 0.08)])
def test_height_and_light_together_are_named_with_what_else_it_may_be(height: float, sun: float) -> None:
    """What real calibrations differ by. Two numbers give any two levels, so nothing is certain."""
    found = found_in(tophat(6, height=height, sun=sun))
    numbers = {each.id: each for each in found.causes}
    assert set(numbers) == {"tophat.height", "tophat.ambient_light"}
    assert numbers["tophat.height"].parameters["height"].value == pytest.approx(height, abs=0.001)
    assert "direct sun" in numbers["tophat.ambient_light"].explanation
    assert all(each.confounded_with == ("tophat.gain",) for each in found.causes)
    assert found.suggested_manoeuvres


@pytest.mark.parametrize("factor", [0.8, 1.1])
def test_two_numbers_are_never_certain(factor: float) -> None:
    found = found_in(tophat(7, factor=factor, offset=-300.0, height=0.012))
    assert len(found.causes) > 1
    assert all(each.confounded_with for each in found.causes)


@BOTH_WAYS
def test_a_line_that_is_seldom_seen_is_seen(truth_free: bool) -> None:
    """60 of 4000 readings."""
    columns = tophat(8, held=True, factor=0.9)
    white = np.flatnonzero(columns["truth.surface.2"] == 0.0)
    black = np.flatnonzero(columns["truth.surface.2"] == 1.0)
    rows = np.concatenate(
        [white[:600], black[:20], white[600:1200], black[20:40], white[1200:], black[40:60]]
    )
    seldom = {name: each[rows] for name, each in columns.items()} | {"t": 0.005 * np.arange(len(rows))}
    found = found_in(seldom, truth_free)
    assert [each.id for each in found.causes] == ["tophat.gain"]


@pytest.mark.parametrize("seed", range(3))
def test_a_shadow_over_one_surface_is_no_cause(seed: int) -> None:
    """Nobody says that what it darkens is white, and two levels are explained by any two numbers."""
    rng = np.random.default_rng(seed)
    time = 0.005 * np.arange(4000)
    shade = np.where((time > 6.0) & (time < 12.0), 800.0, 1270.0)
    found = found_in({"t": time, "analog.2": np.round(shade + 4.0 * rng.standard_normal(4000))})
    assert found.causes == ()
    assert any("one surface in changing light" in each for each in found.notes)
    drift = np.round(1270.0 + 10.0 * time + 4.0 * rng.standard_normal(4000))
    assert found_in({"t": time, "analog.2": drift}).verdict is Verdict.NOT_IDENTIFIABLE


@pytest.mark.parametrize("bits", [10, 8])
def test_readings_of_fewer_bits_are_said_to_be_that(bits: int) -> None:
    columns = tophat(9)
    columns["analog.2"] = np.floor(columns["analog.2"] / 2.0 ** (12 - bits))
    found = found_in(columns)
    assert found.verdict is Verdict.NOT_IDENTIFIABLE
    assert f"looks like readings of {bits} bits" in found.notes[0]


@pytest.mark.parametrize(
    ("factor", "said"),
    [
        (3.3 / 4095.0, "it reaches 3.08, with fractions: it looks like volts or shares"),
        (1.0 / 4095.0, "it looks like volts or shares of the largest reading"),
        (100.0 / 4095.0, "are the usual counts divided by 40.96: it looks like percent"),
    ],
)
def test_readings_in_another_unit_are_no_cause(factor: float, said: str) -> None:
    """Percent were a sensor that reads 98 % less than assumed, volts a white and black of 1 and 3 counts."""
    columns = tophat(5)
    columns["analog.2"] *= factor
    found = found_in(columns)
    assert found.verdict is Verdict.NOT_IDENTIFIABLE
    assert said in found.notes[0]


@pytest.mark.parametrize(("factor", "asked"), [(3300.0 / 4095.0, True), (0.9, False)])
def test_a_gain_that_millivolts_would_be_is_asked_after(factor: float, asked: bool) -> None:
    columns = tophat(5)
    columns["analog.2"] = np.round(columns["analog.2"] * factor)
    (gain,) = found_in(columns).causes
    assert gain.id == "tophat.gain"
    assert ("if the column is in millivolts, write counts" in gain.explanation) is asked


def test_impossible_readings_are_left_out_and_said() -> None:
    columns = tophat(10)
    columns["analog.2"][[5, 900, 901]] = 99999.0, -20.0, 65535.0
    found = found_in(columns)
    assert found.verdict is Verdict.ADEQUATE
    (fault,) = found.sensor_faults
    assert (fault.channel, fault.fault) == ("analog.2", "impossible")
    assert "3 impossible values such as" in fault.text


@BOTH_WAYS
def test_spikes_of_a_loose_plug_are_no_surface(truth_free: bool) -> None:
    columns = tophat(11)
    rows = np.random.default_rng(3).choice(4000, 60, replace=False)
    columns["analog.2"][rows] = 0.0
    assert found_in(columns, truth_free).causes == ()


@pytest.mark.parametrize(
    ("time", "said"),
    [
        (lambda t: 1000.0 * t, "looks like milliseconds, not"),
        (lambda t: 200.0 * t, "looks like milliseconds or hundredths of a second, or numbers of rows, not"),
        (lambda t: t[::-1], "must advance"),
        (lambda t: np.where(t == t[7], np.nan, t), "not a number"),
    ],
)
def test_a_time_that_is_wrong_is_an_error(time: Any, said: str) -> None:
    columns = tophat(12)
    columns["t"] = np.asarray(time(columns["t"]))
    with pytest.raises(TraceError, match=said):
        found_in(columns)


@pytest.mark.usefixtures("few_causes")
def test_what_a_drive_says_of_its_tophats_is_kept() -> None:
    """Whether levels jump, and what was left out; but not that a drive crossed no line."""
    columns = dict(make(4, seconds=8.0).columns)
    seconds = columns["t"] - columns["t"][0]
    other = tophat(13, rate=1000.0, seconds=10.0, changing=lambda time: np.where(time > 5.0, 0.02, 0.0))
    columns["analog.2"] = np.interp(seconds, other["t"], other["analog.2"])
    columns["analog.2"][100] = 70000.0
    columns["analog.3"] = np.full(len(seconds), 1270.0)
    robot = parse_robot({"tophat": {"front": {"analog": 2}, "rear": {"analog": 3}}})
    found = diagnose_recording(columns, robot)
    assert [each.name for each in found.causes] == ["tophat.ambient_light@2"]
    assert found.verdict is Verdict.PARTLY
    assert any(each.startswith("analog.2 jumps at ") for each in found.notes)
    assert [each.channel for each in found.sensor_faults] == ["analog.2"]
    assert not any("analog.3" in each for each in found.notes)


@pytest.mark.parametrize(
    ("when", "sun", "truth_free"),
    [(5.3, 0.3, True), (9.0, 0.005, True), (16.7, 0.03, False), (16.7, 0.3, True)],
)
def test_a_lamp_that_is_switched_on_is_said_with_its_time(when: float, sun: float, truth_free: bool) -> None:
    """Wherever it falls among the pieces that the readings are sorted in, and also where it lowers black to
    where white was: a sensor in strong light was as assumed."""
    found = found_in(tophat(7, changing=lambda time: np.where(time < when, 0.0, sun)), truth_free)
    assert [each.id for each in found.causes] == ["tophat.ambient_light"]
    assert found.verdict is Verdict.PARTLY
    assert found.unexplained.depends_on == ("time",)
    said = next(each for each in found.notes if "jumps at" in each)
    assert float(said.split("jumps at ")[1].split()[0]) == pytest.approx(when, abs=0.4)
    assert "until then: as assumed" in said
    assert found.identified["analog.2 over white"].value < 1270.0


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("seconds", [2.0, 3.0])
def test_few_readings_on_blurred_edges_are_no_change(seconds: float, seed: int) -> None:
    """A level of eight readings, all on an edge, is off by more than one of a hundred."""
    columns = tophat(seed, seconds=seconds)
    blurred = np.convolve(np.pad(columns["analog.2"], 9, mode="edge"), np.full(19, 1.0 / 19.0), "valid")
    found = found_in({**columns, "analog.2": np.round(blurred)}, truth_free=seed % 2 == 0)
    assert found.causes == ()
    assert found.verdict in (Verdict.ADEQUATE, Verdict.NOT_IDENTIFIABLE)


def test_readings_that_flicker_too_much_are_said_to() -> None:
    """That only one surface was seen would be a lie, and sends a team to drive again."""
    flicker = tophat(3, changing=lambda time: 0.05 * (1.0 + np.cos(2.0 * np.pi * 99.3 * time)))
    hidden = found_in(flicker, truth_free=True)
    assert hidden.verdict is Verdict.NOT_IDENTIFIABLE
    assert "from one to the next" in hidden.notes[0]
    assert "flickering lamps" in hidden.notes[0]
    # A reference tells the surfaces apart, and then the noise has its name.
    assert "tophat.noise" in {each.id for each in found_in(flicker).causes}


def test_direct_sun_is_no_power_of_ten() -> None:
    (cause,) = found_in(tophat(3, sun=1.0)).causes
    assert "about 100 % of direct sun" in cause.explanation
