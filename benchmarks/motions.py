"""How true the motions are: every figure asked of them, over batteries, motor pairings and seeds.

    python benchmarks/motions.py [--seeds 50] [--processes 2] [--json OUT] [--markdown OUT] [--plot OUT]

For every seed there is a robot of each of the nine pairings of the paper's three motors (motion_robots.py
says what else is in it). It is calibrated once, on one of the three batteries (6.1, 6.6 and 7.0 V, in turn),
and then meets the others: the straight metre and the quarter turn are driven on each of the three, the square
and the small moves on one in turn (`--all`: on each), steps of the wheels' speed at 5.8, 6.4 and 7.2 V.
Errors are of the true pose, 95th percentiles over all of these runs; margins are the worst of all robots.
`--thin` takes one pairing and one battery a seed.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np

from motion_robots import BATTERIES, Case, Error, calibrated, parameters_of, run
from motion_steps import SETTLE_LIMIT, STEP_BATTERIES, step_response, worst_margins
from raccoon.core.config import RobotConfig
from raccoon.robot.actions.actions import Action, repeat
from raccoon.robot.actions.sequences import seq
from raccoon.robot.motions.goals import straight, turn

DEADBAND = 0.10
# The same 10 % of 6.6 V as a torque: 0.66 V / 1.8 ohm * 1.08 N m/A, less the Coulomb friction that is there.
STICTION = 0.66 / 1.8 * 1.08 - 0.18
QUARTER = math.pi / 2.0
MOTIONS: dict[str, tuple[Action[object], tuple[float, float, float]]] = {
    "straight": (straight(1.0), (1.0, 0.0, 0.0)),
    "turn": (turn(QUARTER), (0.0, 0.0, QUARTER)),
    "square": (repeat(seq(straight(0.5), turn(QUARTER)), 4), (0.0, 0.0, 4.0 * QUARTER)),
    "small": (straight(0.03), (0.03, 0.0, 0.0)),
    "small back": (straight(-0.03), (-0.03, 0.0, 0.0)),
    "small sticky": (straight(0.03), (0.03, 0.0, 0.0)),
}
ON_EVERY_BATTERY = ("straight", "turn")
EFFECTS: dict[str, tuple[str, dict[str, float]]] = {
    "small": ("actuation.deadband", {"duty": DEADBAND}),
    "small back": ("actuation.deadband", {"duty": DEADBAND}),
    "small sticky": ("friction.stiction", {"torque": STICTION, "speed": 0.5}),
}
SMALL = {
    "small": "3 cm, 10 % dead band",
    "small back": "-3 cm, 10 % dead band",
    "small sticky": "3 cm, stiction of 10 %",
}


@dataclass(frozen=True, slots=True)
class Job:
    """One calibrated robot and the batteries it meets. case: with the battery it was calibrated on.

    every: the batteries of the straight and the turn; some: of the other motions; steps: of the speed steps.
    """

    case: Case
    every: tuple[float, ...]
    some: tuple[float, ...]
    steps: tuple[float, ...]


@dataclass(slots=True)
class Findings:
    """All runs of one robot or of many. margins: deg, dB."""

    errors: list[tuple[str, Case, Error]] = field(default_factory=list)
    steps: list[tuple[float, float]] = field(default_factory=list)
    margins: list[tuple[float, float]] = field(default_factory=list)

    def add(self, other: Findings) -> None:
        """Take those of another robot."""
        self.errors += other.errors
        self.steps += other.steps
        self.margins += other.margins

    def of(self, name: str) -> list[Error]:
        """The ends of one motion."""
        return [error for each, _, error in self.errors if each == name]


def jobs(seeds: int, every: bool = False, thin: bool = False) -> Iterator[Job]:
    """Every pairing with every seed; every: all motions on all batteries; thin: one pairing a seed."""
    for number in range(seeds if thin else 9 * seeds):
        seed, pairing = (number, number % 9) if thin else divmod(number, 9)
        place = seed + pairing + pairing // 3
        second, first = BATTERIES[place % 3], BATTERIES[(place + 1 + seed // 3 % 2) % 3]
        yield Job(
            Case(first, pairing // 3, pairing % 3, seed),
            (second,) if thin else BATTERIES,
            BATTERIES if every else (second,),
            STEP_BATTERIES,
        )


def measure(job: Job) -> Findings:
    """All motions of one robot."""
    bare, case, found = RobotConfig(), job.case, Findings()
    config = calibrated(case, bare)
    for number, name in enumerate(MOTIONS):
        for battery in job.every if name in ON_EVERY_BATTERY else job.some:
            now = Case(battery, case.left, case.right, case.seed)
            found.errors.append((name, now, drive(name, now, config, now.noise(number))))
    found.steps = [step_response(each, case.left, case.right, config, case.seed) for each in job.steps]
    found.margins = [worst_margins(config, (case.left, case.right))]
    return found


def drive(name: str, case: Case, config: RobotConfig, seed: int) -> Error:
    """One motion of a calibrated robot."""
    action, goal = MOTIONS[name]
    plant = parameters_of(case, RobotConfig())
    if name in EFFECTS:
        effect, values = EFFECTS[name]
        plant = plant.with_effect(effect, None, **values)
    return run(action, goal, plant, config, seed)


@dataclass(frozen=True, slots=True)
class Figure:
    """One line of the result: what is asked (at most, or at least) and what was measured."""

    name: str
    unit: str
    asked: float
    measured: float
    least: bool = False

    @property
    def met(self) -> bool:
        """Whether it is."""
        return self.measured >= self.asked if self.least else self.measured <= self.asked


def turn_time_optimal(config: RobotConfig) -> float:
    """s of a quarter turn by the trapezoid at the same limits."""
    rate, gain = config.motion.turn_rate, config.motion.turn_acceleration
    return QUARTER / rate + rate / gain


def figures(found: Findings) -> list[Figure]:
    """The 95th percentiles."""

    def high(name: str, part: str, scale: float = 1.0) -> float:
        return _high([getattr(each, part) for each in found.of(name)]) * scale

    optimal = turn_time_optimal(RobotConfig())
    closing = [math.hypot(each.along, each.across) for each in found.of("square")]
    small = [
        line
        for name, words in SMALL.items()
        for line in (
            Figure(f"{words}: distance", "mm", 1.5, high(name, "along", 1e3)),
            Figure(f"{words}: time", "s", 1.0, high(name, "seconds")),
        )
    ]
    return [
        Figure("straight 1 m: distance", "mm", 3.0, high("straight", "along", 1e3)),
        Figure("straight 1 m: lateral", "mm", 5.0, high("straight", "across", 1e3)),
        Figure("straight 1 m: heading", "deg", 0.3, high("straight", "heading_deg")),
        Figure("turn 90: heading", "deg", 0.5, high("turn", "heading_deg")),
        Figure("turn 90: time over optimal", "", 1.3, high("turn", "seconds") / optimal),
        Figure("square 4 x 0.5 m: closing", "mm", 10.0, _high(closing) * 1e3),
        Figure("square 4 x 0.5 m: heading", "deg", 1.0, high("square", "heading_deg")),
        *small,
        Figure("speed step: settles within 5 %", "s", SETTLE_LIMIT, _high([each for each, _ in found.steps])),
        Figure("speed step: overshoot", "%", 5.0, 100.0 * _high([each for _, each in found.steps])),
        Figure("phase margin, worst", "deg", 45.0, min(each for each, _ in found.margins), least=True),
        Figure("gain margin, worst", "dB", 6.0, min(each for _, each in found.margins), least=True),
    ]


def _high(values: list[float]) -> float:
    return float(np.percentile(values, 95.0))


def report(lines: list[Figure], found: Findings, robots: int, seconds: float) -> None:
    """Everything for people."""
    print(f"{robots} robots, {len(found.errors)} motions, {len(found.steps)} steps, {seconds:.0f} s")
    for line in lines:
        print(
            f"{'ok  ' if line.met else 'MISS'} {line.name:36} asked {line.asked:6.3g} {line.unit:4} "
            f"measured {line.measured:.3g}"
        )
    for name in MOTIONS:
        ends = [(case, error) for each, case, error in found.errors if each == name]
        median = np.median([error.along for _, error in ends]) * 1e3
        slow = max(error.seconds for _, error in ends)
        bad, error = max(ends, key=lambda end: max(end[1].along, end[1].across, 0.005 * end[1].heading_deg))
        print(f"{name}: {len(ends)} runs, median distance error {median:.2f} mm, slowest {slow:.2f} s")
        print(
            f"  worst {bad}: {1e3 * error.along:.1f} / {1e3 * error.across:.1f} mm, {error.heading_deg:.2f}°"
        )


def markdown(lines: list[Figure]) -> str:
    """The table of docs/motions.md."""
    rows = ["| figure | asked | measured |", "|---|---|---|"]
    for line in lines:
        bound = "at least " if line.least else ""
        value = f"{line.measured:.3g}" if line.measured >= 1.0 else f"{line.measured:.2g}"
        rows.append(f"| {line.name} | {bound}{line.asked:.3g} {line.unit} | {value} {line.unit} |")
    return "\n".join(rows) + "\n"


def draw(lines: list[Figure], path: Path) -> None:
    """Each figure as a share of what is asked."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    shown = lines[::-1]
    shares = [line.asked / line.measured if line.least else line.measured / line.asked for line in shown]
    figure, axes = plt.subplots(figsize=(8.0, 4.6), layout="constrained")
    bars = axes.barh([line.name for line in shown], shares)
    axes.axvline(1.0, color="black", linewidth=1.0)
    clear = {"facecolor": "white", "edgecolor": "none", "pad": 0.5}  # where a label meets the line
    words = [f"{line.measured:.3g} {line.unit}" for line in shown]
    axes.bar_label(bars, words, padding=3, fontsize=8, bbox=clear)
    axes.set_xlabel("95th percentile over what is asked (margins: asked over worst)")
    axes.set_xlim(0.0, 1.25)
    figure.savefig(path, format=path.suffix.lstrip(".") or "svg")
    plt.close(figure)


def gathered(work: list[Job], processes: int) -> Findings:
    """Every robot's findings; in this process alone where it is one."""
    found = Findings()
    if processes == 1:
        for job in work:
            found.add(measure(job))
        return found
    with ProcessPoolExecutor(processes) as pool:
        for each in pool.map(measure, work, chunksize=4):
            found.add(each)
    return found


def main() -> int:
    """Measure and print; exit status 1 where a figure is missed."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--all", action="store_true", help="all motions on all batteries")
    parser.add_argument("--thin", action="store_true", help="one pairing and one battery a seed")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--markdown", type=Path)
    parser.add_argument("--plot", type=Path, help="draw the figures (needs matplotlib)")
    args = parser.parse_args()
    begin = time.perf_counter()
    work = list(jobs(args.seeds, args.all, args.thin))
    found = gathered(work, args.processes)
    lines = figures(found)
    report(lines, found, len(work), time.perf_counter() - begin)
    if args.plot is not None:
        draw(lines, args.plot)
    if args.markdown is not None:
        args.markdown.write_text(markdown(lines), encoding="utf-8")
    if args.json is not None:
        args.json.write_text(json.dumps([{**asdict(each), "met": each.met} for each in lines]), "utf-8")
    return 0 if all(line.met for line in lines) else 1


if __name__ == "__main__":
    sys.exit(main())
