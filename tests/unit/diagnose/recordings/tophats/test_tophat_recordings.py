from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from raccoon.core.config import RobotConfig, parse_robot
from raccoon.diagnose.recordings.diagnosis import diagnose_recording
from raccoon.diagnose.recordings.kind import Kind, kind_of
from raccoon.diagnose.result import Verdict
from raccoon.model.paper import tophat_reading
from raccoon.model.reflectance import counts

Columns = dict[str, np.ndarray]
ROBOT = parse_robot({"tophat": {"front": {"analog": 2}}})


def level(height: float, black: bool) -> float:
    """The paper's new tophat indoors, counts at 7 or at 23 mm."""
    found = tophat_reading("new", height, "normal")
    return float(found.black if black else found.white)


def read(columns: Columns, clean: np.ndarray, seed: int = 3, noise: float = 3.0) -> Columns:
    """The same drive with these readings, noise on top, as the converter gives them."""
    noisy = clean + noise * np.random.default_rng(seed).standard_normal(len(clean))
    return {**columns, "analog.2": np.clip(np.round(noisy), 0.0, 4095.0)}


def lines(
    seed: int,
    offset: float = 0.0,
    factor: float = 1.0,
    height: float = 0.007,
    noise: float = 3.0,
    drift: float = 0.0,
) -> Columns:
    """White with a black line every second, 20 s at 100 Hz; drift: counts added by the end."""
    rng = np.random.default_rng(seed)
    time = 0.01 * np.arange(2000)
    black = time % 1.0 > 0.7
    clean = np.where(black, level(height, True), level(height, False))
    counts = factor * clean + offset + drift * time / time[-1] + noise * rng.standard_normal(len(time))
    return {
        "t": time,
        "analog.2": np.clip(np.round(counts), 0.0, 4095.0),
        "truth.surface.2": black.astype(float),
    }


@pytest.mark.parametrize("truth_free", [False, True])
@pytest.mark.parametrize(
    ("changes", "cause", "number", "value", "within"),
    [
        ({"offset": 150.0}, "tophat.ambient_light", "offset", 150.0, 5.0),
        ({"offset": -60.0}, "tophat.ambient_light", "offset", -60.0, 5.0),
        ({"factor": 0.85}, "tophat.gain", "factor", 0.85, 0.01),
        ({"height": 0.023}, "tophat.height", "height", 0.023, 0.001),
        ({"noise": 30.0}, "tophat.noise", "sd", 30.0, 3.0),
    ],
)
def test_one_cause_is_named_with_its_number(
    changes: dict[str, float], cause: str, number: str, value: float, within: float, truth_free: bool
) -> None:
    found = diagnose_recording(lines(3, **changes), ROBOT, truth_free=truth_free)
    assert [each.name for each in found.causes] == [f"{cause}@2"]
    assert found.causes[0].parameters[number].value == pytest.approx(value, abs=within)
    assert found.verdict is Verdict.EXPLAINED


@pytest.mark.parametrize("changes", [{"factor": 0.85}, {"height": 0.023}])
def test_with_the_better_model_the_same_tophat_is_as_assumed(changes: dict[str, float]) -> None:
    found = diagnose_recording(lines(3, **changes), ROBOT)
    assert found.model is not None
    (cause,) = found.causes
    assert found.model.origins[(cause.id, "2")].probability == cause.probability
    again = diagnose_recording(lines(4, **changes), ROBOT, model=found.model)
    assert again.verdict is Verdict.ADEQUATE
    assert again.causes == ()


def test_a_tophat_that_robot_toml_does_not_name_gives_no_model() -> None:
    assert diagnose_recording(lines(3, offset=150.0), RobotConfig()).model is None


@pytest.mark.parametrize("seed", range(3))
def test_a_tophat_as_assumed_is_adequate(seed: int) -> None:
    found = diagnose_recording(lines(seed), ROBOT)
    assert found.verdict is Verdict.ADEQUATE
    assert found.causes == ()


def test_light_that_changes_is_said_with_its_time() -> None:
    found = diagnose_recording(lines(4, drift=400.0), ROBOT)
    assert found.unexplained.depends_on == ("time",)
    assert any("moves by" in each and "highest around 1" in each for each in found.notes)


def test_two_causes_are_ambiguous_and_that_is_said() -> None:
    found = diagnose_recording(lines(5, offset=120.0, factor=1.3), ROBOT)
    assert found.causes
    assert any(each.confounded_with for each in found.causes)


def test_one_surface_alone_cannot_tell() -> None:
    columns = lines(6)
    del columns["truth.surface.2"]
    columns["analog.2"] = np.full(2000, 200.0)
    assert kind_of(columns, RobotConfig()) is Kind.TOPHATS
    found = diagnose_recording(columns, ROBOT)
    assert found.verdict is Verdict.NOT_IDENTIFIABLE
    assert "only one surface" in found.notes[0]
    assert {each.id for each in found.rejected} == {
        "tophat.ambient_light@2", "tophat.gain@2", "tophat.height@2", "tophat.noise@2",
    }  # fmt: skip


@pytest.mark.parametrize(
    ("changes", "truth_free"),
    [({"offset": 300.0}, True), ({"offset": 800.0}, False), ({"factor": 3.0}, True)],
)
def test_a_level_that_is_cut_off_is_said_and_leaves_one_number(
    changes: dict[str, float], truth_free: bool
) -> None:
    found = diagnose_recording(lines(3, **changes), ROBOT, truth_free=truth_free)
    assert [(each.channel, each.fault) for each in found.sensor_faults] == [("analog.2", "saturated")]
    assert "black reads 4095" in found.sensor_faults[0].text
    (cause,) = found.causes
    # White alone cannot tell an offset from a factor; a height would leave black below the end.
    assert {cause.id, *cause.confounded_with} == {"tophat.ambient_light", "tophat.gain"}
    assert 0.3 < cause.probability < 0.8
    again = diagnose_recording(lines(4, **changes), ROBOT, model=found.model)
    assert again.causes == ()
    assert again.verdict is Verdict.ADEQUATE


def test_both_levels_cut_off_tell_nothing() -> None:
    found = diagnose_recording(lines(3, factor=5.0), ROBOT)
    assert found.verdict is Verdict.NOT_IDENTIFIABLE
    assert "saturated" in found.notes[0]


@pytest.mark.parametrize(
    ("black_is_cut", "factor", "offset", "cause"),
    [
        (True, 1.2, 0.0, "tophat.gain"),
        (True, 1.0, 300.0, "tophat.ambient_light"),
        (False, 0.8, 0.0, "tophat.gain"),
    ],
)
def test_levels_that_jump_are_judged_before_and_after(
    black_is_cut: bool, factor: float, offset: float, cause: str
) -> None:
    columns = lines(3)
    clean = np.where(columns["truth.surface.2"] > 0.5, level(0.007, True), level(0.007, False))
    late = columns["t"] > 12.5
    found = diagnose_recording(read(columns, np.where(late, factor * clean + offset, clean)), ROBOT)
    (named,) = found.causes
    assert cause in {named.id, *named.confounded_with}
    assert bool(found.sensor_faults) is black_is_cut
    assert named.explanation.startswith("From 12.5 s on: ")
    assert found.verdict is Verdict.PARTLY
    assert found.unexplained.depends_on == ("time",)
    assert any("jumps at 12.5 s" in each and "until then: as assumed" in each for each in found.notes)


def test_a_cause_that_ends_is_said_to_end() -> None:
    columns = lines(3)
    clean = np.where(columns["truth.surface.2"] > 0.5, level(0.007, True), level(0.007, False))
    found = diagnose_recording(read(columns, clean + 150.0 * (columns["t"] < 8.5)), ROBOT)
    assert [each.id for each in found.causes] == ["tophat.ambient_light"]
    assert found.causes[0].explanation.startswith("Until 8.5 s: ")


def test_levels_that_drift_have_no_one_cause() -> None:
    found = diagnose_recording(lines(4, drift=200.0), ROBOT)
    assert found.causes == ()
    assert found.verdict is Verdict.UNKNOWN
    # A drift that is small beside what is wrong does not hide it.
    found = diagnose_recording(lines(4, factor=0.7, drift=60.0), ROBOT)
    assert "tophat.gain" in {each.id for each in found.causes}
    assert found.verdict is Verdict.PARTLY


@pytest.mark.parametrize("light", [0.01, 0.03, 0.1])
def test_sun_that_lowers_both_levels_is_light(light: float) -> None:
    columns = lines(3)
    levels = [float(counts(side, "new", 0.007, light)) for side in (0.0, 1.0)]
    found = diagnose_recording(
        read(columns, np.where(columns["truth.surface.2"] > 0.5, *levels[::-1])), ROBOT
    )
    (cause,) = found.causes
    assert cause.id == "tophat.ambient_light"
    fall = np.mean([level(0.007, False) - levels[0], level(0.007, True) - levels[1]])
    assert cause.parameters["offset"].value == pytest.approx(-fall, rel=0.03)
    assert set(cause.confounded_with) == {"tophat.gain", "tophat.height"}
    assert f"about {100 * light:.2g} % of direct sun" in cause.explanation
    assert found.verdict is Verdict.PARTLY
    assert any("only the mean of both" in each for each in found.notes)


def test_exchanged_labels_are_said() -> None:
    columns = lines(3)
    columns["truth.surface.2"] = 1.0 - columns["truth.surface.2"]
    found = diagnose_recording(columns, ROBOT)
    assert found.verdict is Verdict.NOT_IDENTIFIABLE
    assert "labels of black and white look swapped" in found.notes[0]


def test_a_port_that_robot_toml_does_not_name_is_said() -> None:
    columns = lines(3)
    columns["analog.1"] = columns["analog.2"]
    found = diagnose_recording(columns, ROBOT)
    assert any(each.startswith("analog.1 was not judged") for each in found.notes)
    assert diagnose_recording(lines(3), ROBOT).notes == ()


@pytest.mark.parametrize(("noise", "truth_free"), [(20.0, True), (60.0, False), (120.0, True)])
def test_edges_are_no_noise(noise: float, truth_free: bool) -> None:
    columns = lines(3)
    black = np.convolve(np.pad(columns["truth.surface.2"], 2, mode="edge"), np.full(5, 0.2), "valid")
    clean = level(0.007, False) + black * (level(0.007, True) - level(0.007, False))
    found = diagnose_recording(read(columns, clean, noise=noise), ROBOT, truth_free=truth_free)
    cause = next(each for each in found.causes if each.id == "tophat.noise")
    assert cause.parameters["sd"].value == pytest.approx(noise, rel=0.03)


@pytest.mark.parametrize("pause", [3.0, 3600.0])
def test_a_pause_breaks_nothing_where_no_reference_tells_the_surface(pause: float) -> None:
    """Nothing is in most of the moments that are tried: it was a ValueError."""
    columns = {name: each for name, each in lines(1).items() if name != "truth.surface.2"}
    later = columns["t"] + pause * (columns["t"] > 9.0)
    found = diagnose_recording({**columns, "t": later}, ROBOT)
    assert found.verdict is Verdict.ADEQUATE


def between(height: float, seed: int) -> Columns:
    """A drive over lines at a height (m) between the paper's, of a sensor whose light over white and over
    black falls by an exponential each."""
    columns = lines(seed)
    share, found = (height - 0.007) / 0.016, {}
    for black in (False, True):
        near, far = (4095.0 / level(at, black) - 1.0 for at in (0.007, 0.023))
        found[black] = 4095.0 / (1.0 + near * (far / near) ** share)
    return read(columns, np.where(columns["truth.surface.2"] > 0.5, found[True], found[False]), seed)


@pytest.mark.parametrize("height", [0.010, 0.018])
def test_a_height_between_the_measured_ones_is_as_sure_as_the_law_between_them(height: float) -> None:
    """12 mm by another law were said to be 10.13 +- 0.09 mm, and a gain of 0.994 beside."""
    found = diagnose_recording(between(height, 3), ROBOT)
    (cause,) = found.causes
    number = cause.parameters["height"]
    assert cause.id == "tophat.height"
    assert 0.0008 < number.std < 0.002
    assert abs(number.value - height) < 2.0 * number.std
    assert "about" in cause.explanation


def test_how_sure_the_noise_is_comes_of_how_much_was_read() -> None:
    """It was 2 % of however few readings."""
    off = []
    for seed in range(8):
        columns = {name: each[:400] for name, each in lines(seed, noise=30.0).items()}
        (cause,) = diagnose_recording(columns, ROBOT).causes
        off.append((cause.parameters["sd"].value - 30.0) / cause.parameters["sd"].std)
    assert np.sqrt(np.mean(np.square(off))) < 1.6


def test_what_chance_leaves_is_not_unexplained() -> None:
    """A sensor as assumed left all of it, where a drive as assumed leaves nothing."""
    assert diagnose_recording(lines(3), ROBOT).unexplained.share == 0.0
    assert diagnose_recording(lines(3, drift=400.0), ROBOT).unexplained.share > 0.0
    unseen = {name: each for name, each in lines(3).items() if name != "analog.2"}
    assert diagnose_recording({**unseen, "analog.2": 0.0 * unseen["t"]}, ROBOT).unexplained.share == 0.0


def blank(columns: Columns, keep: np.ndarray) -> Columns:
    surface = np.where(keep, columns["truth.surface.2"], np.nan)
    return {**columns, "truth.surface.2": surface}


def test_rows_without_a_label_are_not_white() -> None:
    """A reference that was never written, or written when it changed, said that all is white."""
    columns = lines(3, offset=150.0)
    surface, rows = columns["truth.surface.2"], np.arange(len(columns["t"]))
    changes = np.append(True, np.diff(surface) != 0.0)
    for keep in (rows < 0, changes, rows % 4 == 0, (rows % 4 == 0) & (rows < 1400)):
        found = diagnose_recording(blank(columns, keep), ROBOT)
        (cause,) = found.causes
        assert cause.parameters["offset"].value == pytest.approx(150.0, abs=6.0)


def test_what_a_reader_left_out_in_many_lines_is_said_once() -> None:
    """A column of half labels filled a report with 493 lines."""
    problems = [
        f"line {each}, column truth.surface.2: '0.5': allowed are black and white" for each in range(9)
    ]
    other = "line 3, column analog.2: 'x': allowed are finite numbers and blank"
    found = diagnose_recording(lines(3), ROBOT, problems=[*problems, other, problems[0]])
    assert found.notes == (f"{problems[0]}; so are 9 more", other)


@pytest.mark.parametrize("truth_free", [False, True])
def test_black_that_is_cut_off_below_the_largest_reading_has_no_cause(truth_free: bool) -> None:
    """It was a sensor 14 mm high in the sun, each with a probability of 0.8."""
    columns = lines(3)
    columns["analog.2"] = np.minimum(columns["analog.2"], 2000.0)
    found = diagnose_recording(columns, ROBOT, truth_free=truth_free)
    assert found.verdict is Verdict.NOT_IDENTIFIABLE
    assert "analog.2: it never reads more than 2000 counts" in found.notes[0]


def test_a_sensor_without_noise_is_not_cut_off() -> None:
    assert diagnose_recording(lines(3, noise=0.0), ROBOT).verdict is Verdict.ADEQUATE


def late(labels: np.ndarray) -> np.ndarray:
    return np.roll(labels, 35)


def random(labels: np.ndarray) -> np.ndarray:
    return np.random.default_rng(1).integers(0, 2, len(labels)).astype(float)


@pytest.mark.parametrize("labels", [late, random, np.zeros_like])
def test_labels_of_another_time_or_sensor_are_said(labels: Callable[[np.ndarray], np.ndarray]) -> None:
    """Only one surface was said to be seen, or two that cannot be told apart."""
    columns = lines(3)
    columns["truth.surface.2"] = labels(columns["truth.surface.2"])
    found = diagnose_recording(columns, ROBOT)
    assert found.verdict is Verdict.NOT_IDENTIFIABLE
    assert "truth.surface.2 is of something else or of another time" in found.notes[0]
    assert diagnose_recording(columns, ROBOT, truth_free=True).verdict is Verdict.ADEQUATE
