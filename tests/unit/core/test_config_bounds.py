"""Every number of a robot.toml has bounds, and a robot can be made and read at both of them."""

import math
import re
from collections.abc import Iterator
from dataclasses import fields
from typing import Any

import pytest

from raccoon.core.config import parse_robot
from raccoon.core.errors import ConfigError
from raccoon.core.nominal import MODEL_SECTIONS
from raccoon.core.schema import Bounds
from raccoon.core.sections import (
    BatteryConfig,
    BodyConfig,
    ControllerConfig,
    MechanismConfig,
    MotionConfig,
    MotorConfig,
)
from raccoon.robot.actions.actions import wait
from raccoon.robot.opening import open_robot

SECTIONS: dict[str, type[Any]] = {
    "controller": ControllerConfig,
    "body": BodyConfig,
    "battery": BatteryConfig,
    "motor.0": MotorConfig,
    "mechanism.arm": MechanismConfig,
    "motion": MotionConfig,
    **{f"model.{name}": kind for name, kind in MODEL_SECTIONS.items()},
}


def numbers() -> Iterator[tuple[str, Bounds, str]]:
    """Each key that takes a number, its bounds and its unit."""
    for section, kind in SECTIONS.items():
        for each in fields(kind):
            if "bounds" in each.metadata and type(each.default) is not int:  # an int is a port
                yield f"{section}.{each.name}", each.metadata["bounds"], each.metadata["unit"]


def table(key: str, value: float) -> dict[str, Any]:
    """The tables of a robot.toml with one key."""
    made: Any = value
    for name in reversed(key.split(".")):
        made = {name: made}
    found: dict[str, Any] = made
    found.setdefault("controller", {})["port"] = "sim"
    return found


@pytest.mark.parametrize(("key", "bounds", "unit"), list(numbers()), ids=str)
def test_a_robot_is_made_at_both_bounds_and_refused_beyond(key: str, bounds: Bounds, unit: str) -> None:
    assert math.isfinite(bounds.low)
    assert math.isfinite(bounds.high)
    for value in (bounds.low, bounds.high):
        robot = parse_robot(table(key, value))
        try:
            with open_robot(robot) as opened:
                opened.run(wait(0.1))
                assert math.isfinite(opened.estimate.x)
        except ConfigError as error:  # no simulated robot is so light or has such magnets
            assert "mechanical time constant" in str(error)  # noqa: PT017
    for value in (math.nextafter(bounds.low, -math.inf), math.nextafter(bounds.high, math.inf), 10**400):
        with pytest.raises(
            ConfigError, match=f"^{key} = .*: allowed are {re.escape(f'{bounds} {unit}'.rstrip())}$"
        ):
            parse_robot(table(key, value))
