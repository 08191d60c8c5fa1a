"""The measured cells as tables, as the paper's claims, and as a picture."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from raccoon.cli.compare_mitigations.measure import MANOEUVRES, METHODS, Cells, End

HIGH = 95.0
BATTERY, MOTORS, REPLACED = "battery 6.1-7.0 V", "drawn motors", "motor replaced"


@dataclass(frozen=True, slots=True)
class Claim:
    """Something the paper says; held: whether the numbers do, None where they were not measured."""

    text: str
    numbers: str
    held: bool | None


def high(ends: list[End], field: str) -> float:
    """95th percentile of one error."""
    return float(np.percentile([getattr(each, field) for each in ends], HIGH))


def off(ends: list[End]) -> float:
    """95th percentile of how far from the goal it ends, m."""
    return float(np.percentile([math.hypot(each.distance, each.lateral) for each in ends], HIGH))


def markdown(cells: Cells, conditions: tuple[str, ...], robots: int) -> str:
    """Every table, then the claims."""
    parts = [
        f"95th percentiles over {robots} robots a cell: distance mm / lateral mm / heading deg / time s.\n",
    ]
    for name in MANOEUVRES:
        parts += [f"## {name}\n", *_rows(cells, conditions, name), ""]
    parts += ["## What the paper says\n", "| claim | measured | holds |", "|---|---|---|"]
    words = {True: "yes", False: "**no**", None: "not measured"}
    parts += [f"| {each.text} | {each.numbers} | {words[each.held]} |" for each in claims(cells)]
    return "\n".join(parts) + "\n"


def _rows(cells: Cells, conditions: tuple[str, ...], name: str) -> list[str]:
    rows = [f"| mitigation | {' | '.join(conditions)} |", "|---" * (len(conditions) + 1) + "|"]
    for method in METHODS:
        found = [cells[(method, condition, name)] for condition in conditions]
        rows.append(f"| {method} | {' | '.join(_numbers(ends) for ends in found)} |")
    return rows


def _numbers(ends: list[End]) -> str:
    distance, lateral = (1e3 * high(ends, field) for field in ("distance", "lateral"))
    return (
        f"{distance:.1f} / {lateral:.1f} / {math.degrees(high(ends, 'heading')):.1f} / "
        f"{high(ends, 'seconds'):.1f}"
    )


def claims(cells: Cells) -> list[Claim]:
    """The paper's ranking, each step held to the numbers (m from the goal after 1 m)."""
    return [
        _better(cells, "A fresh battery helps", "fresh battery", "none", BATTERY),
        _alike(
            cells, "Scaling at 100 % cannot give what is missing", "voltage scaling, 100 %", "none", BATTERY
        ),
        _better(
            cells, "Scaling works at 80 %", "voltage scaling, 80 %", "voltage scaling, 100 %", BATTERY, 0.2
        ),
        _better(cells, "Matching motors by swapping helps", "motor swapping", "none", MOTORS),
        _better(cells, "Static k is more robust than swapping", "static k", "motor swapping", MOTORS),
        _worse(cells, "Static k is lost when a motor is replaced", "static k"),
        _better(
            cells, "The wheel PID beats static k on any battery", "wheel PID on back-EMF", "static k", BATTERY
        ),
        _better(cells, "An IMU keeps the heading of unequal motors", "IMU heading only", "none", MOTORS, 0.5),
        _better(
            cells,
            "Fusion of back-EMF and IMU is best with a replaced motor",
            "back-EMF + IMU fusion",
            "wheel PID on back-EMF",
            REPLACED,
        ),
        _best(cells, BATTERY),
        _best(cells, MOTORS),
        _best(cells, REPLACED),
    ]


def _metre(cells: Cells, method: str, condition: str) -> float | None:
    ends = cells.get((method, condition, "1 m"))
    return None if ends is None else off(ends)


def _better(cells: Cells, text: str, better: str, worse: str, condition: str, share: float = 1.0) -> Claim:
    one, other = _metre(cells, better, condition), _metre(cells, worse, condition)
    if one is None or other is None:
        return Claim(text, f"needs {condition}", None)
    numbers = f"{condition}: {1e3 * one:.1f} mm against {1e3 * other:.1f} mm ({worse})"
    return Claim(text, numbers, one < share * other)


def _alike(cells: Cells, text: str, one: str, other: str, condition: str) -> Claim:
    first, second = _metre(cells, one, condition), _metre(cells, other, condition)
    if first is None or second is None:
        return Claim(text, f"needs {condition}", None)
    numbers = f"{condition}: {1e3 * first:.1f} mm against {1e3 * second:.1f} mm ({other})"
    return Claim(text, numbers, first > 0.8 * second)


def _worse(cells: Cells, text: str, method: str) -> Claim:
    before, after = _metre(cells, method, MOTORS), _metre(cells, method, REPLACED)
    if before is None or after is None:
        return Claim(text, f"needs {REPLACED}", None)
    return Claim(text, f"{1e3 * before:.1f} mm, replaced {1e3 * after:.1f} mm", after > 3.0 * before)


def _best(cells: Cells, condition: str) -> Claim:
    text = f"Fusion is best of all: {condition}"
    found = {method: _metre(cells, method, condition) for method in METHODS}
    known = {method: value for method, value in found.items() if value is not None}
    if len(known) < len(METHODS):
        return Claim(text, f"needs {condition}", None)
    order = sorted(known, key=lambda method: known[method])
    numbers = ", ".join(f"{method} {1e3 * known[method]:.1f} mm" for method in order[:3])
    # Within a millimetre two methods are alike: the tape that both are calibrated by is no better.
    best = known["back-EMF + IMU fusion"] <= known[order[0]] + 1e-3
    return Claim(text, numbers, best)


def draw(cells: Cells, conditions: tuple[str, ...], path: Path) -> None:
    """How far from the goal after 1 m, by mitigation and condition."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(10.0, 4.8), layout="constrained")
    methods = list(METHODS)
    width = 0.8 / len(conditions)
    for index, condition in enumerate(conditions):
        values = [max(0.1, 1e3 * off(cells[(method, condition, "1 m")])) for method in methods]
        places = [place + (index - 0.5 * (len(conditions) - 1)) * width for place in range(len(methods))]
        axes.bar(places, values, width, label=condition)
    axes.set_yscale("log")
    axes.set_ylabel("mm from the goal after 1 m (95 %)")
    axes.set_xticks(range(len(methods)), [each.replace(", ", ",\n") for each in methods], rotation=20)
    axes.legend(ncols=4, fontsize="small")
    axes.grid(axis="y", alpha=0.3)
    figure.savefig(path, format=path.suffix.lstrip(".") or "svg")
    plt.close(figure)
