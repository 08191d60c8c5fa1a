"""What the pages write as code is there: options of the commands, files, names of the library, its words."""

import argparse
import re
import shlex
from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from raccoon.cli.commands import build_parser
from raccoon.core.config import is_model, load_robot
from raccoon.core.toml_text import parse_toml
from raccoon.sim.effects.model_file import load_model

ROOT = Path(__file__).resolve().parents[2]
PAGES = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])
FILES = [
    path
    for part in ("src", "tests", "benchmarks", "examples")
    for path in (ROOT / part).rglob("*.py")
    if path != Path(__file__)
]
BLOCK = re.compile(r"^```.*?^```", re.MULTILINE | re.DOTALL)
SPAN = re.compile(r"`([^`\n]+)`")
OPTION = re.compile(r"(?<![\w-])--[a-z][a-z-]+")
FILE = re.compile(r"(?<![\w/*.{-])[\w/-]+\.py\b")
DOTTED = re.compile(r"\braccoon(?:\.\w+)+")
IDENTIFIER = re.compile(r"\b(?:[A-Za-z]\w*_\w+|[A-Z][a-z]+[A-Z]\w*|[a-z]\w*(?=\())")
OF_OTHERS = {"--quiet", "--editable", "--now", "--system-site-packages", "--timeout"}
"""Options of pip, systemctl, venv and pytest."""
OF_THE_WOMBAT = {"botball_user_program", "i2c_arm", "i2c_arm_baudrate", "stm32_data_reader"}
OF_KIPR = {
    "ao",
    "bmd",
    "cmpc",
    "create_connect",
    "disable_servo",
    "enable_servos",
    "freeze",
    "gmpc",
    "gyro_z",
}
OF_KIPR |= {"mav", "motor", "motor_power", "mrp", "msleep", "mtp", "off", "power_level", "push_button"}
OF_KIPR |= {"printf", "set_servo_position", "shut_down_in"}
"""Functions of KIPR's library, on the page for those who come from it."""


def options_of(parser: argparse.ArgumentParser, words: str = "raccoon") -> Iterator[tuple[str, set[str]]]:
    """Each command, with its sub-command, and the options that it has."""
    options: set[str] = set()
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for word, command in action.choices.items():
                yield from options_of(command, f"{words} {word}")
        options.update(action.option_strings)
    yield words, options


COMMANDS = dict(options_of(build_parser()))


@cache
def text_of(path: Path) -> str:
    return path.read_text("utf-8")


@cache
def options_in(path: Path) -> frozenset[str]:
    return frozenset(OPTION.findall(text_of(path)))


def code_of(text: str) -> list[str]:
    """The spans and the lines of blocks that a page writes as code."""
    text = re.sub(r"^```python.*?^```", "", text, flags=re.MULTILINE | re.DOTALL)  # test_examples runs it
    lines = [line for block in BLOCK.findall(text) for line in block.splitlines()[1:-1]]
    return [*SPAN.findall(BLOCK.sub("", text)), *lines]


@cache
def all_options() -> set[str]:
    return set().union(*COMMANDS.values(), *map(options_in, (ROOT / "benchmarks").glob("*.py")))


def known_options(code: str) -> set[str]:
    """The options of the command or benchmark in a piece of code; where it names none, those of all."""
    if code.startswith("raccoon "):
        called = " ".join(code.split()[:3])
        return COMMANDS[max((name for name in COMMANDS if f"{called} ".startswith(f"{name} ")), key=len)]
    if called_file := re.search(r"benchmarks/\w+\.py", code):
        return {*options_in(ROOT / called_file[0])}
    return all_options()


def is_name(name: str) -> bool:
    """Whether a dotted name is a module, or stands in the one that it begins with."""
    module, _, rest = name.rpartition(".")
    try:
        if find_spec(name) is not None:
            return True
    except ModuleNotFoundError:
        return is_name(module)  # an attribute of something in a module
    spec = find_spec(module)
    return spec is not None and spec.origin is not None and rest in text_of(Path(spec.origin))


def not_there(text: str) -> list[str]:
    """What a page names as code and nothing has."""
    words = "\n".join([*map(text_of, FILES), *(path.stem for path in FILES)])
    ends = {"/".join(path.parts[-count:]) for path in FILES for count in range(1, 7)}
    found = []
    for code in code_of(text):
        said = re.sub(r" # .*| -k \w+", "", code)
        found += sorted(set(OPTION.findall(said)) - known_options(said) - OF_OTHERS)
        found += [file for file in FILE.findall(said) if file.removeprefix("../") not in ends]
        found += [name for name in DOTTED.findall(said) if not is_name(name)]
        names = set(IDENTIFIER.findall(said)) - OF_THE_WOMBAT - OF_KIPR
        found += sorted(name for name in names if name not in words)
    return found


def test_what_stands_on_the_pages_as_code_is_there() -> None:
    assert not_there("\n".join(map(text_of, PAGES))) == []


def test_the_commands_in_the_blocks_of_the_pages_can_be_called() -> None:
    blocks = "\n".join(block for page in PAGES for block in BLOCK.findall(text_of(page)))
    calls = [line for line in blocks.splitlines() if line.startswith("raccoon ")]
    assert len(calls) > 20
    parser = build_parser()
    for call in calls:
        parser.parse_args(shlex.split(call, comments=True)[1:])


def test_what_the_pages_write_as_toml_is_a_robot_or_a_model(tmp_path: Path) -> None:
    blocks = re.findall(r"^```toml\n(.*?)^```", "\n".join(map(text_of, PAGES)), re.MULTILINE | re.DOTALL)
    assert blocks
    for block in blocks:
        path = tmp_path / "block.toml"
        path.write_text(block, encoding="utf-8")
        if is_model(parse_toml(path.read_bytes())):
            assert load_model(path).effects or "[[effect]]" not in block
        else:
            load_robot(path)


def test_what_is_not_there_is_found() -> None:
    spans = "`raccoon view x --tabel` `sim/gone.py` `raccoon.sim.gone.Gone` `raccoon.Robot` `no_such()`\n"
    block = "```\nraccoon init --seed\npython benchmarks/motions.py --thin --thick  # --not\n```\n"
    gone = ["--tabel", "sim/gone.py", "raccoon.sim.gone.Gone", "no_such", "--seed", "--thick"]
    assert not_there(spans + block) == gone
