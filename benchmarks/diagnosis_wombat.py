"""How well a Wombat's recordings are diagnosed: `python benchmarks/diagnosis_wombat.py`.

The simulated robot stands behind the emulated firmware, bytes, pauses, filters and clock, is driven and
recorded as a team does it, and diagnosed from that recording alone. Its numbers are drawn within robot.toml's
standard deviations; one cause of robot or battery is hidden in each, or none. (What the firmware and the
board do to the readings is the emulator's, so no cause of these is hidden.)

For each firmware: clean robots with a name, and hidden causes named first, wrongly and alone; the CPU time.
With --as-csv the recording forgets what it is of, as one in the exchange format does.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
import zlib
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, cast

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import numpy as np

from blind.drives import exciting
from blind.hidden import CAUSES, Hidden, draw
from emulated_drives import record_emulated_drive
from raccoon.core.config import Measured, RobotConfig
from raccoon.core.readings import SI_WORDS
from raccoon.diagnose.recordings.diagnosis import diagnose_recording
from raccoon.diagnose.result import Diagnosis
from raccoon.hal.wombat.emulator import Firmware
from raccoon.sim.effects.parameters import Parameters

OF_THE_ROBOT = tuple(
    each for each in CAUSES if each.startswith(("battery.", "motor.", "friction.", "drive."))
)
CLEAN = "none"
SPREAD = 0.7
"""Part of robot.toml's standard deviations by which its numbers scatter."""
FIRMWARES: dict[str, Firmware] = {"stock": "stock", "17": 17, "21": 21}


def main() -> None:
    """A line for each recording, then a row for each firmware."""
    args = _arguments()
    seed = args.seed if args.seed is not None else int(np.random.default_rng().integers(2**31))
    kinds = [*OF_THE_ROBOT, *[CLEAN] * args.clean]
    print(f"seed {seed}", flush=True)
    rows = []
    for name in args.firmware:
        said = [
            _one(f"{name}/{kind}/{index}", FIRMWARES[name], kind, seed, args.seconds, args.as_csv)
            for index, kind in enumerate(kinds)
        ]
        rows.append(_row(name, said))
    titles = ("firmware", "clean with a name", "first", "wrong", "alone", "CPU, median / p90")
    print(f"\n| {' | '.join(titles)} |\n|{'---|' * len(titles)}")
    print("\n".join(rows))


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--firmware", nargs="+", choices=FIRMWARES, default=list(FIRMWARES))
    parser.add_argument("--clean", type=int, default=10, help="robots without a cause")
    parser.add_argument("--seconds", type=float, default=30.0, help="of driving")
    parser.add_argument("--seed", type=int, default=None)
    parser.add_argument("--as-csv", action="store_true", help="without the name of the firmware")
    return parser.parse_args()


def _one(key: str, firmware: Firmware, kind: str, seed: int, seconds: float, as_csv: bool) -> dict[str, Any]:
    rng = np.random.default_rng([seed, zlib.crc32(key.encode())])
    hidden = None if kind == CLEAN else draw(kind, rng)
    recording = record_emulated_drive(
        firmware, _robot(hidden, rng), exciting(rng, seconds), int(rng.integers(2**31))
    )
    begin = time.process_time()
    said = diagnose_recording(
        recording.columns, RobotConfig(), device=SI_WORDS if as_csv else recording.device
    )
    result = {"hidden": hidden, "said": said, "seconds": time.process_time() - begin}
    named = ", ".join(_numbers(said)) or "-"
    what = "nothing" if hidden is None else f"{hidden.name} {_rounded(hidden.values)}"
    print(f"{key:36s} {what} -> {said.verdict}: {named}  {result['seconds']:.1f} s", flush=True)
    return result


def _numbers(said: Diagnosis) -> list[str]:
    return [
        f"{each.name} {_rounded({key: number.value for key, number in each.parameters.items()})}"
        f"{' or ' + ', '.join(each.confounded_with) if each.confounded_with else ''}"
        for each in said.causes
    ]


def _rounded(values: Any) -> dict[str, float]:
    return {key: float(f"{value:.3g}") for key, value in values.items()}


def _robot(hidden: Hidden | None, rng: np.random.Generator) -> Parameters:
    """A robot within robot.toml's standard deviations, and what is hidden in it."""
    robot = RobotConfig()
    sections = {each.name: _scattered(getattr(robot.model, each.name), rng) for each in fields(robot.model)}
    parameters = Parameters.from_robot(replace(robot, model=replace(robot.model, **sections)))
    if hidden is None:
        return parameters
    return parameters.with_effect(hidden.id, hidden.where, **hidden.values)


def _scattered(section: Any, rng: np.random.Generator) -> Any:
    changed: dict[str, Measured] = {}
    for each in fields(section):
        number = cast(Measured, getattr(section, each.name))
        moved = number.value + SPREAD * number.std * float(rng.standard_normal())
        changed[each.name] = replace(number, value=moved)
    return replace(section, **changed)


def _row(name: str, results: list[dict[str, Any]]) -> str:
    clean = [each["said"] for each in results if each["hidden"] is None]
    faulty = [each for each in results if each["hidden"] is not None]
    first = [bool(each["said"].causes) and _hit(each, 0) for each in faulty]
    wrong = [not all(_hit(each, index) for index in range(len(each["said"].causes))) for each in faulty]
    alone = [flag and len(each["said"].causes) == 1 for flag, each in zip(first, faulty, strict=True)]
    middle, high = np.quantile([each["seconds"] for each in results], [0.5, 0.9])
    named = sum(bool(each.causes) for each in clean)
    counts = " | ".join(f"{sum(flags)} of {len(faulty)}" for flags in (first, wrong, alone))
    return f"| {name} | {named} of {len(clean)} | {counts} | {middle:.1f} / {high:.1f} s |"


def _hit(result: dict[str, Any], index: int) -> bool:
    cause = result["said"].causes[index]
    return result["hidden"].name in (cause.name, *cause.confounded_with)


if __name__ == "__main__":
    main()
