"""What may differ from one recording of a robot to the next: its battery's charge, its gyro's bias."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from raccoon.diagnose.hypotheses.base_coordinates import INSIDE
from raccoon.diagnose.hypotheses.coordinates import Coordinate, Setting, Settings

RUN = "run"
DIFFERS: dict[Setting, float] = {
    ("battery.open_circuit_voltage", None, "voltage"): 0.3,
    ("imu.gyro_bias", None, "rate"): 0.002,
}
"""Settings that each recording has of its own, and one standard deviation between two of them, V and rad/s: a
fresh battery has a volt more than one that is nearly empty."""


RESISTANCE: Setting = ("battery.internal_resistance", None, "resistance")
"""What recordings have of their own as well where they do not share a battery."""
TIMES, LEAST = 0.6, -1.0
"""Standard deviation of the logarithm of that, and how many of them it may be less."""


def run_coordinates(count: int, resistance: float = 0.0) -> list[Coordinate]:
    """By how much each of so many recordings differs from what all of them have; none of one alone.

    resistance: ohm, around which each has a battery of its own; 0 where all have one.
    """
    found = []
    for number in _numbers(count):
        for (id_, _, _), width in DIFFERS.items():
            found.append(_of(number, id_, _times(width), -INSIDE))
        if resistance > 0.0:
            found.append(_of(number, RESISTANCE[0], _beyond(resistance), LEAST))
    return found


def run_settings(count: int, resistance: float = 0.0) -> Settings:
    """Where all of them are alike. resistance: as in `run_coordinates`."""
    keys = [*DIFFERS, RESISTANCE] if resistance > 0.0 else [*DIFFERS]
    return {_key(number, id_): 0.0 for number in _numbers(count) for id_, _, _ in keys}


def of_run(variants: Sequence[Settings], number: int) -> list[Settings]:
    """The settings of one of several recordings."""
    return [
        {**each, **{key: each[key] + each.get(_key(number, key[0]), 0.0) for key in (*DIFFERS, RESISTANCE)}}
        for each in variants
    ]


def resistances(settings: Settings, count: int) -> list[float]:
    """ohm, of the battery of each of so many recordings."""
    return [of_run([settings], number)[0][RESISTANCE] for number in range(count)]


def _of(number: int, id_: str, size: Callable[[float], float], low: float) -> Coordinate:
    return Coordinate(f"{id_} of recording {number + 1}", (_key(number, id_),), size, low=low, high=INSIDE)


def _numbers(count: int) -> range:
    return range(count if count > 1 else 0)


def _key(number: int, id_: str) -> Setting:
    return (RUN, str(number), id_)


def _beyond(nominal: float) -> Callable[[float], float]:
    return lambda u: nominal * math.expm1(TIMES * u)


def _times(width: float) -> Callable[[float], float]:
    return lambda u: width * u
