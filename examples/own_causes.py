"""Causes of your own for `raccoon diagnose run.csv --causes own_causes.py`: what no catalogue lists."""

import numpy as np
from numpy.typing import NDArray

from raccoon.core.schema import Bounds
from raccoon.diagnose.own import OwnEffect, Simulated, Values
from raccoon.sim.effects.effect import Parameter

Array = NDArray[np.float64]


def hum(drive: Simulated, values: Values) -> dict[str, Array]:
    """The gyro hears the motors: what the sensors would say without it is in drive.readings."""
    speed = 0.5 * np.abs(drive.readings["bemf_left"] + drive.readings["bemf_right"])
    return {"gyro": drive.readings["gyro"] + values["gain"] * speed / 1000.0}


def slow(time: Array, duty: Array, values: Values) -> Array:
    """A driver that takes its time: power follows the command with a lag of the first order."""
    given = duty.copy()
    for row in range(1, len(time)):
        share = 1.0 - np.exp(-(time[row] - time[row - 1]) / max(values["seconds"], 1e-6))
        given[row] = given[row - 1] + share * (duty[row] - given[row - 1])
    return given


CAUSES = [
    OwnEffect(
        "team.motor_hum",
        "The motors disturb the gyro by {gain:.4f} rad/s at 1000 counts: mount it away from them.",
        (Parameter("gain", "rad/s", 0.0, Bounds(-1.0, 1.0), 0.02),),
        readings=hum,
        needs=("gyro", "bemf_left", "bemf_right"),
    ),
    OwnEffect(
        "team.slow_driver",
        "The motors' power follows the command {seconds:.3f} s late and softly: is it a soft start?",
        (Parameter("seconds", "s", 0.0, Bounds(0.0, 0.5), 0.02),),
        commands=slow,
    ),
]

if __name__ == "__main__":
    for each in CAUSES:  # checked when they are made: what is wrong with one is said here
        print(f"{each.id}: {each.told(each.neutral())}")
