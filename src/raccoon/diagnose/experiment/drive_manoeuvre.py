"""Drives a planned manoeuvre through a port and records it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.port import Port
from raccoon.core.readings import MOTOR_PORTS, STOP, Outputs
from raccoon.diagnose.experiment.manoeuvres import RATE

Tell = Callable[[str], object]


def drive_duties(
    port: Port, robot: RobotConfig, duty: NDArray[np.float64], tell: Tell = lambda _: None
) -> int:
    """Command duty (n, 2), planned at 200 Hz, by the port's own clock; returns the number of cycles.

    tell: called with a warning before anything moves if the battery is weak. The motors are stopped at the
    end, also if the port fails.
    """
    signs = [-1.0 if robot.motor(each).inverted else 1.0 for each in (robot.drive.left, robot.drive.right)]
    cycles, start = 0, None
    try:
        while True:
            inputs = port.read()
            if start is None:
                start = inputs.time
                _warn_of_weak_battery(inputs.battery_voltage, robot, tell)
            row = int((inputs.time - start) * RATE + 0.5)
            if row >= len(duty):
                return cycles
            port.write(_make_outputs(robot, signs, duty[row]))
            cycles += 1
    finally:
        port.write(STOP)


def _make_outputs(robot: RobotConfig, signs: list[float], pair: NDArray[np.float64]) -> Outputs:
    duty = [0.0] * MOTOR_PORTS
    duty[robot.drive.left] = signs[0] * float(pair[0])
    duty[robot.drive.right] = signs[1] * float(pair[1])
    return Outputs(duty=tuple(duty))


def drive_and_record(
    robot: RobotConfig,
    duty: NDArray[np.float64],
    path: str | Path,
    port: Port | None = None,
    tell: Tell = lambda _: None,
    seed: int | None = None,
) -> None:
    """Drive and write a recording to `path`. port: by default robot.toml's; it is closed at the end, also if
    a signal ends the program. tell: as in `drive_duties`. seed: of a simulated port, which is recorded.
    Raises FileExistsError if the recording exists."""
    from raccoon.robot.loop import stopped_on_exit
    from raccoon.robot.opening import open_port
    from raccoon.trace.record import RecordingPort

    opened = open_port(robot) if port is None else port
    with stopped_on_exit(opened.close):
        recording = RecordingPort(opened, path, config=robot, seed=seed)
        with stopped_on_exit(recording.close):
            drive_duties(recording, robot, duty, tell)


def _warn_of_weak_battery(voltage: float | None, robot: RobotConfig, say: Tell) -> None:
    from raccoon.robot.calibration.battery_check import describe_weak_battery

    if voltage is not None and (why := describe_weak_battery(voltage, robot)):
        say(f"battery: {why}, or the controller may restart during the drive")
