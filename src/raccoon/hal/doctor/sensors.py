"""The findings on IMU, analog ports, buttons and battery, from a second of rest and the motor trials after
it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from raccoon.core.config import BumperConfig, RobotConfig
from raccoon.core.readings import (
    ANALOG_BOTTOM,
    ANALOG_PORTS,
    ANALOG_TOP,
    DIGITAL_PORTS,
    GRAVITY,
    Fault,
    Inputs,
)
from raccoon.hal.create.port import CREATE_2
from raccoon.hal.doctor.report import Finding, Verdict
from raccoon.hal.doctor.session import correlation, deviation, mean, port_words, scaled_vectors

GRAVITY_TOLERANCE = 0.05
"""Largest difference between the measured gravity and 1 g, in g."""
UPRIGHT_COSINE = 0.94
"""Cosine of the largest tilt, 20 degrees: no floor is steeper."""
BIAS_LIMIT = 0.09
"""Largest difference between the gyro's bias and that in robot.toml, rad/s. The IMU's data sheet allows 5
deg/s without calibration."""
STILL_LIMIT = 0.05
"""Largest standard deviation of the turn rate while the robot stands, rad/s."""
FROZEN_AFTER = 0.5
"""s of equal gyro readings after which the gyro is frozen."""
FLOATING_COUNTS = 40.0
"""Standard deviation in counts above which an analog port may float: a connected sensor at rest stays below
it, unless lamps flicker."""
MAINS_READINGS, CALM_COUNTS = 10, 10.0
"""Readings in each mean, a number that averages out lamps on mains of 50 and of 60 Hz; standard deviation of
these means, counts, above which a port of a large standard deviation floats."""
FOLLOWING_CORRELATION = 0.9
"""Correlation with a neighbouring port above which an analog port only echoes it."""
_FOLLOWS_FROM = 5.0
"""Standard deviation in counts from which the correlation is tested."""
_WOMBAT_VOLTS = (6.0, 6.4, 8.6)  # unreliable below, charge below, impossible above (two lithium cells)
_CREATE_VOLTS = (12.5, 13.5, 18.0)  # twelve NiMH cells
SAG_LIMIT = 1.0
"""Largest drop of the battery voltage under load, V."""


def imu_findings(config: RobotConfig, rest: Sequence[Inputs]) -> list[Finding]:
    """The findings on gyro and accelerometer: alive, 1 g, upright, bias close to that of robot.toml."""
    device = rest[-1].device
    rates = scaled_vectors(rest, "gyro", device.gyro_rad_s)
    forces = scaled_vectors(rest, "accel", device.accel_m_s2)
    if not rates and not forces:
        return [_missing_imu_finding(rest)]
    return [_gyro_finding(config, rest, rates), _accel_finding(forces)]


def _missing_imu_finding(rest: Sequence[Inputs]) -> Finding:
    if rest[-1].device is CREATE_2:
        return Finding("imu", Verdict.NOT_CHECKED, "this base has none")
    remedy = "restart the controller; if it stays, its IMU is broken: add one on I2C"
    faults = {fault for each in rest for fault in each.faults}
    if Fault.IMU_IMPLAUSIBLE in faults:
        problem = (
            "its readings are impossible (they sweep or are far from 1 g), or the controller stands on edge"
        )
        remedy = f"put the robot on its wheels; {remedy}"
        return Finding("imu", Verdict.FAULT, "left out by the port", problem, remedy)
    if Fault.IMU_FROZEN in faults:
        problem = "its readings stand still, or it is missing"
        return Finding("imu", Verdict.FAULT, "left out by the port", problem, remedy)
    return Finding("imu", Verdict.FAULT, "none", "the controller delivers no IMU readings", remedy)


def _gyro_finding(config: RobotConfig, rest: Sequence[Inputs], rates: Sequence[tuple[float, ...]]) -> Finding:
    if not rates:
        return Finding("gyro", Verdict.FAULT, "none", "no turn rates", "restart the controller")
    turn = [rate[2] for rate in rates]
    bias, noise = mean(turn), deviation(turn)
    seconds = max(rest[-1].time - rest[0].time, 1e-9)
    measured = f"bias {bias:+.4f} rad/s, noise {noise:.4f}, {len(rates) / seconds:.0f} readings a second"
    values = {"bias": bias, "noise": noise, "rate_hz": len(rates) / seconds}
    known = config.model.imu.gyro_bias.value
    problem = remedy = ""
    if seconds > FROZEN_AFTER and len(rates) > 2 and len(set(rates)) == 1:
        problem, remedy = "it repeats one reading: it is frozen", "restart the controller"
    elif noise > STILL_LIMIT:
        problem = "its turn rate drifts while the robot stands"
        remedy = (
            "keep the robot still; if it stays, update the firmware (old boards sweep) or add an IMU on I2C"
        )
    elif abs(bias - known) > BIAS_LIMIT:
        problem = f"its bias is far from robot.toml's {known:+.4f} rad/s"
        remedy = f"keep the robot still and run again; then write gyro_bias = {bias:.4f} under [model.imu]"
    return Finding("gyro", Verdict.FAULT if problem else Verdict.OK, measured, problem, remedy, values)


def _accel_finding(forces: Sequence[tuple[float, ...]]) -> Finding:
    if not forces:
        return Finding("accelerometer", Verdict.FAULT, "none", "no readings", "restart the controller")
    x, y, z = (mean([force[axis] for force in forces]) for axis in range(3))
    total = math.hypot(x, y, z)
    measured = f"{total / GRAVITY:.3f} g, upright {z / max(total, 1e-9):.2f}"
    values = {"x": x, "y": y, "z": z}
    problem = remedy = ""
    if abs(total / GRAVITY - 1.0) > GRAVITY_TOLERANCE:
        problem = "gravity is not 1 g"
        remedy = (
            "keep the robot still; if the problem stays, the IMU is broken or not the one that the "
            "firmware expects"
        )
    elif z < -UPRIGHT_COSINE * total:
        problem = "it is upside down"
        remedy = "put the robot on its wheels; for an added IMU correct its axes"
    elif z < UPRIGHT_COSINE * total:
        problem, remedy = (
            "the robot is not level",
            "put it on level ground; for an added IMU correct its axes",
        )
    return Finding(
        "accelerometer", Verdict.FAULT if problem else Verdict.OK, measured, problem, remedy, values
    )


def analog_findings(config: RobotConfig, rest: Sequence[Inputs]) -> list[Finding]:
    """One finding for each analog port; only ports that robot.toml uses must have a good reading."""
    users = {tophat.analog: name for name, tophat in config.tophats.items()}
    series = [port_words(rest, "analog", port) for port in range(ANALOG_PORTS)]
    return [_analog_port(port, series, users.get(port)) for port in range(ANALOG_PORTS)]


def _analog_port(port: int, series: Sequence[Sequence[float]], user: str | None) -> Finding:
    subject = f"analog {port}" + (f" ({user})" if user else "")
    readings = series[port]
    if not readings:
        return _port_finding(subject, user, "none", "no reading", "check the controller", {})
    level, noise = mean(readings), deviation(readings)
    measured, values = (
        f"{level:.0f} counts, noise {noise:.1f}",
        {"level_counts": level, "noise_counts": noise},
    )
    plug = "check that the sensor is plugged in and its plug is the right way round"
    if not ANALOG_BOTTOM < level < ANALOG_TOP:
        return _port_finding(
            subject, user, measured, "it is saturated", f"{plug}; shade it from strong light", values
        )
    # Whole means only: a shorter one at the end would not average the lamps out.
    ends = range(MAINS_READINGS, len(readings) + 1, MAINS_READINGS)
    calm = [mean(readings[end - MAINS_READINGS : end]) for end in ends] or readings
    if noise > FLOATING_COUNTS and deviation(calm) > CALM_COUNTS:
        return _port_finding(
            subject, user, measured, "it floats: nothing seems to be plugged in", plug, values
        )
    neighbour = _find_followed_port(port, series, noise)
    if neighbour is not None:
        problem = f"it follows analog {neighbour}: nothing seems to be plugged in"
        return _port_finding(subject, user, measured, problem, plug, values)
    return Finding(subject, Verdict.OK if user else Verdict.NOT_CHECKED, measured, values=values)


def _port_finding(
    subject: str, user: str | None, measured: str, problem: str, remedy: str, values: dict[str, float]
) -> Finding:
    """A finding on a port with a problem. If robot.toml does not use the port (`user` is None), it is no
    fault; the problem is only mentioned."""
    if user is None:
        return Finding(subject, Verdict.NOT_CHECKED, f"{measured} ({problem}; unused)", values=values)
    return Finding(subject, Verdict.FAULT, measured, problem, remedy, values)


def _find_followed_port(port: int, series: Sequence[Sequence[float]], noise: float) -> int | None:
    """The neighbouring port whose signal this port repeats, as an open pin does; None if there is none.
    noise: standard deviation of this port, counts."""
    if noise < _FOLLOWS_FROM:
        return None
    for neighbour in (port - 1, port + 1):
        if not 0 <= neighbour < len(series) or not series[neighbour]:
            continue
        louder = deviation(series[neighbour]) > noise  # of two similar signals, the weaker one is the echo
        if louder and correlation(series[port], series[neighbour]) > FOLLOWING_CORRELATION:
            return neighbour
    return None


def button_findings(rest: Sequence[Inputs], bumpers: Mapping[str, BumperConfig]) -> Finding:
    """The finding that lists the pressed digital ports, with the names of bumpers; only the team knows which
    of them should be pressed."""
    last = rest[-1].digital
    if all(flag is None for flag in last):
        return Finding("digital", Verdict.NOT_CHECKED, "none")
    pressed = [port for port in range(DIGITAL_PORTS) if last[port]]
    names = {bumper.digital: f" (bumper {name})" for name, bumper in bumpers.items()}
    listed = ", ".join(f"{port}{names.get(port, '')}" for port in pressed) or "none"
    return Finding("digital", Verdict.OK, f"pressed: {listed}", values={"pressed": float(len(pressed))})


def battery_finding(rest: Sequence[Inputs], moving: Sequence[Inputs]) -> Finding:
    """The finding on the battery: voltage at rest in `rest`, and its largest drop under load in `moving`."""
    volts = [volt for volt in (each.battery_voltage for each in rest) if volt is not None]
    if not volts:
        return Finding("battery", Verdict.FAULT, "none", "no reading of the battery", "check the controller")
    level = mean(volts)
    loaded = [volt for volt in (each.battery_voltage for each in moving) if volt is not None]
    sag = level - min(loaded) if loaded else 0.0
    measured = f"{level:.2f} V" + (f", drops by {sag:.2f} V" if loaded else "")
    verdict, problem, remedy = _battery_problem(rest[-1], level, sag)
    return Finding("battery", verdict, measured, problem, remedy, {"voltage": level, "sag": sag})


def _battery_problem(inputs: Inputs, level: float, sag: float) -> tuple[Verdict, str, str]:
    unreliable, low, high = _CREATE_VOLTS if inputs.device is CREATE_2 else _WOMBAT_VOLTS
    if level > high:
        return Verdict.FAULT, f"above {high} V: no battery for this controller", "use the right battery"
    if level < unreliable:
        return Verdict.FAULT, f"below {unreliable} V the controller is unreliable", "charge the battery"
    if level < low:
        return Verdict.WARNING, "it is almost empty", "charge the battery"
    if sag > SAG_LIMIT:
        return (
            Verdict.WARNING,
            "it drops too far under load",
            "clean the battery plug; replace an old battery",
        )
    return Verdict.OK, "", ""
