"""What a mistyped name was meant to be."""

from pathlib import Path

import pytest

from raccoon.core.near_names import did_you_mean, did_you_mean_file

CAUSES = ("motor.back_emf_constant", "drive.wheel_slip", "drive.wheel_radius", "drive.slope")


@pytest.mark.parametrize(
    ("name", "meant"),
    [
        ("motor.back_emf_constnat", "motor.back_emf_constant"),
        ("Drive.Slope", "drive.slope"),
        ("slip", "drive.wheel_slip"),  # a part of one name alone
        ("wheel", ""),  # of two
        ("gyro", ""),
        (7, ""),
    ],
)
def test_the_name_that_is_most_like_it_is_meant(name: object, meant: str) -> None:
    assert did_you_mean(name, CAUSES) == (f" (did you mean {meant}?)" if meant else "")


def test_a_file_is_looked_for_in_its_folder(tmp_path: Path) -> None:
    for name in ("robot.toml", "run.csv", "run.jsonl.gz", "model.toml"):
        (tmp_path / name).touch()
    assert did_you_mean_file(tmp_path / "robt.toml") == f" (did you mean {tmp_path / 'robot.toml'}?)"
    assert did_you_mean_file(tmp_path / "run.jsn") == f" (did you mean {tmp_path / 'run.jsonl.gz'}?)"
    assert did_you_mean_file(tmp_path / "robot.toml") == ""
    assert did_you_mean_file(tmp_path / "table.toml") == ""
    assert did_you_mean_file(tmp_path / "none" / "robot.toml") == ""
