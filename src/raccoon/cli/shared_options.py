"""Options that several commands share, and checks of their values before the work begins."""

from __future__ import annotations

import argparse
import math
from collections.abc import Sequence
from pathlib import Path

from raccoon.core.errors import ConfigError

MAX_START_M = 1000.0
"""Largest X and Y of a start, m. No table is so large, and a picture or a pose farther away would lose its
millimetres."""


def add_place_options(parser: argparse.ArgumentParser) -> None:
    """Add the options `--table` and `--start`: the table of a simulated robot, and its start pose on it."""
    parser.add_argument("--table", type=Path, help="table file; by default the Botball-size table")
    parser.add_argument(
        "--start",
        type=float,
        nargs=3,
        metavar=("X", "Y", "DEG"),
        default=(0.0, 0.0, 0.0),
        help="where on the table it starts, m and degrees (0 0 0)",
    )


def check_seed(seed: int) -> None:
    """Raise ConfigError for a negative `--seed`."""
    if seed < 0:
        raise ConfigError(f"--seed {seed}: allowed are whole numbers from 0")


def check_start(start: Sequence[float]) -> None:
    """Raise ConfigError for a `--start X Y DEG` that is not finite or farther away than MAX_START_M."""
    x, y, degrees = start
    if not (abs(x) <= MAX_START_M and abs(y) <= MAX_START_M and math.isfinite(degrees)):
        shown = " ".join(f"{each:g}" for each in start)
        allowed = f"X and Y from {-MAX_START_M:g} to {MAX_START_M:g} m and a number of degrees"
        raise ConfigError(f"--start {shown}: allowed are {allowed}")
