"""What is read from and written to disk: models and tables."""

import pickle
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from raccoon.core.config import MotorConfig, RobotConfig, TophatConfig, parse_robot, template
from raccoon.core.errors import ConfigError
from raccoon.sim.chain import Chain
from raccoon.sim.model_file import parse_model
from raccoon.sim.parameters import Parameters
from raccoon.sim.provenance import Origin, Provenance
from raccoon.sim.world import World

TABLES = Path(__file__).resolve().parents[3] / "examples" / "tables"


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


def test_models_and_tables_may_have_been_saved_by_a_windows_editor(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    model = Parameters.from_robot(RobotConfig()).with_effect("battery.internal_resistance", resistance=0.12)
    model.save(path)
    path.write_bytes("\ufeff".encode() + path.read_bytes().replace(b"\n", b"\r\n"))
    assert Parameters.from_model_file(path) == model
    table = next(TABLES.glob("*.toml"))
    (tmp_path / "table.toml").write_bytes("\ufeff".encode() + table.read_bytes())
    assert World.from_file(tmp_path / "table.toml") == World.from_file(table)


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
    assert list(model.without_effect("drive.turn_scrub").origins) == [("drive.inertia", None)]
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


def test_models_and_tables_can_be_sent_to_other_processes() -> None:
    model = Parameters(chain=Chain.firmware()).with_effect("drive.backlash", "left", angle=0.1)
    for thing in (model, World.from_file(TABLES / "workshop.toml")):
        assert pickle.loads(pickle.dumps(thing)) == thing


def test_nominal_values_are_those_of_the_robot() -> None:
    model = parse_model({"model": {"battery": {"open_circuit_voltage": 7.2}}})
    assert model.value("battery.open_circuit_voltage", "voltage") == 7.2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[[effect]]\nid = "battery.magic"', r"effect number 1: effect 'battery\.magic'"),
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
        ("[chain]\nmedain = true", r"chain\.medain"),
        ("[model.motor]\narmature_resistance = -1.0", "armature_resistance = -1"),
        ("[model.drive]\ntrack_width = 0.0", "track_width = 0"),
        ("[wheels]\n", "wheels: there is no"),
    ],
)
def test_a_mistake_in_a_model_is_named(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=message) as caught:
        Parameters.from_model_file(path)
    assert str(path) in str(caught.value)


def test_the_standard_table_is_the_one_that_ships_as_an_example() -> None:
    assert World.from_file(TABLES / "botball.toml") == World.default()


def test_a_table_with_everything_on_it() -> None:
    world = World.from_file(TABLES / "workshop.toml")
    assert world.line_distance(1.2, 0.3) == pytest.approx(-0.01, abs=1e-3)
    assert world.ambient(0.6, 0.0, 5.0) == 0.7
    assert world.ambient(0.6, 0.0, 9.0) == 0.0
    assert world.slope(1.7, 0.0) == (-0.05, 0.0)
    assert len(world.walls) == 5
    assert replace(world, ramps=()).slope(1.7, 0.0) == (0.0, 0.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[[line]]\npoints = [[0, 0]]", "two points or more"),
        ("[[line]]\nwidth = 0.1", "either points or arc"),
        ("[[line]]\npoints = [[0, 0], [1, 0]]\nwidth = -1", r"line number 1\.width is -1"),
        ("[[object]]\ncentre = [0, 0]\nradius = 0", "radius is 0"),
        ("[[wall]]\nfrom = [0, 0]\nto = [0, 0]", "they must differ"),
        ("[[light]]\nlow = [0, 0]\nhigh = [1, 1]\nambient = 7", r"ambient is 7"),
        ("area = { low = [1, 0], high = [0, 1] }", "must be below high"),
        ("[[object]]\ncentre = [0]\nradius = 1", r"centre = \[0\]"),
        ("[[hole]]\n", "hole"),
        ("[[ramp]]\nlow = [0, 0]\nhigh = [1, 1]\nalong_x = nan", "along_x = nan"),
    ],
)
def test_a_mistake_in_a_table_is_named(text: str, message: str, tmp_path: Path) -> None:
    assert tomllib.loads(text) is not None
    path = tmp_path / "table.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=message):
        World.from_file(path)
