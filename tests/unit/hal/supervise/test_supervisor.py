"""A program that is killed or hangs cannot stop its motors; its supervisor does. Processes are real here."""

import os
import signal
import sys
import termios
from collections.abc import Iterator
from pathlib import Path

import pytest

from raccoon.core.errors import HardwareError
from raccoon.hal.supervise.supervisor import Supervisor
from raccoon.hal.wombat.firmware.stock.commands import frame, stop
from serial_peer import SerialPeer
from supervised import PROGRAM, SupervisedBench


@pytest.fixture(params=["stock", 17, 21])
def bench(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[SupervisedBench]:
    bench = SupervisedBench(tmp_path, request.param)
    yield bench
    bench.close()


@pytest.mark.parametrize(
    ("bench", "number"),
    [
        (17, signal.SIGKILL),
        ("stock", signal.SIGTERM),
        (17, signal.SIGHUP),
        (21, signal.SIGABRT),
    ],
    indirect=["bench"],
)
def test_a_killed_program_stops(bench: SupervisedBench, number: signal.Signals) -> None:
    program = bench.start("100000")
    bench.serve_until(True, patience=20.0)
    program.send_signal(number)
    assert bench.serve_until(False, patience=2.0) < 0.6


def test_a_hanging_program_stops_and_may_come_back(bench: SupervisedBench) -> None:
    program = bench.start("100000")
    bench.serve_until(True, patience=20.0)
    program.send_signal(signal.SIGSTOP)
    assert bench.serve_until(False, patience=2.0) < 0.6
    program.send_signal(signal.SIGCONT)
    bench.serve_until(True, patience=5.0)
    program.send_signal(signal.SIGKILL)
    assert bench.serve_until(False, patience=2.0) < 0.6


def test_a_silent_program_does_not_drop_what_its_servos_hold(bench: SupervisedBench) -> None:
    """It waits for a person or for a slow import; when it is gone, nobody knows how long it would hold."""
    holding, off = (None, 1800, None, None), (None,) * 4
    program = bench.start("100000")
    bench.serve_until_servos(holding, patience=20.0)  # at the end of a slow way there
    program.send_signal(signal.SIGSTOP)
    assert bench.serve_until(False, patience=2.0) < 0.6
    assert bench.emulator.servo_us == holding
    program.send_signal(signal.SIGCONT)
    bench.serve_until(True, patience=5.0)
    assert bench.emulator.servo_us == holding
    program.send_signal(signal.SIGSTOP)
    bench.serve_until(False, patience=2.0)
    program.send_signal(signal.SIGKILL)
    bench.serve_until_servos(off, patience=2.0)


def test_a_process_that_a_program_forks_keeps_nothing_of_the_robot(tmp_path: Path) -> None:
    """One for a camera lives longer than its program, whose end its supervisor must see; another ends at once
    and must stop nothing."""
    begin, loop = PROGRAM.split("for cycle in")
    forks = """
import os, time
if os.fork() == 0:
    os.close(2)
    time.sleep(4.0)
    os._exit(0)
if os.fork() == 0:
    sys.exit(0)
os.wait()
"""
    bench = SupervisedBench(tmp_path, "stock")
    try:
        program = bench.start("100000", program=f"{begin}{forks}for cycle in{loop}")
        bench.serve_until_servos((None, 1800, None, None), patience=20.0)
        program.send_signal(signal.SIGKILL)
        bench.serve_until_servos((None,) * 4, patience=1.0)
    finally:
        bench.close()


@pytest.mark.parametrize(
    ("bench", "arguments"),
    [("stock", ("20",)), (17, ("20", "crash")), (21, ("20",)), (21, ("20", "crash"))],
    indirect=["bench"],
)
def test_a_program_that_ends_stops_its_motors_itself(
    bench: SupervisedBench, arguments: tuple[str, ...]
) -> None:
    program = bench.start(*arguments)
    bench.serve_program(program)
    assert not bench.emulator.motors_running
    assert program.returncode == (1 if "crash" in arguments else 0)


def test_the_supervisor_is_small_and_idle(tmp_path: Path) -> None:
    guard = Supervisor(f"unix:{tmp_path}/nobody", [frame(stop())])
    try:
        assert os.getsid(guard.pid) == guard.pid  # Ctrl-C is not for it
        for _ in range(1000):
            guard.beat()
        status = Path(f"/proc/{guard.pid}/status").read_text().splitlines()
        resident_kb = next(int(line.split()[1]) for line in status if line.startswith("VmRSS"))
        assert resident_kb < 10_000
        fields = Path(f"/proc/{guard.pid}/stat").read_text().rpartition(")")[2].split()
        seconds = (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
        assert seconds <= 0.05  # what starting an interpreter costs, and nothing after that
    finally:
        guard.close()


@pytest.mark.parametrize("stopped", [True, False])
def test_a_supervisor_that_is_let_go_stops_what_its_program_has_not(stopped: bool, tmp_path: Path) -> None:
    """And nothing else: the next program may have the bus by then. Signals to all processes do not end it."""
    peer = SerialPeer(tmp_path / "tty")
    peer.reset_settings()
    try:
        guard = Supervisor(f"tty:{peer.path}:115200", [b"off\n"])
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
            os.kill(guard.pid, number)
        guard.close(stopped=stopped)
        assert peer.heard() == (b"" if stopped else b"off\n" * 5)
        assert peer.speed == (termios.B9600 if stopped else termios.B115200)
    finally:
        peer.unplug()


@pytest.mark.parametrize(
    ("script", "reason"),
    [
        ("#!/bin/sh\nexec sleep 60\n", "did not start: nothing would stop the motors if the program dies"),
        ("#!/bin/sh\nexit 0\n", "did not start"),
        ("#!nowhere\n", "cannot be started: .*No such file"),
    ],
    ids=["hangs", "ends", "no interpreter"],
)
def test_a_supervisor_that_does_not_start_is_an_error(
    script: str, reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    interpreter = tmp_path / "python"
    interpreter.write_text(script)
    interpreter.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(interpreter))
    monkeypatch.setattr("raccoon.hal.supervise.supervisor.START_SECONDS", 0.05)
    with pytest.raises(HardwareError, match=f"the supervisor process {reason}"):
        Supervisor(f"unix:{tmp_path}/nobody", [frame(stop())])


def test_losing_the_supervisor_is_an_error(tmp_path: Path) -> None:
    guard = Supervisor(f"unix:{tmp_path}/nobody", [frame(stop())])
    os.kill(guard.pid, signal.SIGKILL)
    os.waitid(os.P_PID, guard.pid, os.WEXITED | os.WNOWAIT)
    with pytest.raises(HardwareError, match=f"supervisor process {guard.pid} is gone: restart the program"):
        guard.beat()
    guard.close()
    guard.close()


def test_a_supervisor_that_cannot_stop_the_motors_says_so(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    guard = Supervisor(f"unix:{tmp_path}/nobody", [frame(stop())])
    guard.close(stopped=False)
    assert capfd.readouterr().err.startswith("the motors could not be stopped: [Errno 2] No such file")
