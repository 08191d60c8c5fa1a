"""How much memory one diagnosis takes: half of a Raspberry Pi 3's at most (docs/diagnosis.md)."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

TESTS = Path(__file__).resolve().parents[3]
WHOLE, GROWTH = 512, 5.5
"""MB of a whole process in which 40 s are diagnosed, and MB of each second of a drive."""
SHORT, LONG = 4.0, 20.0
"""s of two drives: what is remembered of each row grows with their number."""
PROGRAM = f"""
from raccoon.core.config import RobotConfig
from raccoon.diagnose.diagnosis import diagnose
from raccoon.sim.effects.parameters import Parameters
from simulated_drives import record_simulated_drive

def peak():
    # Of this program alone: what getrusage says may be that of the process it was started from.
    with open("/proc/self/status") as file:
        return next(int(line.split()[1]) // 1024 for line in file if line.startswith("VmHWM"))

robot = RobotConfig()
for seconds in ({SHORT}, {LONG}):
    found = diagnose(record_simulated_drive(Parameters.from_robot(robot), seconds), robot)
    print(peak(), found.verdict.value)
"""


def measured() -> subprocess.CompletedProcess[str]:
    places = os.pathsep.join([str(TESTS), *(each for each in sys.path if each)])
    return subprocess.run(
        [sys.executable, "-c", PROGRAM],
        env=os.environ | {"PYTHONPATH": places, "OPENBLAS_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
    )


def test_a_diagnosis_of_40_s_would_take_half_of_a_small_controllers_memory() -> None:
    """The first drive loads what it needs; what is left between the two is the longer one's."""
    ran = measured()
    if "compiling" in ran.stderr:  # the first time only; the compiler alone takes 350 MB
        ran = measured()
    assert ran.returncode == 0, ran.stderr
    short, long = (line.split() for line in ran.stdout.splitlines())
    assert long[1] == "adequate"
    growth = (int(long[0]) - int(short[0])) / (LONG - SHORT)
    assert growth < GROWTH
    assert int(long[0]) + (40.0 - LONG) * growth < WHOLE
