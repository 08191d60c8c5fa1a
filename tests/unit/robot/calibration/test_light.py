"""The start light from a team's program: calibrated, rehearsed, waited for."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from raccoon import (
    CalibrationError,
    MotionTimeout,
    button_pressed,
    calibrate_light,
    open_robot,
    rehearse_light,
    run_match,
    wait,
    wait_for,
    wait_for_light,
)
from raccoon.core.errors import ConfigError
from raccoon.core.port import Port
from raccoon.core.readings import Inputs
from raccoon.core.sections import ControllerConfig
from raccoon.estimate.start_light import StartLightCalibration
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.port import SimPort
from robots import CONFIG, InterceptingPort

PORT = 5


class Lamp(InterceptingPort):
    """A port with a light sensor on an analog input: counts by time."""

    def __init__(self, counts: Callable[[float], float | None], port: Port | None = None) -> None:
        super().__init__(port, seen=self._lit)
        self._counts = counts

    def _lit(self, inputs: Inputs) -> Inputs:
        analog = list(inputs.analog)
        analog[PORT] = self._counts(inputs.time)
        return replace(inputs, analog=tuple(analog))


def test_calibrate_rehearse_and_start() -> None:
    def counts(time: float) -> float:
        on = 1.0 < time < 2.2 or 4.0 < time < 4.5 or 6.0 < time < 6.5 or time > 10.0
        flash = 8.0 < time < 8.015
        return 200.0 if on or flash else 3000.0

    with open_robot(CONFIG, port=Lamp(counts)) as robot:
        found = calibrate_light(robot, PORT, lambda: None)
        assert (found.off, found.on) == (3000.0, 200.0)
        robot.run(wait(0.5))
        assert robot.run(rehearse_light(PORT, found, seconds=6.5)) == 2
        report = run_match(robot, wait(0.1), start=wait_for_light(PORT, found), seconds=5.0)
        assert robot.time - report.seconds == pytest.approx(10.04, abs=0.02)


def test_a_lamp_that_makes_no_difference_is_said() -> None:
    with (
        open_robot(CONFIG, port=Lamp(lambda _: 3000.0)) as robot,
        pytest.raises(CalibrationError, match="shade the sensor"),
    ):
        calibrate_light(robot, PORT, lambda: None)


def test_too_much_light_is_said_in_the_rehearsal() -> None:
    with open_robot(CONFIG, port=Lamp(lambda _: 60.0)) as robot:
        assert robot.run(rehearse_light(PORT, seconds=1.0)) == 0
        assert any("too bright" in said for said in robot.drive.remarks.values())


@pytest.mark.parametrize("kind", ["sim", "emulator"])
def test_over_a_simulated_robot_somebody_switches_the_lamp_on(kind: str, tmp_path: Path) -> None:
    """Asked by a press of the button, as on the table; what is recorded of it is no other robot's."""
    config = replace(CONFIG, controller=ControllerConfig(port=kind))
    with open_robot(config, record=tmp_path / "run") as robot:
        found = calibrate_light(robot, PORT, lambda: robot.run(wait_for(button_pressed())))
        assert (found.off, found.on) == pytest.approx((3000.0, 300.0), rel=0.02)
        asked = robot.time
        robot.run(wait_for_light(PORT, found).timeout(5.0))
        assert robot.time - asked == pytest.approx(2.05, abs=0.08)
        assert robot.run(rehearse_light(PORT, seconds=2.5)) == 1
        assert not robot.drive.remarks


def test_a_tophat_is_no_sensor_of_the_start_light() -> None:
    """A program would wait at it for ever. It is said before a match begins."""
    port = CONFIG.tophats["left"].analog
    with open_robot(CONFIG, port=SimPort(Parameters.from_robot(CONFIG))) as robot:
        for attempt in (
            lambda: robot.run(wait_for_light(port)),
            lambda: robot.run(rehearse_light(port)),
            lambda: calibrate_light(robot, port, lambda: None),
        ):
            with pytest.raises(ConfigError, match=f"analog port {port} belongs to tophat left in robot.toml"):
                attempt()
        assert robot.inputs is None  # nothing was waited for


def test_a_rehearsal_takes_time() -> None:
    with pytest.raises(ValueError, match="seconds is 0"):
        rehearse_light(PORT, seconds=0.0)
    with pytest.raises(TypeError, match="seconds is '3': it must be a number, above 0"):
        rehearse_light(PORT, seconds="3")  # type: ignore[arg-type]


def test_light_that_stays_and_is_no_lamp_is_said_once_and_then_the_lamp_starts() -> None:
    def counts(time: float) -> float:
        if time > 5.0:
            return 100.0
        return 3000.0 - 1900.0 * min(max(time - 1.0, 0.0) / 0.8, 1.0)

    with open_robot(CONFIG, port=Lamp(counts)) as robot:
        robot.run(wait_for_light(PORT))
        assert robot.time == pytest.approx(5.105, abs=0.01)
        said = [each for each in robot.drive.remarks.values() if "start light" in each]
        assert len(said) == 1
        assert "analog 5" in said[0]
        assert "calibrate_light" in said[0]


def test_too_much_light_is_said_while_waiting() -> None:
    with open_robot(CONFIG, port=Lamp(lambda _: 60.0)) as robot:
        with pytest.raises(MotionTimeout):
            robot.run(wait_for_light(PORT).timeout(1.0))
        assert any("too bright" in said for said in robot.drive.remarks.values())


@pytest.mark.parametrize("gap", [0.03, 0.05, 0.1])
def test_start_light_is_seen_where_the_link_is_silent_as_it_comes_on(gap: float) -> None:
    def counts(time: float) -> float | None:
        if 2.0 <= time < 2.0 + gap:
            return None
        return 500.0 if time >= 2.0 else 3000.0

    with open_robot(CONFIG, port=Lamp(counts)) as robot:
        robot.run(wait_for_light(PORT, StartLightCalibration(3000.0, 500.0)).timeout(5.0))
        assert 2.03 < robot.time < 2.06 + 2.0 * gap


def test_wires_that_touch_while_waiting_start_nothing_and_are_said() -> None:
    with open_robot(CONFIG, port=Lamp(lambda time: 3000.0 if time < 1.0 else 0.0)) as robot:
        with pytest.raises(MotionTimeout):
            robot.run(wait_for_light(PORT).timeout(1.5))
        assert any("wires that touch" in said for said in robot.drive.remarks.values())
