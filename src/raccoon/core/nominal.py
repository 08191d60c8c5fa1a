"""`[model]` of a robot.toml: the parameters of the simulation, each with its standard deviation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from typing import Any

from raccoon.core.errors import ConfigError
from raccoon.core.schema import (
    BATTERY_VOLTAGE,
    Bounds,
    Measured,
    format_value,
    measured,
    refuse_unknown,
    section,
    subtable,
)

INERTIA = Bounds(1e-12, 1e6)
"""kg m2. Wide, because a fit tries inertias that no robot has; the simulator reports which it cannot take."""


@dataclass(frozen=True, slots=True)
class BatteryModel:
    """`[model.battery]`."""

    open_circuit_voltage: Measured = measured(6.8, 0.03, "V", "voltage without load", BATTERY_VOLTAGE)
    internal_resistance: Measured = measured(0.05, 0.005, "ohm", "internal resistance", Bounds(0.0, 10.0))


@dataclass(frozen=True, slots=True)
class MotorModel:
    """`[model.motor]`; `[model.motor.left]` and `[model.motor.right]` override it."""

    armature_resistance: Measured = measured(
        1.8, 0.03, "ohm", "resistance of the winding", Bounds(0.01, 1000.0)
    )
    back_emf_constant: Measured = measured(
        1.08, 0.005, "V/(rad/s)", "K_E at the wheel shaft; also N m/A", Bounds(0.001, 100.0)
    )


@dataclass(frozen=True, slots=True)
class FrictionModel:
    """`[model.friction]`, at the wheel shaft."""

    coulomb: Measured = measured(0.18, 0.005, "N m", "torque that opposes any motion", Bounds(0.0, 100.0))
    viscous: Measured = measured(0.004, 0.0005, "N m s/rad", "torque per unit of speed", Bounds(0.0, 100.0))


@dataclass(frozen=True, slots=True)
class DriveModel:
    """`[model.drive]`."""

    inertia_straight: Measured = measured(
        0.020, 0.0006, "kg m2", "inertia that one motor feels when both turn in the same direction", INERTIA
    )
    inertia_turn: Measured = measured(
        0.014, 0.0005, "kg m2", "inertia that one motor feels when they turn against each other", INERTIA
    )
    wheel_radius: Measured = measured(0.0345, 0.0001, "m", "radius of a driven wheel", Bounds(0.001, 1.0))
    track_width: Measured = measured(
        0.16, 0.0008, "m", "distance between the wheels' contacts", Bounds(0.01, 10.0)
    )


@dataclass(frozen=True, slots=True)
class BemfModel:
    """`[model.bemf]`."""

    filter_time_constant: Measured = measured(
        0.0225,
        0.0005,
        "s",
        "lag of the back-EMF; at this default, the lag of a Wombat's own filter is used instead",
        Bounds(0.0, 1.0),
    )
    offset: Measured = measured(0.0, 1.0, "counts", "back-EMF reading at standstill", Bounds(-400.0, 400.0))


@dataclass(frozen=True, slots=True)
class ImuModel:
    """`[model.imu]`."""

    gyro_bias: Measured = measured(0.0, 0.0005, "rad/s", "what the gyro reads at rest", Bounds(-0.5, 0.5))
    gyro_scale: Measured = measured(1.0, 0.001, "", "reading over true turn rate", Bounds(0.5, 2.0))


@dataclass(frozen=True, slots=True)
class NominalModel:
    """`[model]`: the parameters of the simulation. Value and std are a prior for the diagnosis."""

    battery: BatteryModel = field(default_factory=BatteryModel)
    left: MotorModel = field(default_factory=MotorModel)
    right: MotorModel = field(default_factory=MotorModel)
    friction: FrictionModel = field(default_factory=FrictionModel)
    drive: DriveModel = field(default_factory=DriveModel)
    bemf: BemfModel = field(default_factory=BemfModel)
    imu: ImuModel = field(default_factory=ImuModel)


MODEL_SECTIONS: dict[str, type[Any]] = {
    "battery": BatteryModel,
    "motor": MotorModel,
    "friction": FrictionModel,
    "drive": DriveModel,
    "bemf": BemfModel,
    "imu": ImuModel,
}


def parse_model(table: Mapping[str, Any]) -> NominalModel:
    """Make the model of the table `[model]`. Raises ConfigError naming key, value and what is allowed."""
    refuse_unknown(table, tuple(MODEL_SECTIONS), "model")
    motor = dict(subtable(table, "motor", "model"))
    known = (*(each.name for each in fields(MotorModel)), "left", "right")
    refuse_unknown(motor, known, "model.motor")
    sides = {side: motor.pop(side, {}) for side in ("left", "right")}
    for side, entry in sides.items():
        if not isinstance(entry, Mapping):
            raise ConfigError(f"model.motor.{side} = {format_value(entry)}: it must be a table")
    built: dict[str, Any] = {
        key: section(kind, table.get(key, {}), f"model.{key}")
        for key, kind in MODEL_SECTIONS.items()
        if key != "motor"
    }
    for side, entry in sides.items():
        section(MotorModel, motor, "model.motor")  # so that an error names its own key
        built[side] = section(MotorModel, {**motor, **entry}, f"model.motor.{side}")
    return NominalModel(**built)
