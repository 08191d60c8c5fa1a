"""Effects that a team adds without touching the package."""

from __future__ import annotations

import json
import runpy
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from blind import drives
from blind.generator import make
from blind.hidden import draw, draw_unknown
from csv_files import write_csv_file
from raccoon.cli.main import main
from raccoon.core.config import RobotConfig
from raccoon.core.errors import ConfigError
from raccoon.core.schema import Bounds
from raccoon.diagnose.diagnosis import diagnose
from raccoon.diagnose.drives.log import log_from_columns
from raccoon.diagnose.fit.linear_model import linearise
from raccoon.diagnose.fit.problem import Point
from raccoon.diagnose.habits.problems import drive_problem
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes, own_cause
from raccoon.diagnose.own import OwnEffect, Simulated, load_own_effects
from raccoon.diagnose.recordings.diagnosis import diagnose_recording
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.effect import Parameter
from simulated_drives import BLIND_CONTROLLER

EXAMPLE = Path(__file__).resolve().parents[4] / "examples" / "own_causes.py"
ROBOT = RobotConfig()
GAIN = Parameter("gain", "rad/s", 0.0, Bounds(-1.0, 1.0), 0.02)


def shift(drive: Simulated, values: Mapping[str, float]) -> dict[str, np.ndarray]:
    return {"gyro": drive.readings["gyro"] + values["gain"]}


SHIFT = OwnEffect("team.shift", "The gyro is off by {gain:.3f} rad/s.", (GAIN,), readings=shift)


def test_what_was_unknown_is_named_with_its_number_once_somebody_has_an_idea(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    hidden = draw_unknown("gyro_speed", np.random.default_rng(1))
    path = write_csv_file(tmp_path / "run.csv", dict(make(1, [hidden], seconds=8.0).columns))
    out, model = tmp_path / "out.json", tmp_path / "model.toml"
    command = ["diagnose", str(path), "--causes", str(EXAMPLE), "--json", str(out)]
    assert main([*command, "--save-model", str(model)]) == 0
    said = json.loads(out.read_text())
    assert said["verdict"] == "explained"
    (cause,) = said["causes"]
    assert cause["id"] == "team.motor_hum"
    # rad/s for each m/s of the robot; 1000 counts are 3.296 V at the motor, K_E 1.08, wheels of 0.0345 m
    truth = hidden.values["gyro_speed"] * 1000.0 / 303.4 / 1.08 * 0.0345
    gain = cause["parameters"]["gain"]
    assert gain["value"] == pytest.approx(truth, rel=0.1)
    assert abs(gain["value"] - truth) < 3.0 * gain["std"]
    assert "mount it away" in cause["explanation"]
    assert "team.slow_driver" in {each["id"] for each in said["rejected"]}
    assert "model.toml cannot contain it" in capsys.readouterr().out
    assert "team." not in model.read_text()


def test_what_reaches_the_motors_can_be_an_idea_as_well() -> None:
    lag = 0.04
    duty = drives.exciting(np.random.default_rng(3), 6.0)
    given = duty.copy()
    for row in range(1, len(duty)):
        given[row] = given[row - 1] + (1.0 - np.exp(-0.005 / lag)) * (duty[row] - given[row - 1])
    columns = dict(make(3, drive=given).columns)
    cycle, row = [], 0
    for each in columns["motor.0.duty"]:  # some cycles got lost on the way
        while abs(given[row, 0] - each) > 1e-4:
            row += 1
        cycle.append(row)
        row += 1
    columns |= {f"motor.{port}.duty": duty[cycle, port] for port in (0, 1)}
    others = [
        each for each in drive_causes() if each.id.startswith(("actuation.", "bemf.", "imu.", "motor."))
    ]
    causes = [*others, *map(own_cause, load_own_effects(EXAMPLE))]
    (cause,) = diagnose(columns, ROBOT, causes=causes, firmware=BLIND_CONTROLLER).causes
    assert cause.id == "team.slow_driver"
    assert cause.parameters["seconds"].value == pytest.approx(lag, rel=0.1)


def test_where_a_reading_that_it_needs_is_missing_it_is_not_identifiable_and_the_rest_goes_on() -> None:
    columns = dict(make(3, [draw("bemf.offset", np.random.default_rng(3))], seconds=5.0).columns)
    del columns["imu.gyro.z"]
    causes = [each for each in drive_causes() if each.id == "bemf.offset"]
    causes += map(own_cause, load_own_effects(EXAMPLE))
    said = diagnose(columns, ROBOT, causes=causes, firmware=BLIND_CONTROLLER)
    reasons = {each.id: each.reason for each in said.rejected}
    assert reasons["team.motor_hum"] == "not identifiable: there is no gyro reading in this recording"
    assert [each.id for each in said.causes] == ["bemf.offset"]


def test_at_its_neutral_value_an_effect_is_not_even_called() -> None:
    def refused(*_: Any) -> Any:
        raise AssertionError

    own = replace(SHIFT, readings=refused, commands=refused)
    log = log_from_columns(dict(make(4, seconds=4.0).columns), ROBOT)
    habits = Habits(Chain.firmware(), False)
    plain, more = (
        drive_problem(log, ROBOT, causes, habits, None)
        for causes in (drive_causes(), [*drive_causes(), own_cause(own)])
    )
    np.testing.assert_array_equal(more.predict([more.nominal()]), plain.predict([plain.nominal()]))


def test_robots_with_and_without_it_are_simulated_side_by_side() -> None:
    def half(_: np.ndarray, duty: np.ndarray, values: Mapping[str, float]) -> np.ndarray:
        return (1.0 - values["gain"]) * duty

    own = replace(SHIFT, commands=half)
    log = log_from_columns(dict(make(4, seconds=4.0).columns), ROBOT)
    problem = drive_problem(log, ROBOT, [own_cause(own)], Habits(Chain.firmware(), False), None)
    less = replace(log, duty=0.5 * log.duty)
    halved = drive_problem(less, ROBOT, [own_cause(SHIFT)], Habits(Chain.firmware(), False), None)
    u = np.array([0.5 / 0.04])  # a width is twice the usual size
    plain, with_it, again = problem.predict(
        [problem.nominal(), problem.nominal().with_cause("team.shift", u), problem.nominal()]
    )
    np.testing.assert_array_equal(plain, again)
    expected = halved.predict([halved.nominal()])[0]
    gyro = problem.features.roles.index("gyro")
    expected[:, gyro] += 0.5
    np.testing.assert_allclose(with_it, expected, atol=1e-9)


def test_what_a_hook_changes_in_place_is_its_own() -> None:
    """`time -= time[0]` moved the time of the whole recording."""

    def half(time: np.ndarray, duty: np.ndarray, values: Mapping[str, float]) -> np.ndarray:
        time -= 1.0
        duty *= 1.0 - values["gain"]
        return duty

    def shifted(drive: Simulated, values: Mapping[str, float]) -> dict[str, np.ndarray]:
        np.copyto(drive.time, 0.0)
        np.copyto(drive.duty, 0.0)
        for each in drive.readings.values():
            each += values["gain"]
        return {"gyro": drive.readings["gyro"]}

    own = replace(SHIFT, commands=half, readings=shifted)
    time, duty = np.arange(3.0), np.ones((3, 2))
    readings = {"gyro": np.ones(3), "battery": np.ones(3)}
    assert own.change_commands(time, duty, {"gain": 0.5}).tolist() == [[0.5, 0.5]] * 3
    found = own.change_readings(Simulated(time, duty, readings), {"gain": 0.5})
    assert {role: each.tolist() for role, each in found.items()} == {"gyro": [1.5] * 3, "battery": [1.0] * 3}
    assert time.tolist() == [0.0, 1.0, 2.0]
    assert (duty == 1.0).all()
    assert (readings["gyro"] == 1.0).all()


def test_each_of_many_numbers_has_its_column_and_none_is_tried_out_of_its_bounds() -> None:
    """A third one's was divided by 0, and a share of which 1 is all was tried at 1.1."""
    parameters = (
        GAIN,
        Parameter("share", "", 1.0, Bounds(0.0, 1.0), 0.1),
        Parameter("left", "rad/s", 0.0, Bounds(-0.01, 0.001), 0.02),
        Parameter("size", "", 0.1, Bounds(positive=True, high=0.1), 0.2),
    )

    def readings(drive: Simulated, values: Mapping[str, float]) -> dict[str, np.ndarray]:
        for each in parameters:
            assert each.bounds.allows(values[each.name]), values
        changed = (
            values["gain"] + (values["share"] - 1.0) + 2.0 * values["left"] + 3.0 * (values["size"] - 0.1)
        )
        return {"gyro": drive.readings["gyro"] + changed}

    own = replace(SHIFT, parameters=parameters, readings=readings)
    cause = own_cause(own)
    log = log_from_columns(dict(make(4, seconds=4.0).columns), ROBOT)
    problem = drive_problem(log, ROBOT, [cause], Habits(Chain.firmware(), False), None)
    (group,) = linearise(problem, problem.nominal(), [cause.name]).groups
    gyro = problem.features.roles.index("gyro")
    widths = [2.0 * each.prior_width for each in parameters]
    for column, wanted in zip(group.columns, np.multiply(widths, [1.0, 1.0, 2.0, 3.0]), strict=True):
        assert column[:, gyro] == pytest.approx(wanted)
        assert not np.delete(column, gyro, axis=1).any()
    low, high = problem.limits(problem.nominal().with_cause(cause.name, np.zeros(4)))
    for corner in (low, high):
        problem.predict([Point(np.zeros(len(problem.base)), {cause.name: np.clip(corner[-4:], -9.0, 9.0)})])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"id": "hum"}, "write its id as group.name"),
        ({"id": "drive.slope"}, "the catalogue already has this id"),
        ({"readings": None}, "neither commands nor readings"),
        ({"parameters": ()}, "it has no parameter"),
        ({"parameters": (replace(GAIN, neutral=None),)}, "gain: give it a neutral value"),
        ({"parameters": (replace(GAIN, neutral=2.0),)}, "gain: give it a neutral value"),
        ({"parameters": (replace(GAIN, prior_width=0.0),)}, "a prior_width above 0"),
        ({"parameters": (replace(GAIN, bounds=Bounds(0.0, 0.0)),)}, "gain: its bounds allow 0 alone"),
        ({"sentence": "It is {size}."}, "'size'; it may name gain"),
        ({"needs": ("sonar",)}, "needs 'sonar': allowed are bemf_left"),
    ],
)
def test_what_is_no_effect_is_refused_where_it_is_written(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        replace(SHIFT, **changes)


@pytest.mark.parametrize(
    ("readings", "message"),
    [
        (lambda *_: {"gyro": np.zeros(3)}, r"readings: gyro must give \(\d+,\) finite numbers"),
        (lambda drive, _: {"gyro": np.nan * drive.time}, r"finite numbers, not \d+ that are not finite"),
        (lambda drive, _: {"sonar": drive.time}, "'sonar'; this recording has bemf_left"),
        (
            lambda drive, _: {"gyro": drive.readings["sonar"]},
            "KeyError: 'sonar'; this recording has bemf",
        ),
        (lambda drive, _: drive.time, "readings must give the changed readings by name"),
    ],
)
def test_a_mistake_in_an_effect_is_named(readings: Callable[..., Any], message: str) -> None:
    columns = dict(make(4, seconds=4.0).columns)
    with pytest.raises(ConfigError, match=rf"team\.shift: .*{message}"):
        diagnose_recording(columns, ROBOT, own=[replace(SHIFT, readings=readings)])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (None, "there is no such file of causes"),
        ("x = 1\n", "it must have a list CAUSES of OwnEffect"),
        ("CAUSES = [1]\n", "it must have a list CAUSES of OwnEffect"),
        ("1 / 0\n", "ZeroDivisionError"),
        ("def (:\n", "SyntaxError"),
        ("raise SystemExit(3)\n", "SystemExit: 3"),
        (EXAMPLE.read_text() + "\nCAUSES = CAUSES + CAUSES[:1]\n", "team.motor_hum is there twice"),
    ],
)
def test_a_file_of_causes_that_is_none_is_refused(
    text: str | None, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    run = write_csv_file(tmp_path / "run.csv", dict(make(4, seconds=4.0).columns))
    path = tmp_path / "mine.py"
    if text is not None:
        path.write_text(text)
    assert main(["diagnose", str(run), "--causes", str(path)]) == 2
    said = capsys.readouterr().err
    assert message in said
    assert "mine.py" in said
    assert said.count("\n") == 1


def test_the_example_is_what_the_page_shows() -> None:
    ids = [each.id for each in runpy.run_path(str(EXAMPLE))["CAUSES"]]
    page = (EXAMPLE.parents[1] / "docs" / "diagnosis.md").read_text()
    assert all(each in page for each in ids)


def test_what_is_no_python_file_is_not_run_as_one(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_text("[controller]\n")
    with pytest.raises(
        ConfigError, match=r"robot\.toml: causes must be in a Python file, whose name ends in \.py"
    ):
        load_own_effects(path)


def test_a_program_in_place_of_causes_opens_no_robot(tmp_path: Path) -> None:
    path = tmp_path / "team.py"
    path.write_text("from raccoon import open_robot\nwith open_robot() as robot:\n    pass\n")
    with pytest.raises(
        ConfigError, match=r"team\.py: a program that is imported, swept or replayed must not open a robot"
    ):
        load_own_effects(path)
