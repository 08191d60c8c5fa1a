"""Probes: free curves over a covariate, for effects outside the catalogue.

The covariate is the wheel's angle, the place, the speed and others; the curve is a torque at a wheel or is
added to a sensor's reading. The robot forgets a torque within 0.1 s, so the response to a torque that varies
more slowly is the response to a constant one times the curve: no further simulation is needed.

Angles and places are integrated from readings, corrected by the working point's settings: with a remaining
offset of two counts a wheel turned 2 rad too far in 40 s, and a motor that cogs was not found. Speeds are the
simulated ones: a curve over a reading would contain that reading's own noise, and so explain it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from raccoon.core.errors import TraceError
from raccoon.diagnose.drives.features import SETTLING_S
from raccoon.diagnose.drives.log import StepChange
from raccoon.diagnose.fit.linear_model import LinearModel, coulomb_response
from raccoon.diagnose.fit.problem import Problem
from raccoon.diagnose.hypotheses.coordinates import Settings
from raccoon.diagnose.unknown.sensor_probes import (
    UNKNOWN_PREFIX,
    WHEEL_SPEED_UNIT,
    Probe,
    gyro_speed_probes,
    hat_functions,
    sensor_time_probes,
)
from raccoon.diagnose.unknown.step_change import change_probes, find_step_change
from raccoon.diagnose.unknown.wheel_waves import (
    bemf_counts_per_speed,
    sines_and_cosines,
    torque_waves,
    wheel_angle,
)
from raccoon.sim.effects.parameters import SIDES, Parameters
from raccoon.sim.effects.physical import wiring_signs

Array = NDArray[np.float64]

POSITION, SPEED = "position", "speed"
INERTIA = "drive.inertia"
INERTIA_GROWTH = "growth of inertia"
USUAL_TORQUE = 0.03
"""Prior standard deviation in N m of a torque over a place, a heading, a speed or time."""
USUAL_WAVE_TORQUE = 0.0075
"""Prior standard deviation in N m of each wave over a wheel's angle: so many are free that with four times as
much causes had a tenth less evidence in 8 s."""
MIN_WAVE_LOG_EVIDENCE, FLOOR_TORQUE_SHARE, FLOOR_FRICTION_SHARE, MIN_LARGE_WAVE_LOG_EVIDENCE = (
    60.0,
    0.05,
    0.08,
    14.0,
)
"""Gates of a torque or a friction over a wheel's angle: MIN_WAVE_LOG_EVIDENCE if its wave is below the
respective share of robot.toml's friction, up to which a floor produces it, and MIN_LARGE_WAVE_LOG_EVIDENCE
for a larger torque. A robot that drives there and back on a line has the same floor at the same angle: with
friction that varies by 2 % within 4 to 20 cm nine of 60 drives had 10 of a torque, or 14 to 29 of a friction,
with waves of 1.5 to 5 %; with a floor that pushes by 1.7 % two of 14 had 16 and 21 of a torque of about as
much; on one of the blind robots a larger torque had 11. Of ten wheels that rub by a fourth of their friction,
waves of 12 to 20 %, one had 27 in 40 s, and the others 41 and more."""
FRICTION_STEPS = 16
"""Number of parts of a drive between which friction may change: with eight parts, motors that get hot were
named on a robot that took a load. Of 24 blind robots with slowly varying friction, it explained nothing on
any."""
FRICTION_OVER_TIME = "time (friction)"


@dataclass(frozen=True, slots=True)
class _TorqueCurve:
    """A torque at both wheels over a covariate. friction: whether it opposes the motion."""

    name: str
    friction: bool
    curves: Array
    over: Array
    over_unit: str


@dataclass(frozen=True, slots=True)
class Motion:
    """The robot's motion by bins. Arrays (bins,) or (bins, 2), left before right; SI units; speed and angle
    are those of the wheels."""

    speed: Array
    angle: Array
    heading: Array
    x: Array
    y: Array
    time: Array


def estimate_motion(problem: Problem, settings: Settings) -> Motion | None:
    """Estimate the motion from back-EMF (or speeds) and gyro with the settings of a working point; None if a
    wheel is not measured."""
    features = problem.features
    speed = _measured_wheel_speeds(problem, features.measured, settings)
    if speed is None:
        return None
    drive = problem.robot.model.drive
    way = speed * [
        drive.wheel_radius.value * settings[("drive.wheel_radius", side, "factor")] for side in SIDES
    ]
    track = drive.track_width.value * settings[("drive.track_width", None, "factor")]
    rate = (way[:, 1] - way[:, 0]) / track
    if "gyro" in features.roles:
        scale = problem.robot.model.imu.gyro_scale.value * settings[("imu.gyro_scale", None, "factor")]
        since = features.time - features.time[0] + SETTLING_S
        drift = settings[("imu.gyro_drift", None, "rate_per_second")] * since
        bias = settings[("imu.gyro_bias", None, "rate")] + drift
        rate = (features.measured[:, features.roles.index("gyro")] - bias) / scale
    heading = np.cumsum(rate) * features.width
    forward = way.mean(axis=1) * features.width
    return Motion(
        speed,
        np.cumsum(speed, axis=0) * features.width,
        heading,
        np.cumsum(forward * np.cos(heading)),
        np.cumsum(forward * np.sin(heading)),
        features.time,
    )


def _measured_wheel_speeds(problem: Problem, readings: Array, settings: Settings) -> Array | None:
    """Speeds (bins, 2) in rad/s from readings (bins, channels) with the settings of a working point; None if
    a wheel is not measured."""
    roles, columns = problem.features.roles, []
    signs = wiring_signs(Parameters.from_robot(problem.robot))
    for side, sign in zip(SIDES, signs, strict=True):
        if f"speed_{side}" in roles:
            columns.append(readings[:, roles.index(f"speed_{side}")])
        elif f"bemf_{side}" in roles:
            offset = sign * settings[("bemf.offset", side, "counts")]
            counts = readings[:, roles.index(f"bemf_{side}")] - offset
            columns.append(counts / bemf_counts_per_speed(problem, settings, side))
    return np.column_stack(columns) if len(columns) == 2 else None


def make_probe_function(problem: Problem) -> Callable[[LinearModel], Sequence[Probe]]:
    """The function from a working point to a recording's probes, whose curves and responses depend on it."""

    def probes(linear: LinearModel) -> Sequence[Probe]:
        settings = problem.settings(linear.point)
        motion = estimate_motion(problem, settings)
        wheels = _measured_wheel_speeds(problem, problem.features.measured - linear.residual, settings)
        if motion is None or wheels is None:
            return ()
        if not np.isfinite(wheels).all():
            raise TraceError(
                "with this robot.toml and these commands the simulation gives no finite numbers: are ports, "
                "[motor.N] inverted and [model] those of the robot that was recorded?"
            )
        speed = np.abs(wheels).mean(axis=1)
        over_speed = _TorqueCurve(SPEED, True, hat_functions(speed, 6), speed, WHEEL_SPEED_UNIT)
        over_time = [_friction_over_time(motion.time)] if problem.friction_may_change else []
        torques = [*_torque_curves(motion), *over_time, over_speed]
        return [
            *_wheel_probes(problem, settings, motion, wheels),
            *_torque_probes(problem, linear, motion, torques),
            *_inertia_probes(problem, linear, motion),
            *gyro_speed_probes(problem.features, wheels),
            *sensor_time_probes(problem.features, motion.time),
            *change_probes(problem, settings, wheels),
        ]

    return probes


def _torque_curves(motion: Motion) -> list[_TorqueCurve]:
    found: list[_TorqueCurve] = []
    for name, along in (("x", motion.x), ("y", motion.y)):
        count = int(np.clip((along.max() - along.min()) / 0.08, 4, 24))
        found.append(
            _TorqueCurve(f"{POSITION} {name}", True, hat_functions(along, count) - 1.0 / count, along, "m")
        )
    heading = motion.heading
    found.append(_TorqueCurve("heading", False, sines_and_cosines(heading, 3), _wrap_angle(heading), "rad"))
    return found


def _friction_over_time(time: Array) -> _TorqueCurve:
    """Friction that changes in steps over time, as on a robot that picked something up."""
    return _TorqueCurve(
        FRICTION_OVER_TIME,
        True,
        _step_functions(time, np.arange(1, FRICTION_STEPS) / FRICTION_STEPS),
        time,
        "s",
    )


def _step_functions(time: Array, parts: Array) -> Array:
    """Steps (parts, n): 1 from each of these shares of the whole time on, 0 before."""
    share = (time - time[0]) / max(time[-1] - time[0], 1e-9)
    return np.asarray(share[None] >= parts[:, None], float)


def _wrap_angle(angle: Array) -> Array:
    """The angle modulo one turn, rad."""
    return np.asarray(np.mod(angle, 2.0 * np.pi), float)


def _wheel_probes(problem: Problem, settings: Settings, motion: Motion, speeds: Array) -> list[Probe]:
    """speeds (bins, 2): simulated, of the wheels, rad/s."""
    per_share = problem.robot.model.friction.coulomb.value / USUAL_WAVE_TORQUE
    found = []
    for wheel, side in enumerate(SIDES):
        angle = wheel_angle(problem, settings, motion.angle[:, wheel], wheel)
        for friction in (False, True):
            waves = torque_waves(problem, settings, angle, speeds, wheel, friction)
            found.append(
                Probe(
                    f"{UNKNOWN_PREFIX}wheel angle {side}{' (friction)' if friction else ''}",
                    USUAL_WAVE_TORQUE * waves.columns,
                    quantity="friction" if friction else "torque forward", unit="N m",
                    over=_wrap_angle(angle), over_unit="rad", curves=USUAL_WAVE_TORQUE * waves.curves,
                    parts=waves.parts, min_lead=MIN_WAVE_LOG_EVIDENCE,
                    usual=(FLOOR_FRICTION_SHARE if friction else FLOOR_TORQUE_SHARE) * per_share,
                    min_lead_if_larger=0.0 if friction else MIN_LARGE_WAVE_LOG_EVIDENCE,
                )
            )  # fmt: skip
    return found


def _torque_probes(
    problem: Problem, linear: LinearModel, motion: Motion, torques: Sequence[_TorqueCurve]
) -> list[Probe]:
    responses = _torque_responses(problem, linear)
    if responses is None:
        return []
    found = []
    for each in torques:
        total = np.zeros((len(each.curves), *linear.residual.shape))
        for wheel in (0, 1):
            course = each.curves if each.friction else -each.curves * np.sign(motion.speed[:, wheel])
            total += course[:, :, None] * responses[wheel][None]
        kind = "friction of each wheel" if each.friction else "torque forward"
        found.append(
            Probe(
                UNKNOWN_PREFIX + each.name, USUAL_TORQUE * total, quantity=kind, unit="N m", over=each.over,
                over_unit=each.over_unit, curves=USUAL_TORQUE * each.curves,
                over_place=each.name.startswith(POSITION),
            )
        )  # fmt: skip
    return found


def _torque_responses(problem: Problem, linear: LinearModel) -> tuple[Array, Array] | None:
    """Responses to 1 N m of Coulomb friction at the left and at the right wheel."""
    left, right = (coulomb_response(problem, linear, side) for side in ("left", "right"))
    return None if left is None or right is None else (left, right)


def _inertia_probes(problem: Problem, linear: LinearModel, motion: Motion) -> list[Probe]:
    column = linear.column(INERTIA)
    if column is None:
        return []
    steps = _step_functions(motion.time, np.arange(0.0, 1.0, 0.125))
    (coordinate,) = problem.causes[INERTIA].coordinates
    width = math.log(coordinate.value(1.0))
    return [
        Probe(
            UNKNOWN_PREFIX + "time (inertia)", steps[:, :, None] * column[None], quantity=INERTIA_GROWTH,
            unit="%", over=motion.time, over_unit="s", curves=width * steps,
        )
    ]  # fmt: skip


def find_change(problem: Problem, linear: LinearModel) -> StepChange | None:
    """The step change of the drive, from the residual at a working point; None if no change is certain."""
    features = problem.features
    predicted = features.measured - linear.residual
    wheels = _measured_wheel_speeds(problem, predicted, problem.settings(linear.point))
    if problem.change is not None or wheels is None or "gyro" not in features.roles:
        return None
    gyro = linear.residual[:, features.roles.index("gyro")]
    return find_step_change(features.time, gyro, dict(zip(SIDES, wheels.T, strict=True)))
