"""The start light before a match: its calibration and a rehearsal."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from raccoon.core.errors import ConfigError
from raccoon.core.port import bystander_of
from raccoon.core.readings import ANALOG_PORTS, Inputs, Status
from raccoon.robot.actions.actions import Action, Steps, wait
from raccoon.robot.actions.condition import Check
from raccoon.robot.actions.limits import check_function, check_kind, check_limit, check_port, check_robot
from raccoon.robot.calibration.calibration_drives import collect_inputs
from raccoon.robot.remarks import add_remark

if TYPE_CHECKING:
    from raccoon.estimate.start_light import StartLightCalibration, StartLightReading
    from raccoon.robot.robot import Robot

READING_S = 1.0  # of readings with the lamp off, and on
SIMULATED_LAMP = 3000.0, 300.0
"""Counts with a simulated lamp off and on if no calibration gives them."""


def calibrate_light(robot: Robot, port: int, switched_on: Callable[[], object]) -> StartLightCalibration:
    """Measure what the sensor on analog `port` reads with the lamp off and on, for `wait_for_light`. Call it
    with the lamp off.

    switched_on: called once; returns when someone has switched the lamp on (such as `lambda: input("lamp on,
    then Enter")`). A simulated lamp is on then. The result is noted in the recording. Raises CalibrationError
    if the lamp makes too little difference or the port reads nothing, ValueError if the port does not exist,
    TypeError if `switched_on` is not a function.
    """
    check_robot(robot, "calibrate_light()")
    robot.require("calibrate_light()")
    check_port("analog", port, ANALOG_PORTS)
    check_function(switched_on, "calibrate_light()")
    no_tophat(port)(robot)
    from raccoon.estimate.start_light import calibrate_start_light

    simulate_lamp(robot, port, lit=False)
    off = _collect_counts(robot, port)
    switched_on()
    simulate_lamp(robot, port, lit=True)
    found = calibrate_start_light(off, _collect_counts(robot, port))
    robot.note(f"start light on analog {port}: {found.off:.0f} counts off, {found.on:.0f} on")
    return found


def rehearse_light(
    port: int, calibration: StartLightCalibration | None = None, *, seconds: float = 20.0
) -> Action[int]:
    """Test mode of the start light: how often the lamp was seen to go on within `seconds` s.

    Each time is noted in the recording, and nothing starts. It reports if it is too bright to see the lamp,
    or if light that stays on is ignored. Raises ValueError for a time that is not above 0 or longer than 600
    s, and for a port that does not exist; TypeError for a time that is not a number and for anything that is
    not a calibration.
    """
    check_lamp(port, calibration)
    check_limit(seconds=seconds)

    def steps(robot: Robot) -> Steps[int]:
        from raccoon.estimate.start_light import StartLight

        light = StartLight(calibration, rehearsal=True)
        simulate_lamp(robot, port, calibration)
        begin = robot.time
        while robot.time - begin < seconds:
            reading = light.update(robot.time, light_counts(robot, port))
            if reading.fired:
                robot.note(f"rehearsal: start light {light.fires}")
            tell_light(robot, port, reading)
            yield
        return light.fires

    return Action(f"rehearse the light on analog {port}", steps, no_tophat(port))


def check_lamp(port: int, calibration: StartLightCalibration | None) -> None:
    """Raise ValueError if the port does not exist, TypeError if the lamp is not a calibration of a start
    light."""
    check_port("analog", port, ANALOG_PORTS)
    if calibration is not None:
        from raccoon.estimate.start_light import StartLightCalibration

        check_kind(
            calibration,
            StartLightCalibration,
            f"analog {port}: calibration",
            "; calibrate_light(...) makes one",
        )


def no_tophat(port: int) -> Check:
    """A check that raises ConfigError if analog `port` is a tophat's: it looks at the floor and would never
    see the light."""

    def check(robot: Robot) -> None:
        for name, each in robot.config.tophats.items():
            if each.analog == port:
                raise ConfigError(
                    f"analog port {port} belongs to tophat {name} in robot.toml: give the port of the "
                    "sensor for the start light"
                )

    return check


def light_counts(robot: Robot, port: int) -> float | None:
    """Counts of this cycle, None if it had none: repeating the previous counts would look like steady
    light."""
    return None if robot.inputs is None else robot.inputs.analog[port]


def tell_light(robot: Robot, port: int, reading: StartLightReading) -> None:
    """Report what keeps the start light on analog `port` from being seen."""
    if reading.refused:
        add_remark(
            robot,
            f"analog {port}: it became bright and stayed bright, but not the way a start light does: no "
            "start. If it was the lamp, run calibrate_light (again)",
        )
    if reading.shorted:
        add_remark(
            robot,
            f"analog {port}: it reads the bottom of the scale, which no light causes: no start. Look for "
            "wires that touch, and for a plug that is reversed or one hole off",
        )
    elif reading.status is Status.UNCERTAIN:
        add_remark(robot, f"analog {port}: too bright to recognize the start light; shade the sensor")


def simulate_lamp(
    robot: Robot, port: int, calibration: StartLightCalibration | None = None, *, lit: bool | None = None
) -> None:
    """Put a lamp over the sensor of a simulated robot that reads as the calibration says: on, off, or (None)
    switched on soon. Does nothing on a real robot."""
    somebody = bystander_of(robot.port)
    if somebody is None:
        return
    off, on = SIMULATED_LAMP if calibration is None else (calibration.off, calibration.on)
    somebody.hold_lamp(port, off, on, lit=lit)


def _collect_counts(robot: Robot, port: int) -> list[float]:
    readings: list[Inputs] = []
    robot.run(collect_inputs(wait(READING_S), readings))
    return [counts for each in readings if (counts := each.analog[port]) is not None]
