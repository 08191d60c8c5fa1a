"""The complete examination of one port; each check follows those that it depends on."""

from __future__ import annotations

from collections.abc import Callable

from raccoon.core.config import Measured, RobotConfig
from raccoon.core.errors import HardwareError
from raccoon.core.port import Port
from raccoon.core.readings import Device
from raccoon.hal.doctor import link, motors, sensors
from raccoon.hal.doctor.report import Finding, Report, Verdict
from raccoon.hal.doctor.session import Session, session
from raccoon.hal.doctor.trial import MotorTrial, try_motor
from raccoon.hal.doctor.wiring import wiring_finding
from raccoon.model.bemf import foreign_ticks_reason

WARM_UP_S = 0.3
"""s after opening that are not judged: the filters of a controller that has just started are still
settling."""
REST_S = 1.0
"""s of rest that are recorded before anything moves."""


def _quiet(_: str) -> None:
    """Discard a progress message."""


def examine(
    port: Port, config: RobotConfig, *, move: bool = True, progress: Callable[[str], None] = _quiet
) -> Report:
    """Examine a port. The robot must stand still on the floor, with 20 cm of free space around it if `move`
    is set.

    A device that is lost on the way ends the examination with a finding, not with an error. The motors are
    stopped on every way out; the caller closes the port.
    """
    report = Report()
    try:
        with session(port) as running:
            _examine(running, port, config, report, move, progress)
    except HardwareError as error:
        report.add(lost_device_finding(error))
    return report


def lost_device_finding(error: HardwareError) -> Finding:
    """The finding for a device that cannot be opened or was lost."""
    pages = "see docs/hardware.md, for a Create docs/hardware-i2c-serial.md"
    return Finding("controller", Verdict.FAULT, "not reached", str(error), pages)


def _examine(
    running: Session,
    port: Port,
    config: RobotConfig,
    report: Report,
    move: bool,
    progress: Callable[[str], None],
) -> None:
    progress("listening")
    running.run(WARM_UP_S)
    running.cycles.clear()
    rest = running.run(REST_S)
    report.add(link.identity_finding(rest))
    report.add(
        *sensors.imu_findings(config, rest),
        *sensors.analog_findings(config, rest),
        sensors.button_findings(rest, config.bumpers),
    )
    at_rest = len(running.cycles)
    if move:
        _try_motors(running, config, report, progress)
    else:
        report.add(Finding("motors", Verdict.NOT_CHECKED, "nothing was moved"))
    report.add(
        sensors.battery_finding(rest, running.cycles[at_rest:]),
        *_calibration_findings(config, rest[-1].device),
    )
    # A bad link makes everything else look bad, so it is reported first.
    report.findings[1:1] = [
        link.rate_findings(config, running.cycles, port),
        *link.fault_findings(running.cycles),
    ]


def _try_motors(
    running: Session, config: RobotConfig, report: Report, progress: Callable[[str], None]
) -> None:
    """Move the driven wheels and judge them. Other motors are not moved: they may press an arm against its
    end."""
    trials: dict[int, MotorTrial] = {}
    for side, motor_port in (("left", config.drive.left), ("right", config.drive.right)):
        progress(f"moving the {side} wheel (motor {motor_port})")
        trials[motor_port] = try_motor(running, motor_port)
        report.add(*motors.judge_motor(config, trials[motor_port]))
    report.add(wiring_finding(config, trials))
    for motor_port in sorted(set(config.motors) - set(trials)):
        report.add(Finding(f"motor {motor_port}", Verdict.NOT_CHECKED, "not moved: it is not a driven wheel"))


def _calibration_findings(config: RobotConfig, device: Device) -> list[Finding]:
    """The finding on the calibrated values of robot.toml that override its [model]: a fault if they belong to
    another firmware, because programs refuse to drive with those."""
    found = [
        f"motor.{port}.{key}{_format_date(getattr(motor, key))}"
        for port, motor in sorted(config.motors.items())
        for key in motor.before_model()
    ]
    if not found:
        return []
    told = f"{', '.join(found)}: programs go by these before what [model] says"
    foreign = [each for side in ("left", "right") if (each := foreign_ticks_reason(config, side, device))]
    if not foreign:
        return [Finding("calibrations", Verdict.NOT_CHECKED, told)]
    remedy = "calibrate again (raccoon calibrate drive), or take the lines out"
    return [Finding("calibrations", Verdict.FAULT, told, "; ".join(foreign), remedy)]


def _format_date(value: Measured) -> str:
    return "" if value.date is None else f" ({value.date})"
