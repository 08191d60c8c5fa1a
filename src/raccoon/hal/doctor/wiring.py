"""The check of the wiring signs: a wheel that is driven alone turns the robot, and the gyro shows in which
direction and how fast.

The left wheel, driven forward, turns the robot clockwise (negative), the right one counter-clockwise
(positive). The robot turns about the other wheel, which stands still, so its turn rate is the wheel's angular
velocity times the wheel radius over the track width.

If left and right are exchanged and both are reversed, the robot turns as it should, but drives backwards.
Only the accelerometer shows that.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping

from raccoon.core.config import RobotConfig
from raccoon.hal.doctor.report import Finding, Verdict
from raccoon.hal.doctor.session import mean
from raccoon.hal.doctor.trial import MotorMove, MotorTrial
from raccoon.model.bemf import counts_scale, foreign_ticks_reason

TURN_LIMIT = 0.05
"""Turn rate of the robot, rad/s, from which one driven wheel shows its direction."""
BACKWARDS_LIMIT = -0.05
"""m/s2, mean of the moves, below which a wheel that is driven forward accelerates the robot backwards."""
MIN_SHARE, MAX_SHARE = 0.6, 1.6
"""Range of the ratio of the gyro's turn rate to the wheels': K_E, radius and track width in robot.toml may be
wrong by that much. A gyro whose full scale is not the nominal one of the firmware is off by 2."""


def wiring_finding(config: RobotConfig, trials: Mapping[int, MotorTrial]) -> Finding:
    """The finding that compares the signs in robot.toml with the gyro's turn rates. trials: by motor port."""
    sides = {"left": (config.drive.left, -1.0), "right": (config.drive.right, 1.0)}
    turns = {side: _wheel_turn_rate(config, trials.get(port)) for side, (port, _) in sides.items()}
    seen = {side: turn for side, turn in turns.items() if turn is not None}
    if any(abs(turn) < TURN_LIMIT for turn in seen.values()) or len(seen) < 2:
        return Finding(
            "wiring signs",
            Verdict.NOT_CHECKED,
            "the robot did not turn, or has no gyro",
            remedy="put it on the floor and run the doctor again",
            values={f"turn_rate_{side}": turn for side, turn in seen.items()},
        )
    measured = ", ".join(f"{side} wheel forward: {turn:+.2f} rad/s" for side, turn in seen.items())
    values = {f"turn_rate_{side}": turn for side, turn in seen.items()}
    wrong = [side for side, (_, sign) in sides.items() if seen[side] * sign < 0.0]
    if not wrong:
        if (ahead := _acceleration(config, trials)) is not None and ahead < BACKWARDS_LIMIT:
            return _backwards_finding(measured, ahead, values)
        shares = [_gyro_share(config, side, trials[port], seen[side]) for side, (port, _) in sides.items()]
        known = [share for share in shares if share is not None]
        if known and not MIN_SHARE < mean(known) < MAX_SHARE:
            return _off_scale_finding(measured, mean(known), values)
        return Finding("wiring signs", Verdict.OK, measured, values=values)
    problem, remedy = _advice(config, wrong)
    return Finding("wiring signs", Verdict.FAULT, measured, problem, remedy, values)


def _wheel_turn_rate(config: RobotConfig, trial: MotorTrial | None) -> float | None:
    """The robot's mean turn rate, rad/s, while this wheel is commanded forward, from both moves of its trial;
    None without a trial or without a gyro."""
    return None if trial is None else _forward_mean(config, (trial,), lambda move: move.turn_rate)


def _acceleration(config: RobotConfig, trials: Mapping[int, MotorTrial]) -> float | None:
    """The robot's mean acceleration ahead, m/s2, when a wheel starts forward; None without an accelerometer.
    That of its turning, where the IMU is beside the middle of the axle, is opposite for the two wheels."""
    return _forward_mean(config, trials.values(), lambda move: move.acceleration)


def _forward_mean(
    config: RobotConfig, trials: Iterable[MotorTrial], reading: Callable[[MotorMove], float | None]
) -> float | None:
    """Mean reading of all moves of some trials, reversed for moves that robot.toml calls backward; None if
    there is no reading."""
    found = []
    for trial in trials:
        inverted = config.motor(trial.motor_port).inverted
        for move in trial.moves:
            if (value := reading(move)) is not None:
                found.append(value if (move.duty > 0.0) is not inverted else -value)
    return mean(found) if found else None


def _gyro_share(config: RobotConfig, side: str, trial: MotorTrial, turn: float) -> float | None:
    """Ratio of the gyro's turn rate to the wheel's; None without back-EMF, or if the calibration in
    robot.toml belongs to another firmware."""
    readings = [abs(move.bemf) for move in trial.moves if move.bemf is not None]
    if not readings or mean(readings) == 0.0 or foreign_ticks_reason(config, side, trial.device):
        return None
    drive, per_count = config.model.drive, counts_scale(config, side, trial.device)
    return abs(turn) * drive.track_width.value / (mean(readings) * per_count * drive.wheel_radius.value)


def _backwards_finding(measured: str, ahead: float, values: Mapping[str, float]) -> Finding:
    return Finding(
        "wiring signs",
        Verdict.WARNING,
        measured,
        f"the robot accelerates backwards ({ahead:+.2f} m/s2) when a wheel is driven forward",
        "watch which way it drives: if it is backwards, the motors are exchanged and both plugged in the "
        "other way round (exchange drive.left and drive.right in robot.toml, and change `inverted` of both "
        "motors); if it is forwards, the controller is mounted with its front to the back",
        {**values, "acceleration": ahead},
    )


def _off_scale_finding(measured: str, share: float, values: Mapping[str, float]) -> Finding:
    return Finding(
        "wiring signs",
        Verdict.WARNING,
        measured,
        f"the gyro sees {share:.2f} times the turn that the wheels read",
        "turn the robot by hand through one full turn: if the gyro does not sum up to 360 degrees, its "
        "scale is wrong (a factor of 2 is another full-scale range: write gyro_scale under [model.imu] in "
        "robot.toml); if it does, track_width and wheel_radius under [model.drive] or the motors' K_E are "
        "wrong",
        {**values, "gyro_over_wheels": share},
    )


def _advice(config: RobotConfig, wrong: list[str]) -> tuple[str, str]:
    if len(wrong) == 2:
        return (
            "both wheels turn the robot the wrong way",
            "watch which wheel moves first: if it is the right one, exchange drive.left and drive.right "
            "in robot.toml; if it is the left one and it turns backwards, change `inverted` of both "
            "motors; if the wheels are correct, the IMU is mounted upside down",
        )
    port = config.drive.left if wrong[0] == "left" else config.drive.right
    now = str(config.motor(port).inverted).lower()
    turned = "false" if config.motor(port).inverted else "true"
    return (
        f"the {wrong[0]} wheel turns backwards",
        f"set inverted = {turned} under [motor.{port}] in robot.toml (it is {now}), or turn its plug round",
    )
