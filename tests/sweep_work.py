"""What the tests of sweeps let workers do: tiny matches, and calls that take their process down."""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from raccoon.core.config import RobotConfig
from raccoon.sweep.factors import Factor
from raccoon.sweep.match import Match
from raccoon.sweep.program import Program
from raccoon.sweep.runs import sweep

PROGRAM = """
from raccoon import after_time, drive

def mission(robot):
    robot.run(drive(0.2).until(after_time(0.1)))
"""
BATTERY = Factor("battery.open_circuit_voltage", "voltage", 5.0, 8.0)


def tiny_match(text: str = PROGRAM) -> Match:
    """0.6 s on a robot whose battery differs."""
    return Match(Program("tiny.py", text, "/nonexistent"), RobotConfig(), (BATTERY,), seconds=5.0)


def squared(number: int) -> int:
    return number * number


def kills_its_worker_once(marks: str, number: int) -> int:
    """The square; but the first call with 3 kills its process."""
    mark = Path(marks) / "killed"
    if number == 3 and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return squared(number)


def always_kills_its_worker(number: int) -> int:
    """The square; but every call with 2 kills its process."""
    if number == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    return squared(number)


def sleeps_for_long(mark: str) -> None:
    """Longer than anybody waits; `mark` is there once it has begun."""
    Path(mark).touch()
    time.sleep(60.0)


def leaves_a_thread(number: int) -> int:
    """The number; what it began goes on for longer than anybody waits."""
    threading.Thread(target=time.sleep, args=(60.0,)).start()
    return number


def main() -> None:
    """Begin a sweep of 8 matches and be killed after 3."""
    (out,) = sys.argv[1:]

    def leave(played: int, _total: int, _failed: int) -> None:
        if played == 3:
            os.kill(os.getpid(), signal.SIGKILL)

    with ThreadPoolExecutor(1) as threads:
        sweep(tiny_match(), 8, seed=4, executor=threads, out=out, progress=leave)


if __name__ == "__main__":
    main()
