"""The progress of a sweep at a terminal: a word before the first match, and its own line for what follows."""

import io
from contextlib import suppress

import pytest

from raccoon.cli.sweep.bar import Bar


class Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def test_whoever_waits_for_the_first_match_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.stderr", screen := Terminal())
    with Bar() as bar:
        bar.begin()
        assert "own robot comes first" in screen.getvalue()
        bar.show(1, 2, 0)
        bar.show(2, 2, 1)
    first, *shown = screen.getvalue().split("\r")
    assert all(len(each) > len(first) for each in shown)  # it is overwritten
    assert shown[-1].endswith("2/2 matches, 1 failed, 0:00 left \n")


@pytest.mark.parametrize("terminal", [Terminal, io.StringIO])
def test_an_error_of_the_first_match_has_a_line_of_its_own(
    terminal: type[io.StringIO], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sys.stderr", screen := terminal())
    with suppress(ValueError), Bar() as bar:
        bar.begin()
        raise ValueError
    assert screen.getvalue().endswith("...\n") or not screen.isatty()
    assert screen.isatty() or screen.getvalue() == ""
