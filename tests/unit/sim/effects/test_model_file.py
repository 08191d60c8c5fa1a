"""Models on disk: what is written is read again, and mistakes in a file are named."""

import pickle
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from raccoon.core.config import Measured, MotorConfig, RobotConfig, TophatConfig, parse_robot, template
from raccoon.core.errors import ConfigError
from raccoon.sim.effects.chain import Chain
from raccoon.sim.effects.model_file import load_model, parse_model
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.effects.provenance import Origin, Provenance


def test_a_model_survives_the_way_to_disk_and_back(tmp_path: Path) -> None:
    robot = RobotConfig(
        name='the "old" one',
        motors={1: MotorConfig(inverted=True)},
        tophats={"front": TophatConfig(analog=3, left=0.02)},
    )
    model = (
        Parameters(robot, chain=Chain.firmware())
        .with_effect("battery.internal_resistance", resistance=0.12)
        .with_effect("drive.wheel_radius", "left", factor=1.02)
        .with_effect("tophat.gain", "3", factor=0.8)
        .with_effect("motor.current_limit")
    )
    model.save(tmp_path / "model.toml")
    assert Parameters.from_model_file(tmp_path / "model.toml") == model
    assert [each.name for each in tmp_path.iterdir()] == ["model.toml"]


def test_a_file_of_effects_alone_is_of_the_robot_that_is_given(tmp_path: Path) -> None:
    path, robot = tmp_path / "model.toml", RobotConfig(name="heavy", motors={1: MotorConfig(inverted=True)})
    path.write_text('[[effect]]\nid = "drive.wheel_radius"\nparameters = { factor = 1.02 }\n')
    assert load_model(path, robot).robot == robot
    assert load_model(path).robot == RobotConfig()
    whole = Parameters().with_effect("drive.wheel_radius", factor=1.02)
    whole.save(path)
    assert load_model(path, robot) == whole


def test_a_robot_toml_is_no_model(tmp_path: Path) -> None:
    """Taken for one it would be a robot that nothing is wrong with, in place of the one that was meant."""
    path = tmp_path / "robot.toml"
    path.write_text("[drive]\nleft = 0\n[model.drive]\ntrack_width = 0.2\n")
    with pytest.raises(ConfigError, match=r"robot\.toml: .* no model but a robot\.toml: name a model"):
        load_model(path)


def test_numbers_alone_are_a_model(tmp_path: Path) -> None:
    (tmp_path / "empty.toml").write_text("[model.battery]\nopen_circuit_voltage = 6.2\n")
    assert load_model(tmp_path / "empty.toml").robot.model.battery.open_circuit_voltage.value == 6.2


def test_a_model_may_have_been_saved_by_a_windows_editor(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    model = Parameters.from_robot(RobotConfig()).with_effect("battery.internal_resistance", resistance=0.12)
    model.save(path)
    path.write_bytes("\ufeff".encode() + path.read_bytes().replace(b"\n", b"\r\n"))
    assert Parameters.from_model_file(path) == model


def test_a_model_keeps_where_its_numbers_come_from(tmp_path: Path) -> None:
    origin = Origin({"angle": 0.004}, "named: the gears have play.", 0.97)
    model = replace(
        Parameters()
        .with_effect("drive.backlash", "left", angle=0.06)
        .with_effect("drive.inertia", factor=1.1),
        provenance=Provenance("run.csv", "raccoon diagnose", "2026-03-01", "explained"),
    ).with_origin("drive.backlash", "left", origin)
    model.save(tmp_path / "model.toml")
    again = Parameters.from_model_file(tmp_path / "model.toml")
    assert again.origins == {("drive.backlash", "left"): origin}
    assert again.provenance == model.provenance


def test_an_effect_that_is_changed_loses_its_origin() -> None:
    model = Parameters().with_effect("drive.inertia", factor=1.1).with_effect("drive.turn_scrub", torque=0.1)
    model = model.with_origin("drive.inertia", None, Origin({"factor": 0.01}))
    model = model.with_origin("drive.turn_scrub", None, Origin({"torque": 0.01}))
    assert list(model.with_effect("drive.inertia", factor=1.2).origins) == [("drive.turn_scrub", None)]
    assert model.with_effect("drive.inertia", factor=1.1) == model  # equal robots, however found


def test_a_model_of_every_section_that_a_robot_may_have_survives(tmp_path: Path) -> None:
    servos = """
        [servo."left claw"]
        port = 1
        positions_us = { open = 1200, "half shut" = 1500.5 }
        [mechanism.lift]
        motor = 3
    """
    for text in (template().replace("# [", "["), servos):
        model = Parameters(parse_robot(tomllib.loads(text)), chain=Chain.firmware())
        model.save(tmp_path / "model.toml")
        assert Parameters.from_model_file(tmp_path / "model.toml") == model


@pytest.mark.parametrize("name", ["a\nb", "a\tb", "a\x00\x7fb", 'quoted "\\" ä'])
def test_a_robot_may_have_any_name(tmp_path: Path, name: str) -> None:
    model = Parameters(RobotConfig(name=name))
    model.save(tmp_path / "model.toml")
    assert Parameters.from_model_file(tmp_path / "model.toml") == model


def test_a_number_of_numpy_is_written_as_one(tmp_path: Path) -> None:
    motor = MotorConfig(static_voltage=Measured(np.float64(0.3), np.float64(0.01)))
    model = Parameters(RobotConfig(motors={0: motor}))
    model.save(tmp_path / "model.toml")
    assert Parameters.from_model_file(tmp_path / "model.toml") == model


def test_a_recording_whose_name_is_no_text_is_named_as_far_as_it_is(tmp_path: Path) -> None:
    replace(Parameters(), provenance=Provenance(recording="b\udce4d.csv")).save(tmp_path / "model.toml")
    assert Parameters.from_model_file(tmp_path / "model.toml").provenance.recording == "b?d.csv"


def test_a_model_can_be_sent_to_other_processes() -> None:
    model = Parameters(chain=Chain.firmware()).with_effect("drive.backlash", "left", angle=0.1)
    assert pickle.loads(pickle.dumps(model)) == model


def test_nominal_values_are_those_of_the_robot() -> None:
    model = parse_model({"model": {"battery": {"open_circuit_voltage": 7.2}}})
    assert model.value("battery.open_circuit_voltage", "voltage") == 7.2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            '[[effect]]\nid = "battery.magic"',
            r"effect number 1: effect 'battery\.magic': there is no such id",
        ),
        ('[[effect]]\nid = "battery.discharge"\nwhere = "left"', "allowed are nothing"),
        (
            '[[effect]]\nid = "drive.inertia"\nparameters = { factor = -1 }',
            "factor is -1: allowed are numbers",
        ),
        (
            '[[effect]]\nid = "drive.inertia"\nparameters = { mass = 1 }',
            "no parameter mass; allowed are factor",
        ),
        ('[[effect]]\nid = "drive.inertia"\nparameters = { factor = "x" }', "must be a number"),
        ("[[effect]]\n", "no id"),
        (
            '[[effect]]\nid = "drive.inertia"\nparameters = { factor = 1.1 }\nstd = { mass = 0.1 }',
            "no parameter mass; allowed are factor",
        ),
        (
            '[[effect]]\nid = "drive.inertia"\nparameters = { factor = 1.1 }\nstd = { factor = -0.1 }',
            r"drive\.inertia\.std\.factor = -0\.1: allowed are numbers from 0",
        ),
        (
            '[[effect]]\nid = "drive.inertia"\nparameters = { factor = 1.1 }\nprobability = 97',
            "probability = 97: allowed are numbers from 0 to 1",
        ),
        ('[provenance]\nfile = "run.csv"', r"provenance\.file: there is no such key"),
        (
            f'[[effect]]\nid = "drive.inertia"\nparameters = {{ factor = 1{"0" * 400} }}',
            r"factor is 10+\.\.\.: the number is too large",
        ),
        ("[chain]\nmedain = true", r"chain\.medain"),
        (
            "[[effct]]",
            r"effct: there is no such key \(did you mean effect\?\); .*, model, effect, chain",
        ),
        ("[model.motor]\narmature_resistance = -1.0", r"armature_resistance = -1\.0: allowed are numbers"),
        ("[model.drive]\ntrack_width = 0", r"track_width = 0: allowed are numbers from 0\.01 to 10"),
        ("[model.drive]\ntracks = 1", "tracks: there is no such key"),
        ('[[effect]]\nid = "friction.coulomb"\nparameters = { torque = -1 }', "torque is -1 N m: allowed"),
        ('[[effect]]\nid = "friction.coulomb"\nparameters = { torque = nan }', "torque is nan N m"),
        ('[[effect]]\nid = "friction.coulomb"\nparameters = { torque = "a" }', "it must be a number"),
        ('[[effect]]\nid = "friction.coulomb"\nwhere = "up"', "where is 'up'"),
        ("effect = [1]", r"write \[\[effect\]\]"),
        ("[chain]\ncoast_share = 2", "coast_share is 2: allowed are numbers from"),
        ('[chain]\ncoast_share = "a"', "coast_share is 'a': allowed are numbers from"),
        ("[chain]\nmedian = 3", "median is 3: allowed are true and false"),
        ("[[effect", "not a TOML file"),
        ("[wheels]\n", "wheels: there is no"),
    ],
)
def test_a_mistake_in_a_model_is_named(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=message) as caught:
        Parameters.from_model_file(path)
    assert str(path) in str(caught.value)
