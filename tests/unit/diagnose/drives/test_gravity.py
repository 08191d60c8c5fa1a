"""Accelerometers in other units than m/s2, told by the gravity that they all feel."""

from __future__ import annotations

import numpy as np
import pytest

from raccoon.diagnose.drives.gravity import describe_wrong_acceleration


def felt(factor: float, gravity: float = 9.81, tilt: float = 0.1) -> dict[str, np.ndarray]:
    """A robot that speeds up and brakes, on a board that leans."""
    rng, time = np.random.default_rng(1), 0.005 * np.arange(2000)
    drive = 3.0 * np.sign(np.sin(2.0 * time))
    axes = {"x": drive + gravity * np.sin(tilt), "y": 0.0 * time, "z": gravity * np.cos(tilt) + 0.0 * time}
    noisy = {
        f"imu.accel.{name}": factor * (each + 0.2 * rng.standard_normal(2000)) for name, each in axes.items()
    }
    return {"t": time, **noisy}


@pytest.mark.parametrize(
    ("factor", "said"),
    [
        (1.0 / 9.81, "it looks like g, not m/s2"),
        (1000.0 / 9.81, "it looks like thousandths of g, not m/s2"),
        (16384.0 / 9.81, "it looks like the sensor's own counts, not m/s2"),
        (2048.0 / 9.81, "it looks like the sensor's own counts, not m/s2"),
        (3.28, "is it in m/s2"),
    ],
)
def test_another_unit_is_said(factor: float, said: str) -> None:
    assert said in describe_wrong_acceleration(felt(factor))


def test_nothing_is_said_of_what_is_right_or_feels_no_gravity() -> None:
    columns = felt(1.0)
    assert describe_wrong_acceleration(columns) == ""
    assert describe_wrong_acceleration(felt(1.05)) == ""
    assert describe_wrong_acceleration(felt(1.0, gravity=0.0)) == ""  # a logger that takes it out
    assert (
        describe_wrong_acceleration({name: each for name, each in columns.items() if "z" not in name}) == ""
    )
    assert describe_wrong_acceleration({"t": columns["t"]}) == ""
