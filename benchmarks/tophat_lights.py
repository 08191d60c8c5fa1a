"""Tophats in a light that changes while driving: the drives, and every method on them (see tophat.py)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import CalibrationError
from raccoon.estimate.tophat import Tophat, TophatGroup, calibrate
from raccoon.model import reflectance
from raccoon.model.paper import TOPHAT_READINGS
from tophat_methods import METHODS, RunningMidpoint

Array = NDArray[np.float64]
RATE = 200.0
CALIBRATED_AT = 0.24  # m/s
SECONDS = 14.0
FORGIVEN = 0.4  # s after a change begins: it takes 0.1 s, and 0.3 s are allowed

LIGHTS: dict[str, tuple[list[float], list[float], list[float]]] = {
    # name: knots of time, ambient level there (1 sun, -1 shade), times after which 0.3 s are forgiven
    "cloud": ([0, 2, 5, 8, 12, 14], [1, 1, -1, -1, 1, 1], []),
    "shadow edge": ([0, 6, 6.1, 14], [1, 1, -1, -1], [6.0]),
    "sun patch": ([0, 5, 5.1, 8, 8.1, 14], [-1, -1, 1, 1, -1, -1], [5.0, 8.0]),
}
SHADES = (0.3, 0.1, 0.02)
LAMPS = {"on 50 Hz": 100.3, "on 60 Hz": 119.7}
"""Hz at which lamps on either mains flicker, whose frequency is never exact."""
ROWS = [(light, shade) for light in LIGHTS for shade in SHADES] + [
    (lamps, level) for lamps in LAMPS for level in (0.005, 0.02)
]
"""Light and its shade; of lamps that flicker by 30 %, their level."""
SKEW = 0.03  # m by which the second sensor is late at lines that are crossed askew


def row(light: str, shade: float) -> str:
    """Name of a row of the table."""
    if light in LAMPS:
        return f"lamps of {shade:5.3f} {light}"
    return f"{light:12} sun <-> {shade:4.2f}"


def drive(
    seed: np.random.SeedSequence, draw: int, light: str, shade: float, speed: float
) -> Mapping[str, list[float]]:
    """Share of wrong clear readings by method, of both sensors; lines are crossed square or askew in turn."""
    rng = np.random.default_rng(seed)
    condition = TOPHAT_READINGS[2 * (draw % 4)]  # each sensor and height in turn
    at = np.arange(0.0, SECONDS, 1.0 / RATE)
    counted = np.ones(len(at), dtype=bool)
    if light in LAMPS:
        before = ambient = shade * (
            1.0 + 0.3 * np.sin(math.tau * LAMPS[light] * at + rng.uniform(0.0, math.tau))
        )
    else:
        knots, levels, events = LIGHTS[light]
        ambient = np.interp(at, knots, [shade if each < 0 else each for each in levels])
        before = np.full(len(at), ambient[0])
        for event in events:
            counted &= ~((at > event) & (at < event + FORGIVEN))
    radius = reflectance.spot_radius(condition.height)
    lines = np.cumsum(rng.uniform(0.15, 0.5, 30))
    skew = SKEW if draw // 4 % 2 else 0.0
    scores: dict[str, list[float]] = {}
    counts, darkness, found = [], [], []
    for index in range(2):
        optics = reflectance.fit(condition.generation).at(
            condition.height, math.exp(0.15 * rng.standard_normal())
        )
        places = lines + index * skew
        covered = [reflectance.line_coverage(speed * at, place, 0.015, radius) for place in places]
        darkness.append(np.sum(covered, axis=0))
        counts.append(reflectance.read(rng, darkness[-1], optics, ambient=ambient))
        path = reflectance.line_coverage(np.arange(0.0, 0.6, CALIBRATED_AT / RATE), 0.3, 0.015, radius)
        samples = reflectance.read(rng, path, optics, ambient=before[: len(path)])
        found.append(calibrate(samples))
        if not found[-1].usable:
            return {}
        score = _judge(darkness[-1], counted)
        for method in ("fixed", "midpoint", "percentile", "trimmed", "k_means"):
            try:
                cut = METHODS[method](samples)
            except CalibrationError:
                continue
            scores.setdefault(method, []).append(score(counts[-1] >= cut))
        midpoint = RunningMidpoint()
        black = np.array([bool(midpoint.update(float(each))) for each in counts[-1]])
        scores.setdefault("on the fly", []).append(score(black))
        scores.setdefault("not adapting", []).append(score(counts[-1] >= (found[-1].threshold or 0.0)))
    answers = _classified([Tophat(each) for each in found], at, counts, speed / RATE)
    for index, black in enumerate(answers):
        scores.setdefault("ours", []).append(_judge(darkness[index], counted)(black))
    return scores


def _judge(darkness: Array, counted: NDArray[np.bool_]) -> Callable[[NDArray[np.bool_]], float]:
    """A judge of answers: the share of wrong ones among the readings over one surface that count."""
    clear = counted & ((darkness <= 0.05) | (darkness >= 0.9 * darkness.max()))
    truth = darkness > 0.5
    return lambda black: float((black != truth)[clear].mean())


def _classified(tophats: list[Tophat], at: Array, counts: list[Array], way: float) -> NDArray[np.bool_]:
    """Black or not by sensor and reading; the robot knows the way it goes, as from its wheels."""
    group = TophatGroup(tophats)
    ways = [way] * len(tophats)
    rows = [
        [bool(each.black) for each in group.update(float(now), [float(one[index]) for one in counts], ways)]
        for index, now in enumerate(at)
    ]
    return np.array(rows).T
