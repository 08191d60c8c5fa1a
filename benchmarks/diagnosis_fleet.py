"""What many recordings of one robot say together: `python benchmarks/diagnosis_fleet.py`.

The independent plant as one robot over some days, one drive a day: nothing is wrong; something is all the
time; a battery ages; a motor is replaced; a battery ages, is replaced and ages again; something is wrong on
one day. Each fleet also gives the model that the days have in common, which must foresee each day from the
others. Seeds are fresh in every run, and printed, unless one is given. Exit status 1 where something is
missed.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
from collections.abc import Callable, Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

import numpy as np

from blind.generator import make
from blind.hidden import CAUSES, Hidden, draw
from blind.plant import NEUTRAL
from options import comma_separated
from raccoon.core.config import RobotConfig
from raccoon.diagnose.diagnosis import diagnose
from raccoon.diagnose.fleet.change_points import Piece
from raccoon.diagnose.fleet.common_model import CrossCheck, common_model, make_cross_check
from raccoon.diagnose.fleet.summary import Fleet, fleet_of
from raccoon.diagnose.result import Diagnosis
from raccoon.sim.effects.parameters import Parameters

LASTING = (
    "motor.back_emf_constant", "motor.armature_resistance", "friction.stiction", "friction.quadratic",
    "drive.backlash", "drive.inertia", "actuation.deadband", "bemf.scale", "imu.latency",
)  # fmt: skip
"""What is hidden for all days: what a robot has, and no table."""
BATTERY, MOTOR = "battery.internal_resistance", "motor.back_emf_constant@left"


@dataclass(frozen=True)
class Week:
    """A robot's days: what is hidden on each, what must be common, what must change (the days of jumps, and
    whether it creeps), and what one day alone has."""

    hidden: list[list[Hidden]]
    common: tuple[str, ...] = ()
    changes: Mapping[str, tuple[tuple[int, ...], bool]] | None = None
    once: str = ""


def main() -> int:
    """A line for each fleet, then what they were worth together."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--trials", type=int, default=1, help="fleets of each kind")
    parser.add_argument("--days", type=int, default=8)
    parser.add_argument("--seconds", type=float, default=25.0)
    parser.add_argument("--seed", type=int, default=None)
    parser.add_argument("--kinds", type=comma_separated(KINDS), default=list(KINDS))
    parser.add_argument("--processes", type=int, default=1)
    args = parser.parse_args()
    seed = int(np.random.default_rng().integers(2**31)) if args.seed is None else args.seed
    print(f"seed {seed}", flush=True)
    wrong, shares = 0, []
    with ProcessPoolExecutor(args.processes, mp_context=multiprocessing.get_context("spawn")) as pool:
        for kind in args.kinds:
            for trial in range(args.trials):
                week, fleet, seen = _fleet(pool, kind, [seed, [*KINDS].index(kind), trial], args)
                faults = _faults(week, fleet)
                wrong += bool(faults)
                before, after = ([getattr(each, it) for each in seen.values()] for it in ("before", "after"))
                shares += _shares(week, seen)
                error = f"{np.median(before):.2f} -> {np.median(after):.2f} (worst {max(after):.2f})"
                print(
                    f"{kind:10s} {trial}: {'; '.join(faults) or 'ok'}; unseen, in noises: {error}", flush=True
                )
    if shares:
        low, middle = np.quantile(shares, (0.1, 0.5))
        print(
            f"of what a day's own model gains, gained by that of the others: median {middle:.3f}, "
            f"p10 {low:.3f}, of {len(shares)}"
        )
    return int(wrong > 0)


def _fleet(
    pool: ProcessPoolExecutor, kind: str, seed: list[int], args: argparse.Namespace
) -> tuple[Week, Fleet, dict[str, CrossCheck]]:
    rng = np.random.default_rng(seed)
    week = KINDS[kind](args.days, rng)
    robot = int(rng.integers(2**31))
    blind = [
        make(int(rng.integers(2**31)), each, seconds=args.seconds, robot=robot).columns
        for each in week.hidden
    ]
    days = {f"day{number}": each for number, each in enumerate(blind)}
    fleet = fleet_of(dict(zip(days, pool.map(_diagnosed, days.values()), strict=True)))
    models = [common_model(fleet, name) for name in days]
    again = dict(zip(days, pool.map(_diagnosed, days.values(), models), strict=True))
    return week, fleet, {name: make_cross_check(fleet.results[name], each) for name, each in again.items()}


def _diagnosed(columns: Mapping[str, np.ndarray], model: Parameters | None = None) -> Diagnosis:
    return diagnose(columns, RobotConfig() if model is None else model.robot, model=model)


def _faults(week: Week, fleet: Fleet) -> list[str]:
    """What was said of a fleet that is not so, or not said that is."""
    said = {each.name: each for each in fleet.causes}
    found = []
    for name in week.common:
        if name not in said or not said[name].common:
            found.append(f"{name} is not common")
    found += [f"{each.name} is said to be common" for each in fleet.causes if each.common and each.name not in
              (*week.common, *(week.changes or {}))]  # fmt: skip
    for name, (jumps, creeps) in (week.changes or {}).items():
        courses = said[name].series.courses if name in said else ()
        if not courses:
            found.append(f"{name} is not said to change")
        found += [
            f"{name}: {_told(each.pieces)}" for each in courses if _form(each.pieces) != (jumps, creeps)
        ]
    changes = {each.name for each, _ in fleet.courses}
    found += [f"{name} is said to change" for name in changes - {*(week.changes or {})}]
    if week.once and (week.once not in said or said[week.once].recordings != ("day2",)):
        found.append(f"{week.once}: of {said[week.once].recordings if week.once in said else 'no day'}")
    return found


def _form(pieces: tuple[Piece, ...]) -> tuple[tuple[int, ...], bool]:
    return tuple(each.first for each in pieces[1:]), pieces[0].creeps


def _told(pieces: tuple[Piece, ...]) -> str:
    return ", ".join(f"{each.start:.4g} to {each.end:.4g} from day {each.first} on" for each in pieces)


def _shares(week: Week, seen: Mapping[str, CrossCheck]) -> list[float]:
    """Part of the error's power that a day's own model takes away which the model of the others takes, of
    each day on which that is as much as half the noise and nothing is wrong that the others have not."""
    found = []
    for number, each in enumerate(seen.values()):
        apart = week.once and number == ONCE
        if each.before**2 - each.own**2 > 0.5 and not apart:
            found.append((each.before**2 - each.after**2) / (each.before**2 - each.own**2))
    return found


ONCE = 2
"""The day on which something is wrong once."""


def _sound(days: int, _rng: np.random.Generator) -> Week:
    return Week([[] for _ in range(days)])


def _lasting(days: int, rng: np.random.Generator) -> Week:
    hidden = draw(str(rng.choice(LASTING)), rng)
    return Week([[hidden]] * days, (hidden.name,))


def _ageing(days: int, rng: np.random.Generator) -> Week:
    rate = float(rng.uniform(0.012, 0.025))
    hidden = [[_battery(0.08 + rate * day)] for day in range(days)]
    return Week(hidden, (BATTERY,), {BATTERY: ((), True)})


def _replaced(days: int, rng: np.random.Generator) -> Week:
    at, factor = (
        int(rng.integers(2, days - 1)),
        1.0 + float(rng.uniform(0.05, 0.08) * rng.choice([-1.0, 1.0])),
    )
    motor = Hidden("motor.back_emf_constant", "left", {"factor": factor}, {"ke_l": NEUTRAL["ke_l"] * factor})
    hidden = [[motor] if day >= at else [] for day in range(days)]
    return Week(hidden, (), {MOTOR: ((at,), False)})


def _renewed(days: int, rng: np.random.Generator) -> Week:
    rate, at = float(rng.uniform(0.02, 0.03)), days // 2
    hidden = [[_battery(0.08 + rate * (day % at))] for day in range(days)]
    return Week(hidden, (BATTERY,), {BATTERY: ((at,), True)})


def _once(days: int, rng: np.random.Generator) -> Week:
    hidden = draw(str(rng.choice([each for each in CAUSES if each in (*LASTING, "drive.slope")])), rng)
    return Week([[hidden] if day == ONCE else [] for day in range(days)], once=hidden.name)


def _battery(resistance: float) -> Hidden:
    return Hidden(BATTERY, None, {"resistance": resistance}, {"rint": resistance})


KINDS: Mapping[str, Callable[[int, np.random.Generator], Week]] = {
    "sound": _sound,
    "lasting": _lasting,
    "ageing": _ageing,
    "replaced": _replaced,
    "renewed": _renewed,
    "once": _once,
}

if __name__ == "__main__":
    sys.exit(main())
