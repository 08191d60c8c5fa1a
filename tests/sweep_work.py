"""Tiny matches, for tests of sweeps."""

from __future__ import annotations

import os
import signal
import sys
from concurrent.futures import ThreadPoolExecutor

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
