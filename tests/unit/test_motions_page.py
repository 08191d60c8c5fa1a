"""docs/motions.md names every public thing that a program is made of, and an example uses it."""

import ast
import inspect
import re
from pathlib import Path

import pytest

import raccoon

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "motions.md").read_text("utf-8")
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
DRIVING = tuple(f"motions.{each}" for each in ("goals", "driving", "paths", "lines", "walls", "following"))
HOMES = (
    *DRIVING,
    "motions.crossings",
    "actions.actions",
    "actions.condition",
    "actions.conditions",
    "actions.functions",
    "match",
    "calibration.battery_check",
    "calibration.by_hand",
    "calibration.tophats",
    "calibration.wheels",
)
NAMES = sorted(name for home in HOMES for name in raccoon._HOMES[f"raccoon.robot.{home}"])
TYPES = {"Action", "Condition", "MatchReport", "MotionResult"}
MOTIONS = sorted(
    name for home in DRIVING for name in raccoon._HOMES[f"raccoon.robot.{home}"] if name not in TYPES
)
COMMON = {"tolerance", "timeout"}


@pytest.mark.parametrize("name", NAMES)
def test_the_page_names_it(name: str) -> None:
    assert re.search(rf"`\.?{name}\b", PAGE)


@pytest.mark.parametrize("name", [name for name in NAMES if name not in TYPES])
def test_an_example_uses_it(name: str) -> None:
    assert any(name in _names(path) for path in EXAMPLES)


def _names(path: Path) -> set[str]:
    nodes = ast.walk(ast.parse(path.read_text("utf-8")))
    return {node.id for node in nodes if isinstance(node, ast.Name)}


@pytest.mark.parametrize("name", MOTIONS)
def test_the_page_has_a_row_with_every_argument_and_an_example_that_uses_it(name: str) -> None:
    row = next(line for line in PAGE.splitlines() if line.startswith(f"| `{name}("))
    arguments = set(inspect.signature(getattr(raccoon, name)).parameters) - COMMON
    missing = {each for each in arguments if not re.search(rf"\b{each}\b", row.split("|")[1])}
    assert not missing
    linked = re.findall(r"\(\.\./examples/(\w+)\.py\)", row)
    assert linked
    assert all(name in _names(ROOT / "examples" / f"{each}.py") for each in linked)


@pytest.mark.parametrize("name", MOTIONS)
def test_its_docstring_gives_the_units(name: str) -> None:
    assert re.search(r"\b(m|rad|m/s|rad/s|duties)\b", inspect.getdoc(getattr(raccoon, name)) or "")
