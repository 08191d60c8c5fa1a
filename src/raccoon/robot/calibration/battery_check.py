"""A check before the start: is this the battery that the program was tuned with, and will it last?"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from raccoon.core.config import RobotConfig
from raccoon.core.errors import CalibrationError
from raccoon.robot.actions.actions import Action, Steps
from raccoon.robot.actions.limits import check_positive
from raccoon.robot.remarks import add_remark

if TYPE_CHECKING:
    from raccoon.robot.robot import Robot

READING_TIME_S = 0.3
MAX_TOLERANCE_V = 1.0
"""V; largest tolerance, more than the paper's batteries differ. A larger one is the voltage itself."""


@dataclass(frozen=True, slots=True)
class BatteryCheck:
    """The resting battery compared with the one that the program was tuned with.

    voltage: V at rest, None without a reading. tuned_at: V, None if unknown. speed_change: how much faster
    (0.1: 10 %) a program without control runs now. ok: whether there is nothing to complain about. advice: a
    sentence for people.
    """

    voltage: float | None
    tuned_at: float | None
    speed_change: float
    ok: bool
    advice: str

    def __str__(self) -> str:
        """For people: its advice."""
        return self.advice


def tuned_voltage(config: RobotConfig) -> float | None:
    """V at which the program was tuned, by robot.toml: `battery.tuned_at`, else the voltage of the
    calibrations."""
    if config.battery.tuned_at is not None:
        return config.battery.tuned_at.value
    seen = [
        value.battery_voltage
        for port in (config.drive.left, config.drive.right)
        for value in (config.motor(port).radians_per_tick, config.motor(port).power_factor)
        if value is not None and value.battery_voltage is not None
    ]
    return sum(seen) / len(seen) if seen else None


def check_battery(tolerance: float = 0.15, *, refuse: bool = False) -> Action[BatteryCheck]:
    """Stand for 0.3 s and compare the resting battery with the one that the program was tuned at.

    tolerance: V, up to 1. refuse: raise CalibrationError instead of only reporting it in the result,
    recording and log. Raises ValueError for a tolerance that is not allowed, such as the voltage itself.
    """
    check_positive("tolerance", tolerance)
    if tolerance > MAX_TOLERANCE_V:
        raise ValueError(
            f"tolerance is {tolerance:g}: allowed are numbers above 0, up to {MAX_TOLERANCE_V:g} V "
            "(battery.tuned_at of robot.toml is the voltage)"
        )

    def steps(robot: Robot) -> Steps[BatteryCheck]:
        begin = robot.time
        while robot.time - begin < READING_TIME_S:
            yield
        check = judge_voltage(robot.battery_voltage, robot.config, tolerance)
        if check.ok:
            robot.note(f"battery: {check.advice}")
        else:
            add_remark(robot, f"battery: {check.advice}")
        if refuse and not check.ok:
            raise CalibrationError(check.advice)
        return check

    return Action("check the battery", steps)


def judge_voltage(voltage: float | None, config: RobotConfig, tolerance: float) -> BatteryCheck:
    """The verdict on a resting voltage (V)."""
    tuned = tuned_voltage(config)
    if voltage is None:
        return BatteryCheck(None, tuned, 0.0, False, "there is no battery reading")
    change = 0.0 if tuned is None else _speed_change(voltage, tuned, config)
    if advice := describe_weak_battery(voltage, config, tolerance):
        return BatteryCheck(voltage, tuned, change, False, advice)
    if tuned is None:
        return BatteryCheck(
            voltage, None, 0.0, True, f"{voltage:.2f} V; the voltage it was tuned at is unknown"
        )
    if abs(voltage - tuned) > tolerance:
        advice = (
            f"{voltage:.2f} V, tuned at {tuned:.2f} V: timed motions run {100.0 * abs(change):.0f} % "
            f"{'faster' if change > 0.0 else 'slower'}; take a battery of {tuned:.2f} V or drive by distance"
        )
        return BatteryCheck(voltage, tuned, change, False, advice)
    return BatteryCheck(voltage, tuned, change, True, f"{voltage:.2f} V, as tuned ({tuned:.2f} V)")


def describe_weak_battery(voltage: float, config: RobotConfig, tolerance: float = 0.15) -> str:
    """Advice for a resting voltage (V) that is too low to begin a match; "" if it is not."""
    weakest = config.battery.weakest
    if voltage >= weakest - tolerance:
        return ""
    return f"{voltage:.2f} V is below the weakest battery of the match ({weakest:.2f} V): charge it"


def _speed_change(voltage: float, tuned: float, config: RobotConfig) -> float:
    """Relative change of a free wheel's speed at full power: (U - R I_0) over the same at the tuned voltage,
    with the friction current I_0 = T_c / K_E."""
    motor = config.model.left
    lost = motor.armature_resistance.value * config.model.friction.coulomb.value
    lost /= motor.back_emf_constant.value
    return (voltage - lost) / (tuned - lost) - 1.0
