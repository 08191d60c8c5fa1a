from dataclasses import replace
from pathlib import Path

import pytest

from raccoon.core.errors import ReplayDiverged
from raccoon.core.port import Port
from raccoon.core.readings import Outputs
from raccoon.trace.format import Damage, Trace, read_trace
from raccoon.trace.replay import ReplayPort
from unit.trace.recordings import command, cycle, record


@pytest.fixture
def trace(tmp_path: Path) -> Trace:
    return read_trace(record(tmp_path / "run"))


def test_the_same_program_gets_the_same_cycles_and_then_the_end(trace: Trace) -> None:
    port = ReplayPort(trace)
    for number in range(5):
        assert port.read() == cycle(number)
        port.write(command(number))
        port.annotate("pose", (number / 3, number / 7, 0.1 + 0.2))
    with pytest.raises(EOFError, match="ended after 5 cycles"):
        port.read()
    port.close()
    port.close()


def test_it_is_a_port_and_opens_a_path(tmp_path: Path) -> None:
    port = ReplayPort(record(tmp_path / "run"))
    assert isinstance(port, Port)
    assert port.read() == cycle(0)


@pytest.mark.parametrize(
    ("changed", "field"),
    [
        (Outputs(duty=(1 / 700 + 1e-16, -1 / 900, 0.0, 0.0)), "motor.0.duty"),
        (Outputs(duty=(1 / 700, -1 / 901, 0.0, 0.0)), "motor.1.duty"),
        (Outputs(duty=(1 / 700, -1 / 900, 0.0, 0.1)), "motor.3.duty"),
        (replace(command(1), brake=(False, False, True, False)), "motor.2.brake"),
        (replace(command(1), servo_us=(None, 1500, None, None)), "servo.1.pulse_us"),
    ],
)
def test_a_changed_command_is_named(trace: Trace, changed: Outputs, field: str) -> None:
    port = ReplayPort(trace)
    port.read()
    port.write(command(0))
    port.read()
    with pytest.raises(ReplayDiverged, match=field.replace(".", r"\.")) as caught:
        port.write(changed)
    assert (caught.value.tick, caught.value.field) == (1, field)


def test_a_missing_and_a_further_command_diverge(trace: Trace) -> None:
    port = ReplayPort(trace)
    port.read()
    with pytest.raises(ReplayDiverged, match="tick 0: command"):
        port.read()
    port = ReplayPort(trace)
    port.read()
    port.write(command(0))
    with pytest.raises(ReplayDiverged, match="command was None"):
        port.write(command(0))


def test_a_command_before_the_first_cycle_is_compared_too(trace: Trace) -> None:
    with pytest.raises(ReplayDiverged, match="tick -1"):
        ReplayPort(trace).write(command(0))
    trace.opening = (command(3),)
    port = ReplayPort(trace)
    port.write(command(3))
    port.read()


def test_a_run_stopped_between_reading_and_writing_does_not_diverge(trace: Trace) -> None:
    trace.ticks[-1] = replace(trace.ticks[-1], commands=())
    port = ReplayPort(trace)
    for number in range(5):
        port.read()
        port.write(command(number))
    with pytest.raises(EOFError):
        port.read()


def test_a_changed_estimate_is_named(trace: Trace) -> None:
    port = ReplayPort(trace)
    port.read()
    with pytest.raises(ReplayDiverged, match=r"pose\[2\]"):
        port.annotate("pose", (0.0, 0.0, 0.3))
    with pytest.raises(ReplayDiverged, match=r"pose\[3\] was None"):
        port.annotate("pose", (0.0, 0.0, 0.1 + 0.2, 1.0))
    with pytest.raises(ReplayDiverged, match="speed was None"):
        port.annotate("speed", (0.0,))


def test_tolerance_forgives_last_bits_and_no_more(trace: Trace) -> None:
    port = ReplayPort(trace, tolerance=1e-9)
    port.read()
    port.annotate("pose", (0.0, 0.0, 0.3))
    with pytest.raises(ReplayDiverged):
        port.annotate("pose", (0.0, 0.0, 0.3000001))
    with pytest.raises(ValueError, match="tolerance is -1"):
        ReplayPort(trace, tolerance=-1)


def test_without_check_any_program_may_run(trace: Trace) -> None:
    port = ReplayPort(trace, check=False)
    port.read()
    port.write(command(99))
    port.annotate("speed", (5.0,))
    port.event("whatever")
    port.read()
    port.read()


def test_the_end_of_a_damaged_recording_says_so(trace: Trace) -> None:
    trace.damage = Damage(9, 5, "the file is cut off in this line")
    port = ReplayPort(trace, check=False)
    for _ in range(5):
        port.read()
    with pytest.raises(EOFError, match="damaged after 5 cycles"):
        port.read()
