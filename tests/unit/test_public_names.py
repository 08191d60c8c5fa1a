"""The public names are where they are said to be."""

import ast
import re
from pathlib import Path

import pytest

import raccoon
from raccoon.robot.robot_state import RobotState

ROOT = Path(__file__).resolve().parents[2]


def test_every_public_name_exists() -> None:
    for name in raccoon.__all__:
        assert getattr(raccoon, name) is not None, name


def test_the_lazy_table_and_the_list_agree() -> None:
    assert sorted(raccoon.__all__) == list(raccoon.__all__)
    assert set(raccoon._HOME_OF) | {"deg"} == set(raccoon.__all__)


def test_an_unknown_name_is_an_attribute_error_for_python_and_for_the_type_checker() -> None:
    with pytest.raises(AttributeError, match="drive_staight"):
        raccoon.drive_staight(0.2)  # type: ignore[attr-defined]  # unused, which mypy says, if it took any name


def test_editors_that_use_jedi_complete_the_public_names() -> None:
    """jedi skips what stands below an `if` whose condition is false by a plain assignment, and reads it where
    the condition has nothing but a type."""
    source = ast.parse(Path(raccoon.__file__).read_text("utf-8"))
    declared = next(each for each in source.body if ast.unparse(each).startswith("TYPE_CHECKING"))
    assert isinstance(declared, ast.AnnAssign)
    offered = next(each for each in source.body if ast.unparse(each).startswith("if TYPE_CHECKING"))
    names = {
        alias.name for each in ast.walk(offered) if isinstance(each, ast.ImportFrom) for alias in each.names
    }
    assert set(raccoon.__all__) <= names | {"deg"}


def test_every_public_name_stands_on_a_page() -> None:
    pages = [ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    words = set(re.findall(r"\w+", " ".join(page.read_text("utf-8") for page in pages)))
    assert not set(raccoon.__all__) - words


def test_what_a_program_asks_a_robot_stands_in_the_table_of_the_motions_page() -> None:
    page = (ROOT / "docs" / "motions.md").read_text("utf-8")
    table = page.partition("## What a robot knows")[2].partition("\n## ")[0]
    asked = {name for name in vars(RobotState) if not name.startswith("_")}
    assert set(re.findall(r"`robot\.(\w+)", table)) >= asked
