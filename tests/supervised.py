"""Robot programs in processes of their own on an emulated Wombat behind a socket, to be killed."""

from __future__ import annotations

import os
import select
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

from bench_robot import BenchRobot
from children import default_signals
from raccoon.core.clock import SteppedClock
from raccoon.hal.wombat.emulator import Emulator, Firmware, Plant
from socket_link import serve_one

PROGRAM = """
import sys
from raccoon.core.readings import Outputs
from raccoon.hal.wombat.port import WombatPort
from raccoon.hal.wombat.probe import probe
from raccoon.core.clock import RealClock
from raccoon.hal.supervise.supervisor import Supervisor
from socket_link import SocketLink

link = SocketLink(sys.argv[1])
dialect = probe(link, RealClock())
guard = Supervisor("unix:" + sys.argv[1], [dialect.stop()])
port = WombatPort(link, dialect=dialect, guard=guard)
for cycle in range(int(sys.argv[2])):
    port.read()
    port.write(Outputs((0.5, -0.5, 0.0, 0.0), servo_us=(None, 1000 + min(20 * cycle, 800), None, None)))
if len(sys.argv) > 3:
    raise RuntimeError("a bug in the robot program")
"""

ROBOT_PROGRAM = (
    PROGRAM.partition("for cycle in")[0]
    + """
from raccoon.core.config import RobotConfig
from raccoon.robot.motions.goals import straight
from raccoon.robot.opening import open_robot

with open_robot(RobotConfig(), port=port) as robot:
    robot.run(straight(10.0))
"""
)
"""The whole library on top: motions, odometry and wheel loops."""


LONGEST_STEP = 0.02
"""s that the firmware runs at the most each time it is served: on a busy machine it slows down.
If it caught up with the clock on the wall, being late would make it later, and the programs lose it."""


class SupervisedBench:
    """An emulated Wombat behind a socket, and programs that drive it. Its times are those of the firmware."""

    def __init__(self, folder: Path, firmware: Firmware, plant: Plant | None = None) -> None:
        self._clock, self._served = SteppedClock(), time.monotonic()
        self.emulator = Emulator(plant or BenchRobot(), firmware, clock=self._clock)
        self.path = str(folder / "wombat")
        self._listener = socket.socket(socket.AF_UNIX)
        self._listener.bind(self.path)
        self._listener.listen()
        self._connections: list[socket.socket] = []
        self.programs: list[subprocess.Popen[bytes]] = []

    def start(self, *arguments: str, program: str = PROGRAM) -> subprocess.Popen[bytes]:
        """Start a program: PROGRAM with the number of its cycles, or ROBOT_PROGRAM."""
        with default_signals(signal.SIGHUP, signal.SIGINT):
            started = subprocess.Popen(
                [sys.executable, "-c", program, self.path, *arguments],
                stderr=subprocess.PIPE,
                env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
            )
        self.programs.append(started)
        return started

    def serve(self, seconds: float) -> None:
        """Answer whoever asks within this time, then let the firmware catch up."""
        ready, _, _ = select.select([self._listener, *self._connections], [], [], seconds)
        now = time.monotonic()
        self._clock.advance(min(now - self._served, LONGEST_STEP))
        self._served = now
        for each in ready:
            if each is self._listener:
                self._connections.append(self._listener.accept()[0])
            elif not serve_one(each, self.emulator):
                self._connections.remove(each)
                each.close()
        self.emulator.run()

    def serve_until(self, running: bool, patience: float) -> float:
        """Serve until the motors run or stand; returns the seconds it took, fails where it takes longer."""
        start = self._clock.now()
        while self.emulator.motors_running is not running:
            waited = self._clock.now() - start
            assert waited < patience, f"motors_running is still {not running} after {waited:.2f} s"
            self.serve(0.01)
        return self._clock.now() - start

    def serve_until_servos(self, pulses: tuple[int | None, ...], patience: float) -> None:
        """Serve until the servos are commanded like this; fails where it takes longer."""
        deadline = self._clock.now() + patience
        while self.emulator.servo_us != pulses:
            assert self._clock.now() < deadline, f"servos are at {self.emulator.servo_us}, not {pulses}"
            self.serve(0.01)

    def serve_program(self, program: subprocess.Popen[bytes]) -> None:
        deadline = self._clock.now() + 20.0
        while program.poll() is None:
            assert self._clock.now() < deadline
            self.serve(0.01)

    def close(self) -> None:
        for each in (*self._connections, self._listener):
            each.close()
        for program in self.programs:
            program.kill()
            program.communicate()
