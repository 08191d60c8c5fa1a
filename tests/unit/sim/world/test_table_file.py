"""Tables on disk: the ones that ship, from any editor, and mistakes in a file are named."""

import math
import pickle
import tomllib
from dataclasses import replace
from pathlib import Path

import pytest

from raccoon.core.errors import ConfigError
from raccoon.sim.world.table import World
from raccoon.sim.world.table_file import parse_world

TABLES = Path(__file__).resolve().parents[4] / "examples" / "tables"


def test_the_standard_table_is_the_one_that_ships_as_an_example() -> None:
    assert World.from_file(TABLES / "botball.toml") == World.default()


def test_a_table_with_everything_on_it() -> None:
    world = World.from_file(TABLES / "workshop.toml")
    assert world.nearest_line(1.2, 0.3)[0] == pytest.approx(-0.01, abs=1e-3)
    assert world.ambient(0.6, 0.0, 5.0) == 0.7
    assert world.ambient(0.6, 0.0, 9.0) == 0.0
    assert world.slope(1.7, 0.0) == (-0.05, 0.0)
    assert len(world.walls) == 5
    assert replace(world, ramps=()).slope(1.7, 0.0) == (0.0, 0.0)


def test_a_table_may_have_been_saved_by_a_windows_editor(tmp_path: Path) -> None:
    table = next(TABLES.glob("*.toml"))
    (tmp_path / "table.toml").write_bytes("\ufeff".encode() + table.read_bytes())
    assert World.from_file(tmp_path / "table.toml") == World.from_file(table)


@pytest.mark.parametrize("radius", [0.1, 0.5, 2.0])
def test_an_arc_is_round_to_half_a_millimetre(radius: float) -> None:
    arc = {"centre": [0.3, -0.2], "radius": radius, "from_deg": 10, "to_deg": 100}
    world = parse_world({"line": [{"arc": arc, "width": 0.02}]})
    for degrees in range(11, 100):
        angle = math.radians(degrees)
        x, y = 0.3 + radius * math.cos(angle), -0.2 + radius * math.sin(angle)
        assert world.nearest_line(x, y)[0] == pytest.approx(-0.01, abs=0.00051)


def test_a_table_can_be_sent_to_other_processes() -> None:
    world = World.from_file(TABLES / "workshop.toml")
    assert pickle.loads(pickle.dumps(world)) == world


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
        ("area = { low = [-inf, 0], high = [1, 1] }", r"area: low \(-inf, 0.0\), .*: allowed are finite"),
        (f"[[object]]\ncentre = [0, 0]\nradius = 1{'0' * 400}", r"radius = 10+\.\.\.: it must be a finite"),
        (f"[[object]]\ncentre = [0, 1{'0' * 400}]\nradius = 1", r"centre = \[0, 10+\.\.\.: it must be \[x"),
        ("[[hole]]\n", "hole"),
        ("[[ramp]]\nlow = [0, 0]\nhigh = [1, 1]\nalong_x = nan", "along_x = nan"),
        ("line = [1, 2]", r"line: write \[\[line\]\], one for each"),
        ("[[line]]\npoints = 5", r"line number 1\.points = 5: write \[\[x, y\], \[x, y\]\]"),
        ("[[line]]\narc = 5", r"line number 1\.arc = 5: write \{ centre"),
        (
            "[[line]]\narc = { centre = [0, 0], radius = 1, to_deg = 1e9 }",
            "to_deg 1e\\+09: allowed is up to one turn",
        ),
        (
            "[[line]]\narc = { centre = [0, 0], radius = 1, to_deg = 0 }",
            "to_deg 0: allowed is up to one turn",
        ),
        ("area = { low = [0, 0], high = [1, 1] }\nwalls = 'no'", "walls = 'no': allowed are true and false"),
        ("[[light]]\nlow = [0, 0]\nhigh = [1, 1]\nambient = 1\nbegin = 5\nend = 5", "would never shine"),
    ],
)
def test_a_mistake_in_a_table_is_named(text: str, message: str, tmp_path: Path) -> None:
    assert tomllib.loads(text) is not None
    path = tmp_path / "table.toml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=message):
        World.from_file(path)
