import os
import re
import tomllib
from dataclasses import replace
from datetime import date
from pathlib import Path

import pytest

from raccoon.core.config import Measured, load_robot, parse_robot, template
from raccoon.core.config_file import updated_text, write_measured
from raccoon.core.errors import ConfigError
from raccoon.core.toml_text import parse_toml

DAY = date(2026, 3, 1)
TEXT = """# our drum bot
name = "drumbot"   # not the ball bot

[drive]
left = 0
right = 1

[motor.0]
inverted = true   # soldered the wrong way
radians_per_tick = { value = 0.004, std = 0.0001 }   # by hand

# right one
[motor.1]

[model.drive]
wheel_radius = 0.0345
"""
TICKS = Measured(0.00388, 0.00004, battery_voltage=6.7)


def written(tmp_path: Path, text: str = TEXT) -> Path:
    path = tmp_path / "robot.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_value_is_replaced_and_everything_else_stays(tmp_path: Path) -> None:
    path = written(tmp_path)
    write_measured(path, {"motor.0.radians_per_tick": TICKS}, day=DAY)
    new = "{ value = 0.00388, std = 4e-05, date = 2026-03-01, battery_voltage = 6.7 }   # by hand"
    assert path.read_text(encoding="utf-8") == TEXT.replace(
        "{ value = 0.004, std = 0.0001 }   # by hand", new
    )
    assert load_robot(path).motor(0).radians_per_tick == Measured(0.00388, 0.00004, DAY, 6.7)


def test_a_new_key_goes_into_its_table_and_a_new_table_to_the_end(tmp_path: Path) -> None:
    path = written(tmp_path)
    values = {"motor.1.bemf_offset": Measured(-20.0, 0.3), "model.imu.gyro_bias": Measured(0.001, 0.0)}
    write_measured(path, values, day=DAY)
    text = path.read_text(encoding="utf-8")
    assert "[motor.1]\nbemf_offset = { value = -20.0, std = 0.3, date = 2026-03-01 }\n" in text
    assert text.endswith("\n[model.imu]\ngyro_bias = { value = 0.001, std = 0.0, date = 2026-03-01 }\n")
    assert all(line in text for line in TEXT.splitlines())
    assert load_robot(path).motor(1).bemf_offset == Measured(-20.0, 0.3, DAY)


def test_a_section_that_is_commented_out_does_not_get_the_keys_of_the_one_before() -> None:
    """In the file of `raccoon init` the first motor's calibration stood below `# [mechanism.arm]`, and became
    the arm's, which has no such key, when somebody took its # away."""
    text = template()
    changed = updated_text(text, {"motor.0.radians_per_tick": Measured(0.003, 1e-5)})
    uncommented = re.sub(r"^# (\[(?:tophat|servo|mechanism)\..*)$", r"\1", changed, flags=re.MULTILINE)
    robot = parse_robot(parse_toml(uncommented))
    assert robot.motor(0).radians_per_tick == Measured(0.003, 1e-5)
    assert set(robot.mechanisms) == {"arm"}
    lines = changed.splitlines()
    place = lines.index("radians_per_tick = { value = 0.003, std = 1e-05 }")
    assert lines[place - 1].startswith("# radians_per_tick = ")
    assert [*lines[:place], *lines[place + 1 :]] == text.splitlines()


def test_a_remark_in_brackets_does_not_hide_the_keys_below_it() -> None:
    text = "[motor.0]\n# [soldered in May]\nbemf_offset = 3.0\n"
    changed = updated_text(text, {"motor.0.bemf_offset": Measured(4.0, 1.0)})
    assert changed == "[motor.0]\n# [soldered in May]\nbemf_offset = { value = 4.0, std = 1.0 }\n"


def test_what_was_replaced_is_kept_in_order(tmp_path: Path) -> None:
    path = written(tmp_path)
    write_measured(path, {"motor.0.radians_per_tick": TICKS}, day=DAY)
    write_measured(path, {"motor.0.radians_per_tick": Measured(0.0039, 0.0)}, day=date(2026, 3, 2))
    history = tomllib.loads((tmp_path / "robot.history.toml").read_text(encoding="utf-8"))["replaced"]
    assert [each["was"]["value"] for each in history] == [0.004, 0.00388]
    assert history[1]["was"]["battery_voltage"] == 6.7
    assert history[1]["on"] == date(2026, 3, 2)
    assert history[0]["key"] == "motor.0.radians_per_tick"


def test_a_history_that_is_none_is_named_and_nothing_changes(tmp_path: Path) -> None:
    path = written(tmp_path)
    history = tmp_path / "robot.history.toml"
    history.write_text("what was = \n", encoding="utf-8")
    with pytest.raises(ConfigError, match=r"robot\.history\.toml: not a TOML file.*move it away"):
        write_measured(path, {"motor.0.radians_per_tick": TICKS}, day=DAY)
    assert path.read_text(encoding="utf-8") == TEXT


def test_the_file_of_what_was_replaced_is_given(tmp_path: Path) -> None:
    path = written(tmp_path)
    assert write_measured(path, {"motor.1.radians_per_tick": TICKS}, day=DAY) is None
    replaced = write_measured(path, {"motor.1.radians_per_tick": TICKS}, day=DAY)
    assert replaced == tmp_path / "robot.history.toml"
    assert replaced.exists()


@pytest.mark.parametrize("last", ["\r\n", ""])
def test_a_file_of_a_windows_editor_keeps_its_mark_and_line_ends(tmp_path: Path, last: str) -> None:
    path = tmp_path / "robot.toml"
    path.write_bytes(("\ufeff" + TEXT.rstrip("\n").replace("\n", "\r\n") + last).encode())
    values = {
        "motor.0.radians_per_tick": TICKS,
        "motor.1.bemf_offset": Measured(-20.0, 0.3),
        "model.imu.gyro_bias": Measured(0.001, 0.0),
        "model.drive.wheel_radius": Measured(0.035, 0.0001),
    }
    write_measured(path, values, day=DAY)
    text = path.read_bytes().decode()
    assert text.startswith("\ufeff# our drum bot\r\n")
    assert text.count("\n") == text.count("\r\n") == text.count("\r")
    robot = load_robot(path)
    assert robot.motor(0).radians_per_tick == Measured(0.00388, 0.00004, DAY, 6.7)
    assert robot.model.imu.gyro_bias.value == 0.001
    assert text.replace("\r", "").removeprefix("\ufeff") == updated_text(
        TEXT, {key: replace(value, date=DAY) for key, value in values.items()}
    )


def test_a_first_calibration_leaves_no_history(tmp_path: Path) -> None:
    path = written(tmp_path)
    write_measured(path, {"motor.1.radians_per_tick": TICKS}, day=DAY)
    assert sorted(each.name for each in tmp_path.iterdir()) == ["robot.toml"]


@pytest.mark.parametrize(
    "text",
    [
        "motor.0.radians_per_tick = 0.004\n",
        "[motor]\n0 = { radians_per_tick = 0.004 }\n",
        "[motor.0.radians_per_tick]\nvalue = 0.004\n",
    ],
)
def test_a_form_that_cannot_be_edited_is_refused_and_untouched(tmp_path: Path, text: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(ConfigError, match=r"robot\.toml.*cannot be edited"):
        write_measured(path, {"motor.0.radians_per_tick": TICKS}, day=DAY)
    assert path.read_text(encoding="utf-8") == text
    assert [each.name for each in tmp_path.iterdir()] == ["robot.toml"]


@pytest.mark.parametrize(
    ("key", "value", "reason"),
    [
        ("motor.0.radians_per_tick", -1.0, "from 1e-08"),
        ("motor.9.radians_per_tick", 1.0, "ports 0 to 3"),
        ("motor.0.unknown", 1.0, "no such key"),
        ("name", 1.0, "must be in a table"),
        ("name.first", 1.0, "is no table"),
    ],
)
def test_a_value_that_is_not_allowed_changes_nothing(
    tmp_path: Path, key: str, value: float, reason: str
) -> None:
    path = written(tmp_path)
    with pytest.raises(ConfigError, match=reason):
        write_measured(path, {key: Measured(value)}, day=DAY)
    assert path.read_text(encoding="utf-8") == TEXT


def test_a_missing_file_is_told_as_such(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        write_measured(tmp_path / "robot.toml", {"motor.0.radians_per_tick": TICKS})


def test_permissions_survive(tmp_path: Path) -> None:
    path = written(tmp_path)
    path.chmod(0o600)
    write_measured(path, {"motor.1.radians_per_tick": TICKS}, day=DAY)
    assert path.stat().st_mode & 0o777 == 0o600


def test_a_failed_write_leaves_the_old_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = written(tmp_path)

    def refuse(source: str, target: str) -> None:
        raise OSError("no space left")

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(OSError, match="no space"):
        write_measured(path, {"motor.1.radians_per_tick": TICKS}, day=DAY)
    assert path.read_text(encoding="utf-8") == TEXT
    assert [each.name for each in tmp_path.iterdir()] == ["robot.toml"]


def test_an_empty_file_gets_its_first_table() -> None:
    assert updated_text("", {"motor.2.bemf_offset": Measured(5.0, 1.0)}) == (
        "[motor.2]\nbemf_offset = { value = 5.0, std = 1.0 }\n"
    )
