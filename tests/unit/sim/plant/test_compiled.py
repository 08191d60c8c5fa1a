"""The plant is compiled once, and it is said where that is awaited."""

import logging
from pathlib import Path

import pytest

from raccoon.sim.plant import compiled
from raccoon.sim.plant.lanes import KINDS

numba = pytest.importorskip("numba")

TEXT = "def advance_cells(x):\n    return 2 * x\n"
"""Compiled in a moment."""


def said(caplog: pytest.LogCaptureFixture) -> list[str]:
    """What a new process would say, that calls the function of TEXT twice."""
    caplog.clear()
    function = compiled.announced(compiled.compiled_module(TEXT).advance_cells, "a test", logging.INFO)
    assert (function(2), function(3)) == (4, 6)
    return caplog.messages


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> Path:
    folder = tmp_path / "cache"
    monkeypatch.setenv("RACCOON_CACHE", str(folder))
    caplog.set_level("DEBUG")  # as a program may, which does not ask for what numba logs then
    caplog.set_level("NOTSET", "numba")
    return folder


def test_that_it_is_compiled_is_said_the_first_time_only(caplog: pytest.LogCaptureFixture) -> None:
    assert said(caplog) == ["compiling a test, the first time only"]
    assert said(caplog) == []


def test_also_where_numba_has_a_cache_of_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(numba.core.config, "CACHE_DIR", str(tmp_path / "other"))
    assert said(caplog) == ["compiling a test, the first time only"]
    assert said(caplog) == []


def test_where_nothing_can_be_kept_it_is_said_each_time_and_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "file").touch()
    folder = tmp_path / "file" / "cache"
    monkeypatch.setenv("RACCOON_CACHE", str(folder))
    for _ in range(2):
        assert said(caplog) == [
            f"compiling a test, each time: nothing can be written in {folder} "
            "(the variable RACCOON_CACHE names another folder)"
        ]


def test_where_the_text_can_be_read_and_nothing_written_beside_it(
    cache: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    cache.mkdir()
    (cache / "__pycache__").touch()  # where a folder would be made
    monkeypatch.setenv("XDG_CACHE_HOME", str(cache / "__pycache__"))
    assert [message.split(":")[0] for message in said(caplog)] == ["compiling a test, each time"]


@pytest.mark.parametrize("kind", KINDS)
def test_lanes_say_of_which_kind_they_are(kind: str, caplog: pytest.LogCaptureFixture) -> None:
    from numba.core import event

    compiled._made.cache_clear()
    compiled.advance_lanes.cache_clear()
    function = compiled.advance_lanes(kind)
    assert not caplog.messages
    event.broadcast(event.Event("numba:compile", event.EventStatus.START, {"dispatcher": function}))
    compiled._made.cache_clear()
    compiled.advance_lanes.cache_clear()
    assert caplog.messages == [f"compiling the simulator of {kind}, the first time only"]


def test_what_only_compiled_functions_call_is_not_made_for_python() -> None:
    """That took a third of the time in which whoever starts the simulator first waits."""
    both = TEXT.replace("advance_cells", "twice") + TEXT.replace("2 * x", "twice(x)")
    module = compiled.compiled_module(both)
    assert module.advance_cells(2) == 4
    for function, of_python in ((module.twice, False), (module.advance_cells, True)):
        (made,) = function.overloads.values()
        names = {each.name for each in made.library.get_defined_functions()}
        assert (made.fndesc.llvm_cpython_wrapper_name in names) == of_python


def test_texts_share_only_functions_that_call_the_same() -> None:
    """Most of a text is that of other robots, and takes most of the time of compiling."""
    text = "def many(x):\n    return 2 * x\n\n\ndef more(x):\n    return many(x) + 1\n\n\n"
    text += "def same(x):\n    return x\n\n\ndef advance_cells(x):\n    return same(more(x))\n"
    twice, thrice = (compiled.compiled_module(each) for each in (text, text.replace("2 * x", "3 * x")))
    assert (twice.advance_cells(2), thrice.advance_cells(2)) == (5, 7)
    assert twice.same is thrice.same
    assert twice.more is not thrice.more
