"""Every example runs against the simulator, and every block of Python in the pages does."""

import re
import runpy
import textwrap
from pathlib import Path

import pytest

import raccoon

ROOT = Path(__file__).resolve().parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])
BLOCK = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)


@pytest.fixture
def beside_robot_toml(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A fresh folder with the examples' robot.toml in it, as the current one. Its robot has a quarter of the
    cycles a second, which takes a third of the time."""
    robot = (ROOT / "examples" / "robot.toml").read_text("utf-8")
    assert "[controller]\n" in robot
    slow = robot.replace("[controller]\n", "[controller]\nrate_hz = 50.0\n")
    (tmp_path / "robot.toml").write_text(slow, "utf-8")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
@pytest.mark.usefixtures("beside_robot_toml")
def test_example_runs(example: Path, capsys: pytest.CaptureFixture[str]) -> None:
    runpy.run_path(str(example), run_name="__main__")
    assert capsys.readouterr().out


@pytest.mark.usefixtures("beside_robot_toml")
def test_the_program_in_the_docstring_of_the_package_runs() -> None:
    program = (raccoon.__doc__ or "").partition("::\n\n")[2].partition("\n\nNames")[0]
    exec(compile(textwrap.dedent(program), "raccoon", "exec"), {})


@pytest.mark.parametrize(
    "page", [page for page in PAGES if BLOCK.search(page.read_text("utf-8"))], ids=lambda page: page.stem
)
@pytest.mark.usefixtures("beside_robot_toml")
def test_blocks_of_a_page_run(page: Path) -> None:
    names: dict[str, object] = {"__name__": "__main__"}
    for block in BLOCK.findall(page.read_text("utf-8")):
        exec(compile(block, page.name, "exec"), names)
