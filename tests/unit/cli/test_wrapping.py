from __future__ import annotations

import pytest

from raccoon.cli.wrapping import print_wrapped

TEXT = "  1. The floor is not level and pulls to the left: level the table.\n  motor.0.bemf   1.82 ->   1.8"


def test_a_long_sentence_breaks_between_words_on_a_terminal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "44")
    monkeypatch.setattr("sys.stdout.isatty", lambda: True)
    print_wrapped(TEXT)
    assert capsys.readouterr().out == (
        "  1. The floor is not level and pulls to the\n      left: level the table.\n"
        "  motor.0.bemf   1.82 ->   1.8\n"
    )


def test_and_stays_one_in_a_file(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("COLUMNS", "44")
    print_wrapped(TEXT)
    assert capsys.readouterr().out == f"{TEXT}\n"
