"""How well hidden causes are found: `python benchmarks/diagnosis.py --trials 3`.

Recordings come from the independent plant in tests/blind; seeds are fresh in every run unless one is given.
Prints a row a case (asked and measured), the confusion of causes, and times.
"""

from __future__ import annotations

import argparse
import os
import sys
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from blind.generator import Blind, Noise, make
from blind.hidden import CAUSES, UNKNOWN, Hidden, draw, draw_unknown
from blind.plant import NEUTRAL
from raccoon.core.config import RobotConfig
from raccoon.diagnose.diagnosis import diagnose
from raccoon.diagnose.result import CauseResult, Diagnosis

PRACTICAL = 0.05
"""Rise of the held-out error, in units of the noise, from which a named cause is of practical size."""
LINEAR = (
    "factor",
    "voltage",
    "resistance",
    "torque",
    "coefficient",
    "seconds",
    "angle",
    "time",
    "rate",
    "limit",
)


@dataclass(frozen=True)
class Trial:
    """One recording: what was hidden, what was said, and the CPU time it took in s."""

    blind: Blind
    said: Diagnosis
    seconds: float

    @property
    def true_names(self) -> set[str]:
        return {each.name for each in self.blind.hidden if each.id != "unknown"}

    def hit(self, cause: CauseResult) -> bool:
        """Whether a named cause is one of the hidden, alone or as a class that holds it."""
        return bool(({cause.name} | set(cause.confounded_with)) & self.true_names)

    @property
    def first_right(self) -> bool:
        return bool(self.said.causes) and self.hit(self.said.causes[0])

    @property
    def exact(self) -> bool:
        hits = [self.hit(each) for each in self.said.causes]
        return all(hits) and len(hits) == len(self.true_names) and not self.said.unexplained.depends_on

    @property
    def wrong(self) -> bool:
        return bool(self.said.causes) and not self.first_right


def run(blind: Blind) -> Trial:
    """Diagnose one recording with the default robot.toml."""
    begin = time.process_time()
    said = diagnose(blind.columns, RobotConfig())
    return Trial(blind, said, time.process_time() - begin)


def singles(
    rng: np.random.Generator, trials: int, size: float, ids: Sequence[str], **how: object
) -> Iterator[Trial]:
    """Every cause of `ids` alone, `trials` times."""
    for cause in ids:
        for _ in range(trials):
            hidden = draw(cause, rng, size)
            yield run(make(int(rng.integers(2**31)), [hidden], **how))  # type: ignore[arg-type]


def several(rng: np.random.Generator, trials: int, count: int) -> Iterator[Trial]:
    """`count` different causes at once."""
    ids = list(CAUSES)
    for _ in range(trials):
        chosen = rng.choice(len(ids), count, replace=False)
        yield run(make(int(rng.integers(2**31)), [draw(ids[index], rng) for index in chosen]))


def unknowns(rng: np.random.Generator, trials: int) -> Iterator[Trial]:
    """Causes that no catalogue lists."""
    for kind in UNKNOWN:
        for _ in range(trials):
            yield run(make(int(rng.integers(2**31)), [draw_unknown(kind, rng)]))


def percent(flags: Sequence[bool]) -> str:
    """Share of the true ones, and how many there are."""
    return f"{100 * np.mean(flags):5.1f} % of {len(flags)}" if flags else "none run"


def row(case: str, asked: str, measured: str) -> None:
    """Print one line of the table."""
    print(f"{case:34s} | {asked:42s} | {measured}", flush=True)


def report_singles(case: str, asked: str, trials: Sequence[Trial]) -> None:
    """Naming of single causes."""
    first = percent([each.first_right for each in trials])
    wrong = percent([each.wrong for each in trials])
    row(case, asked, f"first {first}, wrong {wrong}, exactly {percent([each.exact for each in trials])}")


def relative_errors(trials: Sequence[Trial]) -> tuple[list[float], list[bool]]:
    """Errors of the leading parameter over its deviation's full value, and whether 95 % intervals hold it."""
    errors, covered = [], []
    for trial in trials:
        hidden: Hidden = trial.blind.hidden[0]
        for cause in trial.said.causes[:1]:
            if cause.name != hidden.name:
                continue
            name = next(iter(cause.parameters))
            found = cause.parameters[name]
            if name not in LINEAR:
                continue
            plant = next(iter(hidden.plant))
            true = trial.blind.robot[plant] / (NEUTRAL[plant] if name == "factor" else 1.0)
            errors.append(abs(found.value - true) / abs(true))
            covered.append(abs(found.value - true) <= 1.96 * found.std)
    return errors, covered


def confusion(trials: Sequence[Trial]) -> None:
    """What was said first where it was not what was hidden."""
    pairs = Counter(
        (trial.blind.hidden[0].name, trial.said.causes[0].name if trial.said.causes else "(silent)")
        for trial in trials
        if not trial.first_right
    )
    print("\nhidden -> said first, where they differ:")
    for (true, said), count in pairs.most_common():
        print(f"  {true:34s} -> {said:34s} {count}")


def main() -> None:
    """Run and print everything."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--trials", type=int, default=2, help="recordings for each cause (and 10 times that clean)"
    )
    parser.add_argument("--seed", type=int, default=None)
    parser.add_argument("--cases", default="single,clean,two,many,small,contest,short,worst,unknown")
    args = parser.parse_args()
    seed = args.seed if args.seed is not None else int(np.random.default_rng().integers(2**31))
    cases, n, ids = args.cases.split(","), args.trials, list(CAUSES)
    print(f"seed {seed}, {n} trials for each cause")
    diagnose(make(1).columns, RobotConfig())  # compilation
    rng = np.random.default_rng(seed)
    row("case", "asked", "measured")
    if "single" in cases:
        report_main(list(singles(rng, n, 1.0, ids)))
    if "clean" in cases:
        clean = [run(make(int(rng.integers(2**31)))) for _ in range(10 * n)]
        report_clean(clean)
    if "two" in cases:
        report_several("two hidden", "both >= 97 %, exactly >= 93 %", list(several(rng, 10 * n, 2)))
    if "many" in cases:
        report_several("four hidden", "recall >= 97 %, spurious <= 2 %", list(several(rng, 5 * n, 4)))
    for case, asked, size, how in (
        ("small", "named >= 88 %, wrong <= 1 %", 0.3, {}),
        ("contest", "first >= 94 %", 1.0, {"drive": "contest", "seconds": 30.0}),
        ("short", "first >= 87 %", 1.0, {"seconds": 12.0}),
        (
            "worst",
            ">= 82 %, wrong <= 5 %",
            0.5,
            {"drive": "contest", "seconds": 30.0, "noise": Noise().times(2)},
        ),
    ):
        if case in cases:
            report_singles(case, asked, list(singles(rng, max(n // 2, 1), size, ids, **how)))
    if "unknown" in cases:
        report_unknown(list(unknowns(rng, 2 * n)))


def report_main(trials: Sequence[Trial]) -> None:
    """Single causes: naming, parameters, intervals, times, confusion."""
    report_singles("single, exciting 40 s", "first >= 99 %, wrong <= 0.5 %, exactly >= 97 %", trials)
    errors, covered = relative_errors(trials)
    middle, high = np.quantile(errors, [0.5, 0.9]) if errors else (np.nan, np.nan)
    row("parameters", "median <= 2 %, p90 <= 10 %, cover 92-98 %",
        f"median {100 * middle:.1f} %, p90 {100 * high:.1f} %, cover {percent(covered)}")  # fmt: skip
    seconds = np.array([each.seconds for each in trials])
    row("CPU time", "median <= 4 s, p90 <= 12 s",
        f"median {np.median(seconds):.1f} s, p90 {np.quantile(seconds, 0.9):.1f} s")  # fmt: skip
    row(
        "false unknown, known effect",
        "<= 5 %",
        percent([bool(t.said.unexplained.depends_on) for t in trials]),
    )
    confusion(trials)


def report_clean(trials: Sequence[Trial]) -> None:
    """False alarms."""
    named = [bool(each.said.causes) for each in trials]
    practical = [
        any(c.gain.heldout_rmse_before - c.gain.heldout_rmse_after > PRACTICAL for c in each.said.causes)
        for each in trials
    ]
    row("clean", "named <= 1 %, practical 0", f"named {percent(named)}, practical {percent(practical)}")
    row("false unknown, clean", "<= 3 %", percent([bool(t.said.unexplained.depends_on) for t in trials]))


def report_several(case: str, asked: str, trials: Sequence[Trial]) -> None:
    """Recall of all that was hidden, exact sets, spurious names."""
    found = [
        name in {c.name for c in t.said.causes} | {x for c in t.said.causes for x in c.confounded_with}
        for t in trials
        for name in t.true_names
    ]
    spurious = [not t.hit(c) for t in trials for c in t.said.causes]
    everything = [all(found[i : i + len(t.true_names)]) for i, t in _offsets(trials)]
    row(case, asked, f"all {percent(everything)}, recall {percent(found)}, exactly "
        f"{percent([t.exact for t in trials])}, spurious {percent(spurious)}")  # fmt: skip


def _offsets(trials: Sequence[Trial]) -> Iterator[tuple[int, Trial]]:
    position = 0
    for each in trials:
        yield position, each
        position += len(each.true_names)


def report_unknown(trials: Sequence[Trial]) -> None:
    """Flagged, with the right dependence, and not blamed on a known cause."""
    flagged = [bool(t.said.unexplained.depends_on) for t in trials]
    right = [
        any(str(t.blind.hidden[0].where).split()[0] in each for each in t.said.unexplained.depends_on)
        for t in trials
    ]
    blamed = [bool(t.said.causes) and not t.said.unexplained.depends_on for t in trials]
    row("unknown", "flagged >= 97 %, right >= 92 %, blamed <= 2 %",
        f"flagged {percent(flagged)}, right {percent(right)}, blamed {percent(blamed)}")  # fmt: skip


if __name__ == "__main__":
    main()
