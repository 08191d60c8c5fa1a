"""The findings on a motor from its trial: response, sign, speed, counter and offset."""

from __future__ import annotations

from raccoon.core.config import RobotConfig
from raccoon.core.schema import BATTERY_VOLTAGE
from raccoon.hal.doctor.report import Finding, Verdict
from raccoon.hal.doctor.session import mean
from raccoon.hal.doctor.trial import SILENT_COUNTS, STILL_TICKS, TRIAL_DUTY, MotorTrial
from raccoon.model.motor import steady_speed

OFFSET_LIMIT = 25.0
"""Largest difference between the back-EMF at rest and the offset in robot.toml, counts: a creep of about 2.6
mm/s with the default motor and wheel."""
SPEED_TOLERANCE = 0.4
"""Largest relative difference between the back-EMF and that of the model."""
SCALE_TOLERANCE = 0.2
"""Largest relative difference between the counter and the integrated back-EMF."""
LATENCY_LIMIT = 0.1
"""Longest time from the command to the first sign of motion, s."""


def judge_motor(config: RobotConfig, trial: MotorTrial) -> list[Finding]:
    """The findings on one motor: response, sign, speed, counter and offset."""
    subject = f"motor {trial.motor_port}"
    if not trial.has_moved:
        return [
            Finding(
                subject,
                Verdict.FAULT,
                f"no motion at duty {TRIAL_DUTY:g}",
                "the motor does not answer",
                "check that it is plugged in and turns freely; let a tripped fuse cool for a minute; if "
                "another wheel moved instead, the plugs or robot.toml's ports are mixed up",
                {"bemf_counts": trial.moves[0].bemf or 0.0, "ticks": trial.moves[0].ticks},
            )
        ]
    return [_response_finding(config, trial, subject), *_offset_finding(config, trial, subject)]


def _response_finding(config: RobotConfig, trial: MotorTrial, subject: str) -> Finding:
    forward = trial.moves[0]
    measured, values = _describe_trial(trial)
    problem, remedy = _sign_problem(trial) or _one_way_problem(trial) or ("", "")
    if problem:
        return Finding(subject, Verdict.FAULT, measured, problem, remedy, values)
    problem, remedy = _speed_problem(config, trial) or _counter_problem(trial) or ("", "")
    if not problem and forward.latency is not None and forward.latency > LATENCY_LIMIT:
        problem = f"it answered only after {1e3 * forward.latency:.0f} ms"
        remedy = "stop other programs; look for a sticking gear"
    verdict = Verdict.WARNING if problem else Verdict.OK
    return Finding(subject, verdict, measured, problem, remedy, values)


def _describe_trial(trial: MotorTrial) -> tuple[str, dict[str, float]]:
    forward, backward = trial.moves
    parts, values = [], {"ticks_forward": forward.ticks, "ticks_backward": backward.ticks}
    if forward.bemf is not None and backward.bemf is not None:
        parts.append(f"back-EMF {forward.bemf:+.0f} / {backward.bemf:+.0f} counts")
        values |= {"bemf_forward_counts": forward.bemf, "bemf_backward_counts": backward.bemf}
    parts.append(
        f"{forward.ticks:+.0f} / {backward.ticks:+.0f} ticks at duty {forward.duty:+g} / {backward.duty:+g}"
    )
    if forward.latency is not None:
        parts.append(f"answer after {1e3 * forward.latency:.0f} ms")
        values["latency"] = forward.latency
    return ", ".join(parts), values


def _sign_problem(trial: MotorTrial) -> tuple[str, str] | None:
    for move in trial.moves:
        if move.bemf is not None and move.bemf * move.duty < 0.0 and abs(move.bemf) > SILENT_COUNTS:
            return (
                "its back-EMF has the opposite sign of its command",
                "the firmware does not match robot.toml's controller.port, or the sense wires are crossed; "
                "do not close a speed loop on it",
            )
        if move.ticks * move.duty < 0.0 and abs(move.ticks) > STILL_TICKS:
            return ("its position counts against its command", "flash the matching firmware")
    return None


def _one_way_problem(trial: MotorTrial) -> tuple[str, str] | None:
    strengths = [abs(move.ticks if move.bemf is None else move.bemf) for move in trial.moves]
    if min(strengths) < 0.5 * max(strengths):
        weak = "forwards" if strengths[0] < strengths[1] else "backwards"
        return (
            f"it is weak {weak} (as the port counts)",
            "look for something that blocks it; try another port",
        )
    return None


def _speed_problem(config: RobotConfig, trial: MotorTrial) -> tuple[str, str] | None:
    readings = [abs(move.bemf) for move in trial.moves if move.bemf is not None]
    if trial.battery is None or trial.battery < BATTERY_VOLTAGE.low or not readings:
        return None
    expected = _expected_bemf(config, trial.motor_port, trial.battery) / trial.device.bemf_volts
    if abs(mean(readings) - expected) <= SPEED_TOLERANCE * expected:
        return None
    slower = "slower" if mean(readings) < expected else "faster"
    return (
        f"it is much {slower} than robot.toml's model says ({expected:.0f} counts)",
        "look for friction, a slipping gear or the wrong motor; otherwise fit the model of robot.toml",
    )


def _expected_bemf(config: RobotConfig, motor_port: int, battery: float) -> float:
    """Steady-state back-EMF in V at the trial's duty and `battery` V, by the model of robot.toml."""
    model = config.model
    motor = model.right if motor_port == config.drive.right else model.left
    constant = motor.back_emf_constant.value
    return constant * steady_speed(
        TRIAL_DUTY * battery,
        motor.armature_resistance.value,
        constant,
        model.friction.coulomb.value,
        model.friction.viscous.value,
    )


def _counter_problem(trial: MotorTrial) -> tuple[str, str] | None:
    """Problem and remedy if the counter did not advance by the integral of the back-EMF, in ticks of the
    firmware's nominal size; None if it did."""
    ticks = sum(abs(move.ticks) for move in trial.moves)
    integral = sum(abs(move.integral or 0.0) for move in trial.moves)
    if integral == 0.0:
        return None
    ratio = ticks * trial.device.position_counts_seconds / integral
    if abs(ratio - 1.0) <= SCALE_TOLERANCE:
        return None
    return (
        f"its position counter runs at {ratio:.2f} times the expected rate",
        "calibrate radians_per_tick of this motor in robot.toml; if it counts nothing, flash the firmware",
    )


def _offset_finding(config: RobotConfig, trial: MotorTrial, subject: str) -> list[Finding]:
    if trial.offset is None:
        return []
    known = config.motor(trial.motor_port).bemf_offset
    expected = config.model.bemf.offset.value if known is None else known.value
    measured = f"back-EMF {trial.offset:+.1f} counts, noise {trial.noise:.1f}"
    values = {"offset_counts": trial.offset, "noise_counts": trial.noise}
    subject = f"{subject} at rest"
    if abs(trial.offset - expected) <= OFFSET_LIMIT:
        return [Finding(subject, Verdict.OK, measured, values=values)]
    problem = f"robot.toml says {expected:+.1f}: the position creeps while the robot stands"
    remedy = (
        f"write bemf_offset = {{ value = {trial.offset:.1f}, std = {config.model.bemf.offset.std:g} }} "
        f"under [motor.{trial.motor_port}], if the robot stood still"
    )
    return [Finding(subject, Verdict.WARNING, measured, problem, remedy, values)]
