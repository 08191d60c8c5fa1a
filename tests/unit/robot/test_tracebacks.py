"""What is printed of an error that ends a program: its own lines, and the sentence."""

from __future__ import annotations

import sys
from collections.abc import Callable
from traceback import extract_tb

import numpy as np
import pytest

from raccoon import do, load_robot, straight
from raccoon.core.near_names import did_you_mean
from raccoon.robot.robot import Robot
from raccoon.robot.tracebacks import WHOLE, install_hook
from robots import CONFIG, simulated_port


def _refused() -> None:
    straight(500.0)


def _called_by_the_library() -> None:
    with Robot(simulated_port(), CONFIG) as robot:
        robot.run(do(lambda _: float("none")))


def _called_by_another_library() -> None:
    np.apply_along_axis(lambda _: float("none"), 0, np.ones(2))


def _unreadable() -> None:
    load_robot(sys.prefix)


def _broken_library() -> None:
    did_you_mean("name", [1])  # type: ignore[list-item]


@pytest.mark.parametrize(
    ("program", "lines", "left_out"),
    [
        (_refused, ["program()", "straight(500.0)"], True),
        (_called_by_the_library, ["program()", "robot.run(do(", 'float("none")'], True),
        (_called_by_another_library, ["program()", "np.apply_along_axis(", 'float("none")'], True),
        (_unreadable, ["program()", "load_robot(sys.prefix)", f"directory: '{sys.prefix}'"], True),
        (_broken_library, ["program()", "did_you_mean(", "nearest_name(", ".lower()"], False),
    ],
)
def test_a_program_sees_its_own_lines_and_the_sentence(
    program: Callable[[], None],
    lines: list[str],
    left_out: bool,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """But for an error that the package does not say in words: that is its own, and shown with all lines."""
    monkeypatch.setattr(sys, "excepthook", sys.__excepthook__)
    install_hook()
    with pytest.raises((AttributeError, ValueError, OSError), match=r"500|float|lower|Is a dir") as caught:
        program()
    error = caught.value
    whole = len(extract_tb(error.__traceback__))
    sys.excepthook(type(error), error, error.__traceback__)
    assert len(extract_tb(error.__traceback__)) == whole  # for whoever looks at the error itself
    said = capsys.readouterr().err
    shown = [each.strip() for each in said.splitlines()]
    places = [next(n for n, text in enumerate(shown) if line in text) for line in lines]
    assert places == sorted(places)
    assert ("src/raccoon" in said) is not left_out
    assert "site-packages" not in said
    assert (f"left out: {WHOLE}=1 in the environment shows them" in said) is left_out


def test_the_whole_is_printed_where_it_is_asked_for_and_by_the_hook_of_others(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(sys, "excepthook", sys.__excepthook__)
    monkeypatch.setenv(WHOLE, "1")
    install_hook()
    assert sys.excepthook is sys.__excepthook__
    monkeypatch.delenv(WHOLE)
    monkeypatch.setattr(sys, "excepthook", print)
    install_hook()
    assert sys.excepthook is print


@pytest.mark.parametrize(
    ("who", "file", "is_short"),
    [
        ("__main__", "/team/match.py", True),
        ("helpers", "/team/helpers.py", True),
        ("lines", "/team/parts/lines.py", True),
        ("library", "/elsewhere/library.py", False),
        ("library", "/team/.venv/lib/python3.11/site-packages/library.py", False),
        ("library", "/team2/library.py", False),
    ],
)
@pytest.mark.parametrize("line", ["from raccoon import straigt", "import raccoon; raccoon.straigt"])
def test_a_program_has_short_tracebacks_before_it_opens_a_robot(
    line: str, who: str, file: str, is_short: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A wrong import or robot.toml is an error before, in a module of the program too, which may ask first. A
    library that uses this one keeps Python's hook."""
    monkeypatch.setattr(sys.modules["__main__"], "__file__", "/team/match.py", raising=False)
    monkeypatch.setattr(sys, "excepthook", sys.__excepthook__)
    with pytest.raises((ImportError, AttributeError), match="straigt"):
        exec(line, {"__name__": who, "__file__": file})
    assert (sys.excepthook is not sys.__excepthook__) is is_short
