"""Scale of a board's back-EMF words, radians a count, and lag of its filter behind the motor.

A motor's counter is the integral of its back-EMF, so both share one scale, radians a (count · second)::

    calibrated:   radians_per_tick / device.position_counts_seconds
    otherwise:    device.bemf_volts / K_E           (back-EMF in volts is K_E times speed)
"""

from __future__ import annotations

import math

from raccoon.core.config import MotorConfig, RobotConfig
from raccoon.core.readings import Device

MAX_K_E_RATIO = 10.0
"""Ratio to robot.toml's K_E, up or down, from which ticks are those of another counter: no motor, gear or
wheel differs that much."""


def is_plausible_k_e_share(share: float) -> bool:
    """Whether a motor may have this share of robot.toml's K_E (0.5 to 2). Ticks with another share are those
    of another counter, or a mistake."""
    return 0.5 < share < 2.0


def counts_scale(robot: RobotConfig, side: str, device: Device) -> float:
    """Radians of the `side` ("left" or "right") wheel per back-EMF count · second, without its wiring
    sign."""
    motor = robot.wheel_motor(side)
    return radians_per_count(motor, getattr(robot.model, side).back_emf_constant.value, device)


def radians_per_count(motor: MotorConfig, back_emf_constant: float, device: Device) -> float:
    """Radians of any motor's shaft per back-EMF count · second, without its wiring sign.

    back_emf_constant: V/(rad/s), for a motor that is not calibrated.
    """
    if motor.radians_per_tick is not None:
        return motor.radians_per_tick.value / device.position_counts_seconds
    return device.bemf_volts / back_emf_constant


def foreign_ticks_reason(robot: RobotConfig, side: str, device: Device) -> str:
    """Why the `radians_per_tick` of a driven motor cannot be this device's; "" if they can be, or if there
    are none."""
    ticks, constant = robot.wheel_motor(side).radians_per_tick, getattr(robot.model, side).back_emf_constant
    share = device.bemf_volts / constant.value / counts_scale(robot, side, device)
    if ticks is None or 1.0 / MAX_K_E_RATIO < share < MAX_K_E_RATIO:
        return ""
    return (
        f"motor.{getattr(robot.drive, side)}.radians_per_tick is {ticks.value:.3g}, where a tick of "
        f"{device.name} is about {ticks.value * share:.3g}: it was calibrated with another firmware, or has "
        "a digit in the wrong place"
    )


def counter_lag(time_constant: float, sample_time: float) -> float:
    """Lag of a counter, s, over the filtered back-EMF: the angle now is counter + lag * filtered speed.

    The filter f += (1 - k) (raw - f) with k = exp(-sample_time / time_constant) sums to sum(raw) = sum(f) + k
    / (1 - k) f. The sum of samples, each weighted by the time since the last one, is half a sample ahead of
    the angle. If the filter is so fast that the lag would be negative, it is 0. time_constant, sample_time:
    s.
    """
    # At half of the sample time the lag is negative already; the exponential below overflows for a tiny one.
    if time_constant <= 0.5 * sample_time:
        return 0.0
    return max(sample_time / math.expm1(sample_time / time_constant) - 0.5 * sample_time, 0.0)
