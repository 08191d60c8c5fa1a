"""What a reference of the pose says, and what a diagnosis makes of it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from diagnoses import factor_parameters, make_cause, make_diagnosis
from raccoon.core.config import Measured, RobotConfig
from raccoon.core.errors import TraceError
from raccoon.core.readings import SI_WORDS
from raccoon.diagnose.findings.fitted_model import clamp_to_bounds, rebase_model
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.hypotheses.coordinates import neutral_settings
from raccoon.diagnose.recordings.diagnosis import diagnose_recording
from raccoon.diagnose.recordings.geometry.diagnosis import diagnose_geometry
from raccoon.diagnose.recordings.reference.factors import ReferenceFactors, factors_of_reference
from raccoon.diagnose.recordings.reference.findings import with_reference_findings
from raccoon.diagnose.recordings.reference.search_start import search_start
from raccoon.diagnose.recordings.reference.units import unrelated_reference_note
from raccoon.diagnose.reports.terminal import terminal_report
from raccoon.diagnose.result import (
    ChannelResult,
    Curve,
    Diagnosis,
    Rejected,
    Verdict,
)
from raccoon.diagnose.rollout.simulated_robot import to_parameters
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.rollout.commands import Commands
from raccoon.sim.rollout.rollout import rollout

ROBOT = RobotConfig()
TRUTH = ("truth.x", "truth.y", "truth.heading")
Columns = dict[str, np.ndarray]
Change = Callable[[Columns], Columns]


def spinning(gyro: float = 1.0, track: float = 1.0, rate: float = 1.5) -> Columns:
    """Spins and straights to both sides with back-EMF, gyro and a reference; factors on gyro and track.
    rate: rad/s of the turns."""
    rng = np.random.default_rng(2)
    time = 0.01 * np.arange(3000)
    forward = np.where(time < 2.0, 0.0, 0.2 * (time % 6.0 < 3.0))
    turn = np.where(time < 2.0, 0.0, rate * np.sign(np.sin(1.3 * time)))
    heading = np.concatenate([[0.0], np.cumsum(0.005 * (turn[1:] + turn[:-1]))])
    along = np.concatenate([[0.0], np.cumsum(0.005 * (forward[1:] + forward[:-1]))])
    x = np.concatenate([[0.0], np.cumsum(np.diff(along) * np.cos(heading[1:]))])
    y = np.concatenate([[0.0], np.cumsum(np.diff(along) * np.sin(heading[1:]))])
    drive, model = ROBOT.model.drive, ROBOT.model.left
    columns: Columns = {"t": time, "truth.x": x, "truth.y": y, "truth.heading": heading}
    counts = 303.4 * model.back_emf_constant.value / drive.wheel_radius.value
    for port, side in ((0, -1.0), (1, 1.0)):
        speed = forward + side * 0.5 * track * drive.track_width.value * turn
        columns[f"motor.{port}.bemf"] = counts * speed + rng.standard_normal(3000)
    return {**columns, "imu.gyro.z": gyro * turn + 0.002 + 0.005 * rng.standard_normal(3000)}


def said(columns: Columns, robot: RobotConfig = ROBOT) -> ReferenceFactors:
    return factors_of_reference(columns, robot, SI_WORDS)


def values(reference: ReferenceFactors) -> list[float]:
    found = (reference.gyro, reference.track, reference.left, reference.right)
    return [each.value for each in found if each is not None]


def test_gyro_track_and_wheels_are_each_told() -> None:
    assert values(said(spinning(gyro=1.07))) == pytest.approx([1.07, 1.0, 1.0, 1.0], abs=0.004)
    assert values(said(spinning(track=1.07))) == pytest.approx([1.0, 1.07, 1.0, 1.0], abs=0.004)


def test_a_few_small_turns_tell_the_gyros_scale() -> None:
    """In turns of 2.4 rad in all it was known to 0.1 % and not used: K_E was named first, in a class."""
    gyro = said({name: each[:1200] for name, each in spinning(gyro=1.03, rate=0.25).items()}).gyro
    assert gyro is not None
    assert gyro.std < 0.003
    assert gyro.value == pytest.approx(1.03, abs=3.0 * gyro.std)


@pytest.mark.parametrize("tick", [1.0, 1.0 / 181.0, 250.0 / 262.0])
def test_counters_of_any_firmware_tell_the_same_ways(tick: float) -> None:
    """A CSV does not say whose they are. A tick that was taken for 181 made the wheels as many times larger,
    and the gyro an error of its unit."""
    columns = spinning()
    for port in (0, 1):
        columns[f"motor.{port}.position"] = np.trunc(np.cumsum(0.01 * columns[f"motor.{port}.bemf"]) / tick)
    columns["motor.1.position"][1000:] -= 5000.0  # set anew by a program
    assert values(said(columns)) == pytest.approx([1.0, 1.0, 1.0, 1.0], abs=0.006)


def test_a_wheel_by_itself_is_told_from_the_other() -> None:
    columns = spinning()
    columns["motor.1.bemf"] = columns["motor.1.bemf"] / 1.03
    found = said(columns)
    assert values(found) == pytest.approx([1.0, 1.0, 1.0, 1.03], abs=0.005)
    assert found.wheel_ratio is not None
    assert found.wheel_ratio.value == pytest.approx(1.03, abs=0.005)


def test_a_robot_that_a_wall_holds_has_no_other_wheels() -> None:
    """Its wheels turn on: along the whole path that made the radius 4 % smaller."""
    columns = spinning()
    held = (columns["t"] > 12.3) & (columns["t"] < 13.9)
    for name in ("truth.x", "truth.y"):
        steps = np.where(held[1:], 0.0, np.diff(columns[name]))
        columns[name] = np.concatenate([[0.0], np.cumsum(steps)])
    assert values(said(columns)) == pytest.approx([1.0, 1.0, 1.0, 1.0], abs=0.006)


def test_a_reference_that_never_turns_tells_no_track() -> None:
    """As of a simulated robot that goes back and forth: its heading is 0 to the last digit."""
    rng, columns = np.random.default_rng(3), spinning()
    rest = np.zeros(len(columns["t"]))
    way = np.sin(columns["t"])
    columns |= {"truth.x": 0.2 * way, "truth.y": rest, "truth.heading": rest}
    drive, model = ROBOT.model.drive, ROBOT.model.left
    counts = 0.2 * 303.4 * model.back_emf_constant.value / drive.wheel_radius.value * np.cos(columns["t"])
    for port in (0, 1):
        columns[f"motor.{port}.bemf"] = counts + rng.standard_normal(len(rest))
    columns["imu.gyro.z"] = 0.005 * rng.standard_normal(len(rest))
    assert said(columns) == ReferenceFactors()


def test_a_reference_that_is_slow_and_has_gaps_says_the_same() -> None:
    columns = spinning(gyro=1.05)
    seen = np.arange(3000) % 5 == 0
    for name in ("truth.x", "truth.y", "truth.heading"):
        columns[name] = np.where(seen, columns[name], np.nan)
    assert values(said(columns)) == pytest.approx([1.05, 1.0, 1.0, 1.0], abs=0.006)


def test_a_marker_that_sits_a_little_askew_and_a_heading_that_is_wrapped_change_nothing() -> None:
    columns = spinning()
    columns["truth.heading"] = np.angle(np.exp(1j * (columns["truth.heading"] + 0.1)))
    assert values(said(columns)) == pytest.approx([1.0, 1.0, 1.0, 1.0], abs=0.004)


def scaled(name: str, factor: float) -> Change:
    return lambda columns: {name: factor * columns[name]}


def both(factor: float) -> Change:
    return lambda columns: {each: factor * columns[each] for each in ("truth.x", "truth.y")}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (scaled("truth.heading", 180.0 / math.pi), r"truth\.heading turns 57\.3 times .* degrees, not rad"),
        (
            lambda columns: {"truth.heading": np.degrees(np.angle(np.exp(1j * columns["truth.heading"])))},
            r"truth\.heading turns 57\.\d times .* degrees",
        ),
        (scaled("truth.heading", -1.0), r"truth\.heading turns against imu\.gyro\.z and the wheels "),
        (both(1000.0), r"truth\.x and truth\.y move .* times as far as the wheels: .* millimetres"),
        (both(100.0), r"truth\.x and truth\.y move .* centimetres, not metres"),
        (both(39.37), r"truth\.x and truth\.y move .* inches"),
        (scaled("truth.y", -1.0), r"truth\.x or truth\.y is mirrored"),
        (
            lambda columns: {"truth.heading": columns["truth.heading"] + math.pi / 2.0},
            r"truth\.x and truth\.y move at -\d\d degrees to truth\.heading",
        ),
    ],
)  # fmt: skip
def test_other_units_and_signs_of_a_reference_are_errors_that_say_so(change: Change, message: str) -> None:
    columns = spinning()
    with pytest.raises(TraceError, match=message):
        said({**columns, **change(columns)})
    with pytest.raises(TraceError, match=message):
        diagnose_geometry([{**columns, **change(columns)}], ROBOT)


@pytest.mark.parametrize("rate", [0.5, 0.8, 1.5])
def test_a_place_that_is_mirrored_is_said_of_a_drive_mostly_along_a_line_too(rate: float) -> None:
    """Both ways of counting explain most of it then, and the reference was left unused without a word."""
    columns = spinning(rate=rate)
    said(columns)
    with pytest.raises(TraceError, match=r"truth\.x or truth\.y is mirrored"):
        said({**columns, "truth.y": -columns["truth.y"]})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda columns: {each: columns[each][::-1] for each in TRUTH}, "heading does not turn as the whee"),
        (lambda columns: {each: np.roll(columns[each], 150) for each in TRUTH[:2]}, "x and truth.y do not"),
        (lambda columns: {each: columns[each] for each in TRUTH}, ""),
    ],
)
def test_a_reference_of_another_drive_or_time_is_said(change: Change, message: str) -> None:
    columns = spinning()
    text = unrelated_reference_note({**columns, **change(columns)}, ROBOT, SI_WORDS)
    assert text.startswith(f"truth.{message}" if message else "")
    assert bool(text) is bool(message)


def test_a_place_and_a_heading_of_rows_of_their_own_are_compared_all_the_same() -> None:
    """Without a row that had both it was an IndexError."""
    columns = spinning()
    odd = np.arange(len(columns["t"])) % 2 == 1
    for name in TRUTH:
        columns[name] = np.where(odd == (name == TRUTH[2]), columns[name], np.nan)
    assert unrelated_reference_note(columns, ROBOT, SI_WORDS) == ""


def test_a_gyro_that_is_stuck_leaves_the_wheels_to_check_a_reference_by() -> None:
    columns = spinning()
    columns |= {"imu.gyro.z": np.full(3000, 0.3), "truth.heading": -columns["truth.heading"]}
    with pytest.raises(
        TraceError, match=r"turns against the wheels .*mirrored, or left and right are swapped"
    ):
        said(columns)


def test_one_sensor_that_turns_against_a_reference_may_be_wrong_itself() -> None:
    """Counters whose columns were swapped had a reference that was mirrored."""
    columns = spinning()
    swapped = {"motor.0.bemf": columns["motor.1.bemf"], "motor.1.bemf": columns["motor.0.bemf"]}
    wheels = {name: each for name, each in (columns | swapped).items() if name != "imu.gyro.z"}
    with pytest.raises(
        TraceError, match=r"against the wheels .* it is mirrored, or left and right are swapped"
    ):
        said(wheels)
    gyro = {name: each for name, each in columns.items() if ".bemf" not in name}
    with pytest.raises(TraceError, match=r"it is mirrored, or the gyro's axis points down"):
        said(gyro | {"imu.gyro.z": -columns["imu.gyro.z"]})
    with pytest.raises(TraceError, match=r"it is mirrored\. It must count"):
        said(columns | {"truth.heading": -columns["truth.heading"]})


def test_a_search_starts_from_what_the_reference_says() -> None:
    start = search_start(spinning(gyro=1.07, track=0.5), ROBOT)
    assert set(start.significant) == {"imu.gyro_scale", "drive.track_width"}
    assert start.robot.model.imu.gyro_scale.value == pytest.approx(1.07, abs=0.005)
    assert start.robot.model.drive.track_width.value == pytest.approx(0.08, abs=0.0005)
    assert start.robot.model.drive.wheel_radius == ROBOT.model.drive.wheel_radius
    asked = {each.id for each in start.undecided(drive_causes())}
    assert not asked & {"imu.gyro_scale", "drive.track_width"}
    assert "drive.wheel_radius" in asked


def test_a_known_effect_of_the_model_is_no_cause_again() -> None:
    model = Parameters.from_robot(ROBOT).with_effect("imu.gyro_scale", factor=1.07)
    start = search_start(spinning(gyro=1.07), ROBOT, model)
    assert not start.significant
    assert start.robot.model.imu.gyro_scale.value == pytest.approx(1.0, abs=0.003)


def test_a_radius_that_no_search_would_find_is_taken_from_the_reference() -> None:
    twice = replace(ROBOT.model.drive, wheel_radius=Measured(0.069, 0.0002))
    start = search_start(spinning(), replace(ROBOT, model=replace(ROBOT.model, drive=twice)))
    assert start.robot.model.drive.wheel_radius.value == pytest.approx(0.0345, abs=0.0002)


def smaller(factor: float) -> Columns:
    """`spinning` of a robot whose wheels are so much larger, so that they turn less."""
    columns = spinning()
    return columns | {name: columns[name] / factor for name in ("motor.0.bemf", "motor.1.bemf")}


def test_a_radius_that_the_model_has_is_not_taken_from_the_reference_again() -> None:
    """A model with wheels 40 % larger was right, and was said to be wrong: its robot had them twice."""
    sides = Parameters.from_robot(ROBOT)
    for side in ("left", "right"):
        sides = sides.with_effect("drive.wheel_radius", side, factor=1.4)
    reads = Parameters.from_robot(ROBOT).with_effect("motor.back_emf_constant", factor=0.7)
    reads = reads.with_effect("bemf.scale", factor=0.95)
    for columns, model in ((smaller(1.4), sides), (smaller(1.0 / 0.665), reads)):
        start = search_start(columns, ROBOT, model)
        assert "drive.wheel_radius" not in start.factors
        assert start.robot.model.drive.wheel_radius == ROBOT.model.drive.wheel_radius
        assert "drive.wheel_radius" in search_start(columns, ROBOT).factors


def test_a_radius_that_the_model_has_wrong_is_told_against_the_models() -> None:
    model = Parameters.from_robot(ROBOT).with_effect("drive.wheel_radius", factor=1.4)
    start = search_start(spinning(), ROBOT, model)
    assert start.robot.model.drive.wheel_radius.value == pytest.approx(0.0345 / 1.4, abs=0.0002)
    curve = judged(1.0).curves
    search = replace(judged(1.0), model=replace(model, robot=start.robot), curves=curve, rejected=())
    found = with_reference_findings(search, start, model)
    (cause,) = found.causes
    number = cause.parameters["factor"]
    assert (cause.name, number.nominal) == ("drive.wheel_radius", 1.4)
    assert number.value == pytest.approx(1.0, abs=0.005)
    assert "The radius of both wheels is 28." in cause.explanation
    assert "% smaller than assumed" in cause.explanation
    assert found.model is not None
    assert found.model.value("drive.wheel_radius", "factor", "left") == pytest.approx(1.0, abs=0.005)
    assert found.model.robot == ROBOT


def test_what_a_reference_hardly_knows_is_left_to_the_search() -> None:
    """Chance, or a track that is 2 % wider: no reason to hold it where robot.toml is."""
    rng = np.random.default_rng(4)
    columns = spinning(track=1.02)
    for name, noise in (("truth.x", 0.005), ("truth.y", 0.005), ("truth.heading", 0.01)):
        columns[name] = columns[name] + noise * rng.standard_normal(3000)
    start = search_start(columns, ROBOT)
    assert start.reference.track is not None
    assert "drive.track_width" not in start.factors
    assert "drive.track_width" in {each.id for each in start.undecided(drive_causes())}
    assert "track width by the reference" in with_reference_findings(judged(1.0), start).identified


def test_deviations_are_as_large_as_what_noise_makes_of_short_drives() -> None:
    """Weights that drop ever more of few stretches made them a third of it."""
    clean, away = spinning(), []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        columns = {name: each[:2000].copy() for name, each in clean.items()}
        for name, noise in (("truth.x", 0.002), ("truth.y", 0.002), ("truth.heading", 0.004)):
            columns[name] += noise * rng.standard_normal(2000)
        track = said(columns).track
        assert track is not None
        away.append((track.value - 1.0) / track.std)
    assert 0.3 < float(np.std(away)) < 1.6
    assert float(np.abs(away).max()) < 3.5


def test_without_a_reference_nothing_changes() -> None:
    columns = {name: each for name, each in spinning(gyro=1.07).items() if "truth" not in name}
    start = search_start(columns, ROBOT)
    assert (start.robot, start.decided) == (ROBOT, ())
    before = make_diagnosis()
    assert with_reference_findings(before, start) is before


def test_a_reading_that_is_named_too_large_is_no_smaller_wheel() -> None:
    """By the reference the wheels go less far than they say, whatever it is that makes them say so."""
    columns = spinning()
    columns["motor.0.bemf"] = 1.05 * columns["motor.0.bemf"]
    before = make_diagnosis(make_cause("bemf.scale@left", factor_parameters(1.05, 0.002), "reads too much."))
    start = search_start(columns, ROBOT)
    identified = with_reference_findings(before, start).identified
    for name in ("track width", "left wheel's radius", "right wheel's radius"):
        number = identified[f"{name} by the reference"]
        assert number.value == pytest.approx(1.0, abs=0.005)
        assert (number.unit, math.isnan(number.nominal)) == ("times robot.toml's", True)
    unnamed = with_reference_findings(replace(before, causes=()), start).identified
    assert unnamed["left wheel's radius by the reference"].value < 0.96


@pytest.mark.parametrize("id_", ["bemf.scale", "motor.back_emf_constant"])
@pytest.mark.parametrize("where", ["left", None])
def test_a_reading_that_the_model_has_too_large_is_no_smaller_wheel(id_: str, where: str | None) -> None:
    """Nothing is named, as the model asked about has it: its robot was said to have a wheel 5 % smaller."""
    columns = spinning()
    for port in (0,) if where else (0, 1):
        columns[f"motor.{port}.bemf"] = 1.05 * columns[f"motor.{port}.bemf"]
    model = Parameters.from_robot(ROBOT).with_effect(id_, where, factor=1.05)
    before = make_diagnosis()
    identified = with_reference_findings(before, search_start(columns, ROBOT, model), model).identified
    radii = {name: each.value for name, each in identified.items() if "radius" in name}
    assert radii
    assert list(radii.values()) == pytest.approx([1.0] * len(radii), abs=0.005)


def test_no_radius_is_told_where_the_named_cause_may_be_one() -> None:
    """It would be that of a robot whose K_E is off, which the same report calls as likely as not."""
    columns, start = spinning(), search_start(spinning(), ROBOT)
    columns["motor.0.bemf"], columns["motor.1.bemf"] = (0.96 * columns[f"motor.{i}.bemf"] for i in (0, 1))
    alike = {"probability": 0.6, "confounded_with": ("drive.wheel_radius",)}
    before = make_diagnosis(
        make_cause("motor.back_emf_constant", factor_parameters(0.96, 0.006), "reads too little.", **alike)
    )
    identified = with_reference_findings(before, search_start(columns, ROBOT)).identified
    assert "wheel radius by the reference" not in identified
    assert identified["wheel radius over K_E by the reference"].value == pytest.approx(1.0 / 0.96, abs=0.005)
    open_ = ROBOT.model.left.back_emf_constant
    known = with_reference_findings(replace(before, causes=()), start).identified[
        "wheel radius by the reference"
    ]
    assert known.std >= open_.std / open_.value > 0.0


def judged(factor: float) -> Diagnosis:
    """What a search says from a robot whose gyro reads as much more as it does."""
    time = np.arange(400, dtype=np.float64) * 0.02
    true = np.sin(3.0 * time)
    noise = 0.01 * np.random.default_rng(3).standard_normal(400)
    curve = Curve("imu.gyro.z", "rad/s", time, factor * true + noise, factor * true, factor * true)
    channel = ChannelResult("imu.gyro.z", "rad/s", 0.01, 0.01, 0.01, 0.5)
    rejected = (Rejected("drive.wheel_radius", "explains none of the remaining error"),)
    model = Parameters.from_robot(search_start(spinning(gyro=factor), ROBOT).robot)
    return make_diagnosis(channels=(channel,), rejected=rejected, model=model, curves=(curve,))


def test_what_the_reference_decides_is_a_cause_with_its_gain() -> None:
    found = with_reference_findings(judged(1.07), search_start(spinning(gyro=1.07), ROBOT))
    (cause,) = found.causes
    assert (cause.name, cause.rank, cause.confounded_with) == ("imu.gyro_scale", 1, ())
    assert cause.parameters["factor"].value == pytest.approx(1.07, abs=0.005)
    assert cause.probability > 0.999
    assert found.verdict is Verdict.EXPLAINED
    assert "The recorded reference says so." in cause.explanation
    size = 0.07 / math.sqrt(2.0) / 0.01
    assert cause.change == pytest.approx(size, rel=0.1)
    assert cause.gain.heldout_rmse_before == pytest.approx(math.hypot(size, 1.0), rel=0.1)
    assert cause.gain.heldout_rmse_after == pytest.approx(1.0, rel=0.1)
    assert cause.gain.share > 0.95
    assert found.channels[0].rmse_before == pytest.approx(0.01 * size, rel=0.1)
    reasons = {each.id: each.reason for each in found.rejected}
    assert "imu.gyro_scale" not in reasons
    assert reasons["drive.track_width"].startswith("by the reference it is 1.00")
    assert found.model is not None
    assert found.model.robot == ROBOT
    assert found.model.value("imu.gyro_scale", "factor") == pytest.approx(1.07, abs=0.005)
    assert "named: The gyro" in found.model.origins[("imu.gyro_scale", None)].source


def test_without_a_gyro_a_track_width_that_the_reference_has_is_a_cause_all_the_same() -> None:
    """No reading shows it, but a simulated robot turns by as much too far."""
    start = search_start(spinning(track=1.07), ROBOT)
    wheel = ChannelResult("motor.0.bemf", "counts", 4.0, 4.0, 4.0, 0.5)
    bare = replace(judged(1.0), channels=(wheel,), curves=(), model=Parameters.from_robot(start.robot))
    found = with_reference_findings(bare, start)
    (cause,) = found.causes
    assert (cause.name, cause.rank, cause.confounded_with) == ("drive.track_width", 1, ())
    assert cause.parameters["factor"].value == pytest.approx(1.07, abs=0.005)
    assert "The recorded reference says so." in cause.explanation
    assert not cause.is_negligible
    assert found.verdict is Verdict.EXPLAINED
    assert found.model is not None
    assert found.model.value("drive.track_width", "factor") == pytest.approx(1.07, abs=0.005)
    assert found.identified["track width by the reference"].value == pytest.approx(1.07, abs=0.005)
    assert "drive.track_width" not in {each.id for each in found.rejected}
    assert "the reference of the pose shows it" in terminal_report(found)
    as_assumed = with_reference_findings(bare, search_start(spinning(), ROBOT))
    assert (as_assumed.verdict, as_assumed.causes) == (Verdict.ADEQUATE, ())


def test_a_shift_that_no_effect_can_have_stays_in_the_models_robot(tmp_path: Path) -> None:
    half = replace(ROBOT.model.drive, wheel_radius=Measured(0.4 * 0.0345, 0.0001))
    model = Parameters.from_robot(replace(ROBOT, model=replace(ROBOT.model, drive=half)))
    found = rebase_model(model, ROBOT, {"drive.wheel_radius": 0.4, "imu.gyro_scale": 1.02})
    assert found.robot.model.drive.wheel_radius.value == pytest.approx(0.4 * 0.0345)
    assert found.value("drive.wheel_radius", "factor", "left") == 1.0
    assert found.value("imu.gyro_scale", "factor") == pytest.approx(1.02)
    found.save(tmp_path / "model.toml")
    assert Parameters.from_model_file(tmp_path / "model.toml") == found


def test_a_number_that_no_simulator_takes_is_the_nearest_that_it_does(tmp_path: Path) -> None:
    """A robot.toml with wheels of twice the size ended in an error about a number that nobody had written."""
    neutral = neutral_settings(ROBOT)
    here = neutral | {("drive.wheel_radius", "left", "factor"): 0.4916}
    model = to_parameters(clamp_to_bounds(here, neutral), neutral, ROBOT, Chain())
    model.save(tmp_path / "model.toml")
    read = Parameters.from_model_file(tmp_path / "model.toml")
    assert read.value("drive.wheel_radius", "factor", "left") == 0.5
    assert clamp_to_bounds(neutral, neutral) == neutral


def drive_of(model: Parameters) -> Columns:
    """12 s of random steps of a simulated robot, with the noise of its readings and its true pose."""
    rng = np.random.default_rng(5)
    time = 0.005 * np.arange(2400)
    steps = np.repeat(rng.uniform(-0.7, 0.7, (24, 2)), 100, axis=0)
    steps[:200] = steps[-50:] = 0.0
    commands = Commands.of_wheels(time, steps[:, 0], steps[:, 1], False)
    readings = ("motor.0.bemf", "motor.1.bemf", "imu.gyro.z", "battery.voltage")
    names = (*readings, "truth.x", "truth.y", "truth.heading")
    run = rollout(model, commands, channels=names)
    noise = {"motor.0.bemf": 4.0, "motor.1.bemf": 4.0, "imu.gyro.z": 0.008, "battery.voltage": 0.01}
    columns = {
        name: np.asarray(run[name], float).reshape(-1) + noise.get(name, 0.0) * rng.standard_normal(len(time))
        for name in names
    }
    return {"t": time, "motor.0.duty": steps[:, 0], "motor.1.duty": steps[:, 1], **columns}


@pytest.mark.parametrize(
    ("id_", "factor", "within"),
    [("imu.gyro_scale", 1.05, 0.005), ("drive.track_width", 0.5, 0.005)],
)
@pytest.mark.usefixtures("few_causes")
def test_one_of_the_twins_is_named_alone_where_there_is_a_reference(
    id_: str, factor: float, within: float
) -> None:
    model = Parameters.from_robot(ROBOT).with_effect(id_, factor=factor)
    found = diagnose_recording(drive_of(model), ROBOT)
    (cause,) = found.causes
    assert (cause.name, cause.confounded_with) == (id_, ())
    assert cause.parameters["factor"].value == pytest.approx(factor, abs=within)
    assert cause.probability > 0.99
    assert found.verdict is Verdict.EXPLAINED
    assert id_ not in {each.id for each in found.rejected}
    far = [each for each in found.notes if "is this robot.toml of this robot?" in each]
    assert len(far) == (factor == 0.5)
    assert found.model is not None
    assert found.model.value(id_, "factor") == pytest.approx(factor, abs=within)
