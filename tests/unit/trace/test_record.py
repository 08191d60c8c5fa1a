import gzip
import json
import math
import os
from collections.abc import Callable
from dataclasses import replace
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from raccoon.core.config import BumperConfig, Measured, MotorConfig, RobotConfig, TophatConfig
from raccoon.core.readings import SI_WORDS, SIMULATOR, Fault, Inputs, Outputs, Truth
from raccoon.trace.format import read_trace
from raccoon.trace.record import RecordingPort, recording_paths
from unit.trace.recordings import ScriptedPort, command, cycle, record

FULL = cycle(
    3,
    accel=(1, 2, 8192),
    analog=(180, 2930.5, None, 0, 4095, 7),
    digital=(True, False, None) + (None,) * 7,
    faults=(Fault.STALE, Fault.OVERRUN),
    truth=Truth(0.1, -0.2, 7.5, (True, None, False)),
    extra={"motor.0.current": 0.15, "depth": -1e-300},
)


def test_every_field_comes_back_as_it_went_in(tmp_path: Path) -> None:
    outputs = Outputs((0.1, -1.0, 1 / 3, 0.0), (True, False, False, True), (None, 1500, 600, 2400))
    port = RecordingPort(ScriptedPort([FULL]), tmp_path / "run")
    port.read()
    port.write(outputs)
    port.annotate("pose", (0.1, math.inf, -math.inf, 5))
    port.annotate("unknown", (math.nan,))
    port.event("armed: ü\n")
    port.close()
    trace = read_trace(port.path)
    [tick] = trace.ticks
    assert tick.inputs == FULL
    assert tick.commands == (outputs,)
    assert list(tick.estimates["pose"]) == [0.1, math.inf, -math.inf, 5]
    assert math.isnan(tick.estimates["unknown"][0])
    assert [(event.tick, event.text) for event in trace.events] == [(0, "armed: ü\n")]
    assert trace.damage is None


@pytest.mark.parametrize(
    "texts",
    [["x" * 20_000], [5, None], ["[[{" * 3000], ["note"] * 3000, ["\u2603" * 9999] * 200, ["a\nb\0c\ud800"]],
    ids=["long", "no text", "brackets", "many", "much", "odd"],
)
def test_whatever_a_program_remarks_the_rest_of_its_run_is_read_again(
    tmp_path: Path, texts: list[Any]
) -> None:
    port = RecordingPort(ScriptedPort([cycle(0), cycle(1), cycle(2)]), tmp_path / "run")
    for _ in range(3):
        port.read()
        for text in texts:
            port.event(text)
        for number in range(1000):
            port.write(command(number % 500))
    port.close()
    trace = read_trace(port.path)
    assert trace.damage is None
    assert [tick.outputs for tick in trace.ticks] == [command(499)] * 3
    assert {event.tick for event in trace.events} == {0, 1, 2}
    assert trace.events[0].text.startswith(str(texts[0])[:100])


def test_whole_numbers_stay_whole_and_floats_stay_floats(tmp_path: Path) -> None:
    words = (2**62, 3.0, -0.0, None)
    port = RecordingPort(ScriptedPort([cycle(0, position=words)]), tmp_path / "run")
    port.read()
    port.close()
    back = read_trace(port.path).ticks[0].inputs.position
    assert [type(word) for word in back] == [int, float, float, type(None)]
    assert list(back) == list(words)
    assert str(back[2]) == "-0.0"


def test_numpy_scalars_are_written_as_numbers(tmp_path: Path) -> None:
    inputs = cycle(0, position=(np.int64(5), np.float64(0.1), None, None), digital=(np.bool_(True),))
    port = RecordingPort(ScriptedPort([inputs]), tmp_path / "run")
    port.read()
    port.close()
    back = read_trace(port.path).ticks[0].inputs
    assert list(back.position) == [5, 0.1, None, None]
    assert back.digital == (True,)


def test_header_keeps_robot_seed_and_port(tmp_path: Path) -> None:
    fitted = Measured(0.00388, 0.00004, date(2026, 3, 1), 6.7)
    config = RobotConfig(
        "drumbot",
        motors={1: MotorConfig(inverted=True, radians_per_tick=fitted)},
        tophats={"front_left": TophatConfig(2, 0.1, 0.02)},
        bumpers={"back": BumperConfig(4, "back", end=Measured(-0.03))},
    )
    port = RecordingPort(ScriptedPort([]), tmp_path / "run", config=config, seed=11, revision="abc123")
    port.close()
    header = read_trace(port.path).header
    assert header.config == config
    assert (header.port, header.seed, header.revision) == ("ScriptedPort", 11, "abc123")


def test_commands_and_remarks_before_the_first_cycle_are_kept(tmp_path: Path) -> None:
    port = RecordingPort(ScriptedPort([cycle(0)]), tmp_path / "run")
    port.write(command(1))
    port.event("hello")
    port.read()
    port.write(command(2))
    port.write(command(3))
    port.close()
    trace = read_trace(port.path)
    assert trace.opening == (command(1),)
    assert trace.events[0].tick == -1
    assert trace.ticks[0].commands == (command(2), command(3))
    assert trace.ticks[0].outputs == command(3)


def test_what_a_device_says_of_its_back_emf_comes_back(tmp_path: Path) -> None:
    device = replace(SIMULATOR, bemf_lag=0.0128, bemf_dead_zone=40.0, driven_share=0.76, bemf_range=2000.0)
    port = RecordingPort(ScriptedPort([replace(cycle(0), device=device)]), tmp_path / "run")
    port.read()
    port.close()
    assert read_trace(port.path).ticks[0].inputs.device == device


def test_device_is_written_when_it_changes(tmp_path: Path) -> None:
    other = Inputs(1.0, SI_WORDS, battery=6.6)
    port = RecordingPort(ScriptedPort([cycle(0), cycle(1), other]), tmp_path / "run")
    for _ in range(3):
        port.read()
    port.close()
    ticks = read_trace(port.path).ticks
    assert [tick.inputs.device for tick in ticks] == [SIMULATOR, SIMULATOR, SI_WORDS]
    assert gzip.decompress(port.path.read_bytes()).count(b'"device"') == 2


def test_wrapped_port_is_passed_through_and_closed_once_per_close(tmp_path: Path) -> None:
    inner = ScriptedPort([cycle(0)])
    port = RecordingPort(inner, tmp_path / "run")
    assert port.read() == cycle(0)
    port.write(command(5))
    with pytest.raises(EOFError):
        port.read()
    port.close()
    port.close()
    assert inner.commands == [command(5)]
    assert inner.closed == 2
    assert read_trace(port.path).events[0].text == "read: EOFError: the script has ended"


def test_motors_are_off_before_the_file_is_finished_even_if_closing_fails(tmp_path: Path) -> None:
    class Stuck(ScriptedPort):
        def close(self) -> None:
            raise OSError("lost")

    port = RecordingPort(Stuck([cycle(0)]), tmp_path / "run")
    port.read()
    with pytest.raises(OSError, match="lost"):
        port.close()
    assert len(read_trace(port.path).ticks) == 1


def test_plain_file_grows_and_the_packed_one_replaces_it(tmp_path: Path) -> None:
    port = RecordingPort(ScriptedPort([]), tmp_path / "deep" / "run.jsonl")
    plain, packed = recording_paths(tmp_path / "deep" / "run.jsonl.gz")
    assert plain.exists()
    assert not packed.exists()
    port.close()
    assert [each.name for each in plain.parent.iterdir()] == ["run.jsonl.gz"]
    assert packed == port.path


def test_it_ends_where_it_began_though_the_program_changed_the_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    port = RecordingPort(ScriptedPort([FULL]), "run")
    port.read()
    monkeypatch.chdir("/")
    port.close()
    assert port.failure is None
    assert [each.name for each in tmp_path.iterdir()] == ["run.jsonl.gz"]


def test_equal_runs_give_equal_bytes(tmp_path: Path) -> None:
    assert record(tmp_path / "a").read_bytes() == record(tmp_path / "b").read_bytes()


def test_a_recording_at_home_is_there_and_not_in_a_folder_of_that_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.chdir(tmp_path)
    port = RecordingPort(ScriptedPort([cycle(0)]), "~/runs/run")
    port.read()
    port.close()
    assert [each.name for each in tmp_path.iterdir()] == ["runs"]
    assert len(read_trace("~/runs/run").ticks) == 1
    assert recording_paths("~nobody-of-this-name/run")[0] == Path("~nobody-of-this-name/run.jsonl")


def test_existing_recording_is_not_overwritten_unasked(tmp_path: Path) -> None:
    path = record(tmp_path / "run")
    before = path.read_bytes()
    with pytest.raises(FileExistsError, match="overwrite=True"):
        RecordingPort(ScriptedPort([]), path)
    assert path.read_bytes() == before
    RecordingPort(ScriptedPort([]), path, overwrite=True).close()
    assert read_trace(path).ticks == []


def test_a_recording_that_is_not_needed_takes_the_next_free_name(tmp_path: Path) -> None:
    kept = record(tmp_path / "run").read_bytes()
    (tmp_path / "run-2.jsonl").write_text("of a program that was killed")
    for number in (3, 4):
        port = RecordingPort(ScriptedPort([cycle(0)]), tmp_path / "run.jsonl.gz", needed=False)
        port.read()
        port.close()
        assert port.path == tmp_path / f"run-{number}.jsonl.gz"
        assert len(read_trace(port.path).ticks) == 1
    assert (tmp_path / "run.jsonl.gz").read_bytes() == kept
    assert (tmp_path / "run-2.jsonl").read_text() == "of a program that was killed"


def test_two_programs_that_begin_at_once_do_not_share_a_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "run.jsonl").touch()
    monkeypatch.setattr(Path, "exists", lambda _path: False)  # the other one came after the look
    port = RecordingPort(ScriptedPort([]), tmp_path / "run", needed=False)
    port.close()
    assert port.path.name == "run-2.jsonl.gz"
    with pytest.raises(FileExistsError):
        RecordingPort(ScriptedPort([]), tmp_path / "run")


def no_folder(folder: Path, _patch: pytest.MonkeyPatch) -> Path:
    """A file lies where the folder of the recording should be."""
    (folder / "file").touch()
    return folder / "file" / "run"


def full_at_once(folder: Path, patch: pytest.MonkeyPatch) -> Path:
    """The disk is full before the header is written."""

    def full(_descriptor: int, _data: bytes) -> None:
        raise OSError(28, "No space left on device")

    patch.setattr("raccoon.trace.writer._write_all", full)
    return folder / "run"


@pytest.mark.parametrize("broken", [no_folder, full_at_once])
def test_a_recording_that_cannot_begin_does_not_stop_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, broken: Callable[[Path, pytest.MonkeyPatch], Path]
) -> None:
    inner = ScriptedPort([cycle(0)])
    path = broken(tmp_path, monkeypatch)
    with pytest.raises(OSError, match=r"exists|directory|space"):
        RecordingPort(inner, path)
    with pytest.warns(
        RuntimeWarning, match=r"run is not recorded, the run goes on: .*(exists|directory|space)"
    ):
        port = RecordingPort(inner, path, needed=False)
    assert port.read() == cycle(0)
    port.annotate("pose", (0.0,))
    port.write(command(1))
    port.event("driven")
    port.close()
    assert port.failure is not None
    assert inner.commands == [command(1)]
    assert inner.closed == 1
    assert not list(tmp_path.glob("run*"))


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"battery": math.nan}, "battery is nan"),
        ({"bemf": (math.inf, 1, 2, 3)}, r"bemf is \(inf"),
        ({"extra": {"depth": math.nan}}, "extra is"),
    ],
)
def test_a_reading_that_is_no_number_ends_the_recording_not_the_run(
    tmp_path: Path, change: dict[str, object], field: str
) -> None:
    inner = ScriptedPort([cycle(0), cycle(1, **change), cycle(2)])
    port = RecordingPort(inner, tmp_path / "run")
    for number in range(3):
        port.read()
        port.write(command(number))
    with pytest.warns(RuntimeWarning, match=f"ends early: .*{field}"):
        port.close()
    assert len(inner.commands) == 3
    trace = read_trace(port.path)
    assert len(trace.ticks) == 1
    assert "t = 0.005" in str(trace.damage)


def test_an_estimate_that_no_float_holds_ends_the_recording_and_is_said(tmp_path: Path) -> None:
    port = RecordingPort(ScriptedPort([cycle(0), cycle(1)]), tmp_path / "run")
    port.read()
    port.read()
    port.annotate("odd", (10**400, math.nan))
    with pytest.warns(RuntimeWarning, match=r"ends early: .*too large"):
        port.close()
    assert "too large" in str(read_trace(port.path).damage)


def full(_descriptor: int, _data: bytes) -> None:
    raise OSError(28, "No space left on device")


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [("_write_all", full, "No space left"), ("WAITING_LIMIT", 0, "did not keep up: 0 cycles were waiting")],
    ids=["full", "stalled"],
)
def test_a_disk_that_is_full_or_stalls_ends_the_recording_not_the_run(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str, value: object, said: str
) -> None:
    inner = ScriptedPort([cycle(0), cycle(1)])
    port = RecordingPort(inner, tmp_path / "run")
    monkeypatch.setattr(f"raccoon.trace.writer.{name}", value)
    for number in range(2):
        port.read()
        port.write(command(number))
    with pytest.warns(RuntimeWarning, match=f"ends early: .*{said}"):
        port.close()
    assert len(inner.commands) == 2
    assert inner.closed == 1


def test_a_recording_that_cannot_be_packed_is_told_by_the_name_it_has(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_plain: Path, _packed: Path) -> None:
        raise OSError(28, "No space left on device")

    port = RecordingPort(ScriptedPort([cycle(0)]), tmp_path / "run")
    monkeypatch.setattr("raccoon.trace.writer.pack", full)
    port.read()
    with pytest.warns(RuntimeWarning, match=r"run\.jsonl ends early: .*No space left"):
        port.close()
    assert len(read_trace(tmp_path / "run.jsonl").ticks) == 1


def test_a_forked_process_does_not_finish_the_file_of_its_parent(tmp_path: Path) -> None:
    port = RecordingPort(ScriptedPort([cycle(0), cycle(1)]), tmp_path / "run")
    port.read()
    child = os.fork()
    if child == 0:  # pragma: no cover - in the child
        port.close()
        os._exit(0)
    os.waitpid(child, 0)
    port.read()
    port.close()
    trace = read_trace(port.path)
    assert trace.damage is None
    assert len(trace.ticks) == 2


def test_what_was_written_survives_a_kill(tmp_path: Path) -> None:
    """Each cycle reaches the operating system when the next one is read, whatever becomes of the process."""
    port = RecordingPort(ScriptedPort(cycle(number) for number in range(200)), tmp_path / "run")
    for _ in range(200):
        port.read()
    plain, _ = recording_paths(tmp_path / "run")
    while len(read_trace(plain).ticks) < 199:
        pass  # the test's own time limit ends a writer that does not write
    assert "not closed" in str(read_trace(plain).damage)
    port.close()


def test_lines_are_plain_json_without_blanks(tmp_path: Path) -> None:
    lines = gzip.decompress(record(tmp_path / "run").read_bytes()).splitlines()
    first = json.loads(lines[2])
    assert set(first) == {"t", "bemf", "position", "gyro", "battery", "duty", "est"}
    assert json.loads(lines[-1]) == {"end": 5, "failure": None}
