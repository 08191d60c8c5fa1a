"""What may differ from one recording of a robot to the next: its battery's charge, its gyro's bias."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from raccoon.diagnose.hypotheses.coordinates import Coordinate, Setting, Settings

INSIDE = 3.5
RUN = "run"
DIFFERS: dict[Setting, float] = {
    ("battery.open_circuit_voltage", None, "voltage"): 0.3,
    ("imu.gyro_bias", None, "rate"): 0.002,
}
"""Settings that each recording has of its own, and one standard deviation between two of them, V and rad/s: a
fresh battery has a volt more than one that is nearly empty."""


def run_coordinates(count: int) -> list[Coordinate]:
    """By how much each of so many recordings differs from what all of them have; none of one alone."""
    return [
        Coordinate(
            f"{id_} of recording {number + 1}", (_key(number, id_),), _times(width), low=-INSIDE, high=INSIDE
        )
        for number in _numbers(count)
        for (id_, _, _), width in DIFFERS.items()
    ]


def run_settings(count: int) -> Settings:
    """Where all of them are alike."""
    return {_key(number, id_): 0.0 for number in _numbers(count) for id_, _, _ in DIFFERS}


def of_run(variants: Sequence[Settings], number: int) -> list[Settings]:
    """The settings of one of several recordings."""
    return [{**each, **{key: each[key] + each[_key(number, key[0])] for key in DIFFERS}} for each in variants]


def _numbers(count: int) -> range:
    return range(count if count > 1 else 0)


def _key(number: int, id_: str) -> Setting:
    return (RUN, str(number), id_)


def _times(width: float) -> Callable[[float], float]:
    return lambda u: width * u
