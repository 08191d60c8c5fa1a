"""The fault table: every known fault of a Wombat, thrown at a driving robot on the emulator.

    python benchmarks/faults.py [--only WORD]

One row a fault and firmware, the whole library from the robot's motions down to the bytes: in how many
cycles of 5 ms it was noticed, what became of the mission, and how far the pose was from the true one at the
worst moment at which it was called ok (mm, degrees, and in standard deviations of its own), and at the end.
"""

from __future__ import annotations

import argparse
import signal
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from fault_cases import ALL, CASES, Case, Result, is_as_documented, run
from raccoon.hal.wombat.emulator import Firmware
from raccoon.robot.emulated import SimulatedPlant
from raccoon.sim.effects.parameters import Parameters
from supervised import ROBOT_PROGRAM, SupervisedBench

TITLE = (
    f"{'fault':32}{'firmware':>9}{'cycles':>8}  {'reaction':11}{'ok: mm':>8}{'deg':>6}{'sigma':>7}"
    f"{'end mm':>8} {'status':10} reported"
)


def main() -> int:
    """Print the table; exit status 1 where a row is not as documented."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", default="", help="faults with this word in their name")
    only = parser.parse_args().only
    print(TITLE)
    cases = [case for case in CASES if only in case.name]
    rows = [(case, firmware, run(case, firmware)) for case in cases for firmware in case.firmwares]
    for case, firmware, result in rows:
        print(_row(case, firmware, result))
    wrong = sum(not is_as_documented(case, result) for case, _, result in rows)
    running = sum(result.running for _, _, result in rows)
    for number, name in ((signal.SIGKILL, "program killed (SIGKILL)"), (signal.SIGSTOP, "program hangs")):
        for firmware in ALL if only in name else ():
            seconds = _kill(firmware, number)
            print(f"{name:32}{firmware!s:>9}{'':8}  {'stopped':11} motors off after {seconds:.2f} s")
    print(f"{len(rows)} rows, {wrong} not as documented, {running} with a motor left running")
    return 1 if wrong else 0


def _row(case: Case, firmware: Firmware, result: Result) -> str:
    cycles = "-" if result.detected is None else str(result.detected)
    reported = result.error or ", ".join(sorted(result.faults)) or "-"
    note = "" if is_as_documented(case, result) else "   << NOT AS DOCUMENTED"
    return (
        f"{case.name:32}{firmware!s:>9}{cycles:>8}  {result.reaction:11}{result.good_error_mm:8.1f}"
        f"{result.good_turn_deg:6.1f}{result.good_sigmas:7.1f}{result.end_error_mm:8.1f} "
        f"{result.status:10} {reported[:70]}{note}"
    )


def _kill(firmware: Firmware, number: signal.Signals) -> float:
    """Seconds from the signal to motors without current, in real time."""
    with tempfile.TemporaryDirectory() as folder:
        bench = SupervisedBench(Path(folder), firmware, SimulatedPlant(Parameters()))
        try:
            program = bench.start(program=ROBOT_PROGRAM)
            bench.serve_until(True, patience=20.0)
            program.send_signal(number)
            return bench.serve_until(False, patience=2.0)
        finally:
            bench.close()


if __name__ == "__main__":
    sys.exit(main())
