"""Unknown effects in words: their size, their covariate, and where to look on the robot."""

from __future__ import annotations

import re
from collections.abc import Sequence

import numpy as np

from raccoon.diagnose.reports.numbers import parameter_text
from raccoon.diagnose.result import Shape

MIN_WAVE_SHARE = 0.6
"""Least share of a curve's power in a single harmonic for which the curve is described by it."""
_WHEEL_ANGLE = re.compile(r"wheel angle (left|right)")
_WHEEL_ALONE = re.compile(r"^(left|right) wheel alone$")
FRICTION_SUFFIX, TIME_PREFIX = " (friction)", "time ("
QUESTIONS = {
    "position": "is the floor rough, dirty or taped there?",
    "heading": "is the table not level, or does a cable pull at the robot?",
    "speed": "does something begin to rub or to shake at that speed?",
    "time (gyro)": "did the robot hit something then, or was the gyro set to zero while it moved?",
    "time (left wheel)": "did the wheel lose its tyre then, or did something wind around it?",
    "time (right wheel)": "did the wheel lose its tyre then, or did something wind around it?",
    "time": "was something picked up, put down or lost then?",
    "gyro over speed": "does the controller shake: is it screwed down?",
    "gyro over turn rate": "does the gyro read the same for a full turn to the left and one to the right?",
    "gyro over time": "does the gyro warm up: is it calibrated at rest just before a run?",
    "back-EMF over speed": "does the wheel turn as fast as its reading says, at half and at full power?",
    "battery over time": "is a plug loose, or does something else draw from the battery?",
}
"""Questions by the covariate of a curve, without parentheses and without the side."""


def depends_text(depends_on: Sequence[str]) -> str:
    """The covariates of an unknown effect in words."""
    named = (_WHEEL_ANGLE.sub(r"the angle of the \1 wheel", each) for each in depends_on)
    return ", ".join(_WHEEL_ALONE.sub(r"the \1 wheel alone", each) for each in named)


def shape_text(shape: Shape) -> str:
    """What varies, its size, where it is largest or how often per turn, and what to look at."""
    often = waves_per_turn(shape)
    most = f"{often} times in a turn" if often else f"highest at {shape.highest:.3g} {shape.over_unit}"
    if shape.depends_on.startswith(TIME_PREFIX):  # a curve in steps
        moment = step_position(shape)
        most = f"most of it at about {moment:.{0 if moment >= 10.0 else 1}f} {shape.over_unit}"
    size = f"{shape.quantity} varies by {parameter_text(shape.size)} over the {covariate_text(shape)}, {most}"
    look = question_about(shape.depends_on)
    return f"{size}: {look}" if look else size


def step_position(shape: Shape) -> float:
    """Position of the largest step of a curve in steps, in over_unit: between two of its points."""
    step = int(np.argmax(np.abs(np.diff(shape.values, append=shape.values[-1]))))
    return float(shape.over[step : step + 2].mean())


def covariate_text(shape: Shape) -> str:
    """The covariate of a curve in a few words."""
    name = shape.depends_on.partition(" (")[0].rpartition(" over ")[2]
    return depends_text([name]).removeprefix("the ")


def question_about(depends_on: str) -> str:
    """A question about the covariate that a team can answer by looking; "" if there is none."""
    over, wheel, side = depends_on.removesuffix(FRICTION_SUFFIX).partition("wheel angle ")
    if wheel:
        if depends_on.endswith(FRICTION_SUFFIX):
            return f"does the {side} wheel rub, is it or its axle bent, is something wound around it?"
        return f"does the {side} motor cog: is a tooth of its gear, or its shaft, damaged?"
    name = over.partition(" (")[0]
    return QUESTIONS.get(over) or QUESTIONS.get(name) or QUESTIONS.get(name.split(" ")[0], "")


def waves_per_turn(shape: Shape) -> int:
    """Harmonic of the wheel's angle that makes nearly all of the curve, if above 1; else 0."""
    if not shape.depends_on.startswith("wheel angle"):
        return 0
    orders = np.arange(1, 13)[:, None]
    power = np.abs(np.exp(1j * orders * shape.over) @ (shape.values - shape.values.mean())) ** 2
    most = int(np.argmax(power))
    return most + 1 if most and power[most] > MIN_WAVE_SHARE * power.sum() else 0
