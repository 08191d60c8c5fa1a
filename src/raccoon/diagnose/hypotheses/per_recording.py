"""Nuisance settings that each recording of a robot has for itself: the battery's charge, the gyro's bias."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from raccoon.diagnose.hypotheses.base_coordinates import MAX_BASE_STDS
from raccoon.diagnose.hypotheses.coordinates import Coordinate, Setting, Settings

RUN = "run"
PER_RECORDING_STDS: dict[Setting, float] = {
    ("battery.open_circuit_voltage", None, "voltage"): 0.3,
    ("imu.gyro_bias", None, "rate"): 0.002,
}
"""Settings with a value for each recording, and the prior standard deviation of their differences, V and
rad/s: a fresh battery has a volt more than one that is nearly empty."""
BATTERY_RESISTANCE: Setting = ("battery.internal_resistance", None, "resistance")
"""A further one where the recordings were made with different batteries."""
RESISTANCE_LOG_STD, MIN_RESISTANCE_STDS = 0.6, -1.0
"""Prior standard deviation of its logarithm, and its lower bound in standard deviations."""


def per_recording_coordinates(count: int, resistance: float = 0.0) -> list[Coordinate]:
    """Coordinates of the deviation of each of so many recordings from their common value; none for one alone.

    resistance: ohm, about which the resistances of their batteries lie; 0 where all share one battery.
    """
    found = []
    for number in _recording_numbers(count):
        for (id_, _, _), width in PER_RECORDING_STDS.items():
            found.append(_coordinate(number, id_, _scaled_by(width), -MAX_BASE_STDS))
        if resistance > 0.0:
            found.append(
                _coordinate(
                    number, BATTERY_RESISTANCE[0], _resistance_change(resistance), MIN_RESISTANCE_STDS
                )
            )
    return found


def per_recording_settings(count: int, resistance: float = 0.0) -> Settings:
    """The neutral settings of these coordinates: no deviation. resistance: as in
    `per_recording_coordinates`."""
    keys = [*PER_RECORDING_STDS, BATTERY_RESISTANCE] if resistance > 0.0 else [*PER_RECORDING_STDS]
    return {_key(number, id_): 0.0 for number in _recording_numbers(count) for id_, _, _ in keys}


def settings_of_recording(variants: Sequence[Settings], number: int) -> list[Settings]:
    """The settings of one of several recordings."""
    return [
        {
            **each,
            **{
                key: each[key] + each.get(_key(number, key[0]), 0.0)
                for key in (*PER_RECORDING_STDS, BATTERY_RESISTANCE)
            },
        }
        for each in variants
    ]


def battery_resistances(settings: Settings, count: int) -> list[float]:
    """ohm, of the battery of each of so many recordings."""
    return [settings_of_recording([settings], number)[0][BATTERY_RESISTANCE] for number in range(count)]


def _coordinate(number: int, id_: str, size: Callable[[float], float], low: float) -> Coordinate:
    return Coordinate(
        f"{id_} of recording {number + 1}", (_key(number, id_),), size, low=low, high=MAX_BASE_STDS
    )


def _recording_numbers(count: int) -> range:
    return range(count if count > 1 else 0)


def _key(number: int, id_: str) -> Setting:
    return (RUN, str(number), id_)


def _resistance_change(nominal: float) -> Callable[[float], float]:
    return lambda u: nominal * math.expm1(RESISTANCE_LOG_STD * u)


def _scaled_by(width: float) -> Callable[[float], float]:
    return lambda u: width * u
