"""Checks that columns are a recording, and determines its kind."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.errors import ConfigError, TraceError
from raccoon.diagnose.recordings.motors.diagnosis import motor_ports
from raccoon.diagnose.recordings.motors.step_response import step_port
from raccoon.trace.recording import as_float_column, check_lengths

Columns = Mapping[str, NDArray[np.float64]]

MIN_DRIVE_S = 2.0
"""Shortest drive with voltages at both wheels, s."""


class Kind(StrEnum):
    """The kind of a recording."""

    DRIVE = "drive"
    """A two-wheel drive with its commands."""
    MOTORS = "motors"
    """Single motors or axes: force, torque or voltage in, motion out."""
    STEP = "step"
    """One motor under a single constant power."""
    GEOMETRY = "geometry"
    """Wheel angles and a reference of the pose, without commands."""
    TOPHATS = "tophats"
    """Reflectance sensors alone."""
    NOTHING = "nothing"
    """Nothing with which the simulation can be compared."""


def as_float_columns(columns: Any) -> dict[str, NDArray[np.float64]]:
    """Columns as arrays of floats; lists and integers are converted.

    Raises TraceError for anything but a mapping of names to numbers.
    """
    if not isinstance(columns, Mapping):
        more = ": give its columns" if hasattr(columns, "columns") else ""
        more = ": give its recording.columns" if hasattr(columns, "recording") else more
        given = type(columns).__name__
        raise TraceError(f"a recording is columns of numbers by their names, not a {given}{more}")
    return {name: as_float_column(name, each) for name, each in columns.items()}


def check_robot(robot: Any) -> None:
    """Raise ConfigError for anything but a RobotConfig, such as None: a CSV does not describe its robot."""
    if not isinstance(robot, RobotConfig):
        given = "None" if robot is None else f"{robot!r:.60}"
        raise ConfigError(
            f'robot is {given}: it must be a RobotConfig, as load_robot("robot.toml") gives; '
            "RobotConfig() is the default robot"
        )


def kind_of(columns: Columns, robot: RobotConfig) -> Kind:
    """The kind of a recording, by its columns. Raises TraceError for a recording without samples or with a
    column that is not as long as t."""
    if "t" not in columns or len(columns["t"]) == 0:
        raise TraceError("the recording is empty: it has no samples with a time t")
    check_lengths(columns)
    ports = (robot.drive.left, robot.drive.right)
    if step_port(columns) is not None:
        return Kind.STEP
    if all(_has_readings(columns, f"motor.{port}.duty") for port in ports):
        return Kind.DRIVE
    motors = motor_ports(columns)
    if motors and not _is_drive(columns, ports):
        return Kind.MOTORS
    if all(_has_readings(columns, f"motor.{port}.voltage") for port in ports):
        return Kind.DRIVE
    if any(name.endswith(".duty") for name in columns):
        return Kind.DRIVE
    wheels = all(
        any(_has_readings(columns, f"motor.{port}.{kind}") for kind in ("position", "bemf")) for port in ports
    )
    if wheels and _has_readings(columns, "truth.x"):
        return Kind.GEOMETRY
    if not wheels and any(name.startswith("analog.") for name in columns):
        return Kind.TOPHATS
    return Kind.NOTHING


def _has_readings(columns: Columns, name: str) -> bool:
    return name in columns and bool(np.isfinite(columns[name]).any())


def _is_drive(columns: Columns, ports: tuple[int, int]) -> bool:
    """Whether it is a drive by voltage commands: both wheels have voltages, for long enough, without
    currents."""
    seconds = float(np.ptp(columns["t"]))
    both = all(_has_readings(columns, f"motor.{port}.voltage") for port in ports)
    currents = any(_has_readings(columns, f"motor.{port}.current") for port in ports)
    return both and not currents and seconds >= MIN_DRIVE_S
