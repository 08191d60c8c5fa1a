from __future__ import annotations

import numpy as np
import pytest

from raccoon.core.config import RobotConfig, parse_robot
from raccoon.diagnose.recordings.kinds import Kind, diagnose_recording, kind_of
from raccoon.diagnose.result import Verdict
from raccoon.model.paper import tophat_reading

Columns = dict[str, np.ndarray]
ROBOT = parse_robot({"tophat": {"front": {"analog": 2}}})


def level(height: float, black: bool) -> float:
    """The paper's new tophat indoors, counts at 7 or at 23 mm."""
    found = tophat_reading("new", height, "normal")
    return float(found.black if black else found.white)


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


@pytest.mark.parametrize("changes", [{"offset": 150.0}, {"factor": 0.85}, {"height": 0.023}])
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


@pytest.mark.parametrize("seed", range(5))
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
