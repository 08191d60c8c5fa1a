"""The fault table: every known fault of a Wombat, thrown at a driving robot on the emulator.

    python benchmarks/faults.py

One row a fault and firmware: in how many cycles of 5 ms it was noticed, what became of the run, the worst
error of the pose while nothing was reported yet, and the error at the end (which was then reported).
"""

from __future__ import annotations

import signal
import sys
import tempfile
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from fault_cases import ALL, CASES, run
from supervised import SupervisedBench


def main() -> int:
    """Print the table; exit status 1 where a row is not as documented."""
    print(f"{'fault':32}{'firmware':>9}{'cycles':>8}  {'reaction':11}{'good mm':>8}{'end mm':>8}  reported")
    wrong = 0
    for case in CASES:
        for firmware in case.firmwares:
            result = run(case, firmware)
            cycles = "-" if result.detected is None else str(result.detected)
            reported = result.error or ", ".join(sorted(result.faults)) or "-"
            as_documented = result.reaction == case.reaction and not result.running
            wrong += not as_documented
            print(
                f"{case.name:32}{firmware!s:>9}{cycles:>8}  {result.reaction:11}"
                f"{result.good_error_mm:8.1f}{result.end_error_mm:8.1f}  {reported[:70]}"
                f"{'' if as_documented else '   << NOT AS DOCUMENTED'}"
            )
    for firmware in ALL:
        for name, number in (("program killed (SIGKILL)", signal.SIGKILL), ("program hangs", signal.SIGSTOP)):
            seconds = _kill(firmware, number)
            print(f"{name:32}{firmware!s:>9}{'':8}  {'stopped':11}  motors off after {seconds:.2f} s")
    return 1 if wrong else 0


def _kill(firmware: object, number: signal.Signals) -> float:
    """Seconds from the signal to motors without current, in real time."""
    with tempfile.TemporaryDirectory() as folder:
        bench = SupervisedBench(Path(folder), firmware)  # type: ignore[arg-type]
        try:
            program = bench.start("100000")
            bench.serve_until(True, patience=20.0)
            program.send_signal(number)
            return bench.serve_until(False, patience=2.0)
        finally:
            bench.close()


if __name__ == "__main__":
    sys.exit(main())
