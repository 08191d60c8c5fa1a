"""Plausibility of a calibration: impossible values are refused, surprising ones reported."""

from __future__ import annotations

import math
from collections.abc import Sequence

from raccoon.core.config import Measured, RobotConfig
from raccoon.core.errors import CalibrationError
from raccoon.core.readings import Device
from raccoon.estimate.drive.prior import scale_std
from raccoon.estimate.ekf.state import OdometrySettings
from raccoon.model.bemf import counts_scale, is_plausible_k_e_share

SURPRISING_STDS, ALIKE_SHARE = 3.0, 0.03
"""Threshold, in standard deviations, on the difference to robot.toml that is reported; and the relative
difference of both wheels' errors below which one tape is taken for the cause of both."""


def check_plausible(robot: RobotConfig, side: str, device: Device, value: Measured, cause: str) -> None:
    """Raise CalibrationError if a side's radians per tick are impossible. cause: what to check."""
    factor = _ratio_to_config(robot, side, device, value)
    if not is_plausible_k_e_share(factor):
        port = getattr(robot.drive, side)
        told = "has the wrong sign" if factor < 0.0 else f"is {factor:.2f} times the expected one"
        raise CalibrationError(
            f"radians_per_tick of the {side} motor (port {port}) {told}: check {cause} and "
            f"[motor.{port}] inverted"
        )


def describe_surprises(
    robot: RobotConfig, device: Device, found: Sequence[Measured], distance: float | None = None
) -> tuple[str, ...]:
    """Remarks on the radians per tick of left and right that differ from robot.toml by more than its standard
    deviations allow.

    distance: m, if the scale depends on a single taped distance.
    """
    settings = OdometrySettings()
    said, shares = [], []
    for side, value in zip(("left", "right"), found, strict=True):
        share = _ratio_to_config(robot, side, device, value)
        known = math.hypot(scale_std(robot, settings, side), value.std / value.value)
        shares.append(share)
        off = abs(share - 1.0) / known
        if off > SURPRISING_STDS:
            said.append(
                f"radians_per_tick of the {side} motor (port {getattr(robot.drive, side)}) is {share:.3f} "
                f"times what robot.toml says, {off:.1f} of its standard deviations off: was this motor or "
                "wheel changed, or the tape misread?"
            )
    if len(said) == 2 and abs(shares[0] / shares[1] - 1.0) < ALIKE_SHARE:
        share = 0.5 * (shares[0] + shares[1])
        went = "" if distance is None else f", so the robot drove {distance / share:.3f} m, not {distance:g}"
        again = "the tape again" if distance is not None else "the tape and its times again, or the reference"
        return (
            f"both motors' radians_per_tick are {share:.3f} times what robot.toml says{went}: read {again}",
        )
    return tuple(said)


def expected_distance(
    robot: RobotConfig, device: Device, found: Sequence[Measured], distance: float
) -> float:
    """m that robot.toml's radians a tick make of a drive whose `distance` m gave those of left and right."""
    shares = [
        _ratio_to_config(robot, side, device, value)
        for side, value in zip(("left", "right"), found, strict=True)
    ]
    return 2.0 * distance / sum(shares)


def _ratio_to_config(robot: RobotConfig, side: str, device: Device, value: Measured) -> float:
    return value.value / (counts_scale(robot, side, device) * device.position_counts_seconds)
