"""`raccoon tune wheels` and `raccoon calibrate motors` on the simulator."""

from pathlib import Path
from typing import Any

import pytest

from raccoon import open_robot
from raccoon.cli.main import main
from raccoon.cli.wheel_excitation import required_room
from raccoon.core.config import load_robot, parse_robot
from raccoon.core.readings import Inputs
from raccoon.robot.calibration.identification import excite
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.sim.world.table import World

ROBOT = '[controller]\nport = "sim"\n'


@pytest.fixture
def robot(tmp_path: Path) -> Path:
    path = tmp_path / "robot.toml"
    path.write_text(ROBOT)
    return path


def test_wheels_are_identified_and_their_margins_shown(
    robot: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["tune", "wheels", "--robot", str(robot)]) == 0
    said = capsys.readouterr().out
    assert "left wheel, motor port 0" in said
    assert "margins       65 deg" in said
    assert robot.read_text() == ROBOT


def test_the_voltages_are_written_and_used(robot: Path) -> None:
    assert main(["tune", "wheels", "--robot", str(robot), "--write"]) == 0
    motor = load_robot(robot).motor(1)
    assert motor.speed_voltage is not None
    assert motor.speed_voltage.value == pytest.approx(1.0867, rel=0.02)
    assert motor.speed_voltage.battery_voltage == pytest.approx(6.78, abs=0.05)
    assert motor.static_voltage is not None
    assert motor.static_voltage.value == pytest.approx(0.3, abs=0.05)


def test_static_k_is_stored_with_date_voltage_and_deviation(robot: Path) -> None:
    assert main(["calibrate", "motors", "--robot", str(robot), "--write"]) == 0
    factor = load_robot(robot).motor(0).power_factor
    assert factor.value == pytest.approx(1.0, abs=0.01)
    assert factor.std > 0.0
    assert factor.date is not None
    assert factor.battery_voltage is not None


def test_a_new_static_k_does_not_build_on_the_old_one(robot: Path) -> None:
    robot.write_text(ROBOT + "[motor.0]\npower_factor = 0.8\n")
    assert main(["calibrate", "motors", "--robot", str(robot), "--write"]) == 0
    assert load_robot(robot).motor(0).power_factor.value == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("words", [[], ["--port", "sim"]])
def test_values_of_the_simulated_robot_are_called_so(
    words: list[str], robot: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if words:
        robot.write_text("")
    assert main(["calibrate", "motors", "--robot", str(robot), *words]) == 0
    assert "the simulated robot's values" not in capsys.readouterr().out
    assert main(["calibrate", "motors", "--robot", str(robot), *words, "--write"]) == 0
    assert "the simulated robot's values" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("model", "says"),
    [({}, 0.3), ({"drive": {"wheel_radius": 0.05}}, 0.4), ({"battery": {"open_circuit_voltage": 12.0}}, 0.5)],
)
def test_the_room_that_is_named_holds_the_drive_of_this_robot(model: dict[str, Any], says: float) -> None:
    config = parse_robot({"model": model})
    port, farthest = SimPort(Parameters.from_robot(config), World.empty(), robot=config), 0.0

    def watched() -> Inputs:
        nonlocal farthest
        inputs = SimPort.read(port)
        assert inputs.truth is not None
        farthest = max(farthest, inputs.truth.x)
        return inputs

    port.read = watched  # type: ignore[method-assign]
    with open_robot(config, port=port) as driven:
        driven.run(excite())
    assert required_room(config) == says
    assert 0.6 * says < farthest < says


def test_the_help_says_that_it_drives_and_what_for(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["calibrate", "motors", "--help"])
    said = " ".join(capsys.readouterr().out.split())
    for part in (
        "within 0.3 m ahead, and back",
        "takes no recording",
        "make up for unequal motors without it",
    ):
        assert part in said


def test_what_cannot_be_written_is_refused_before_the_robot_moves(
    robot: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("os.access", lambda *_: False)
    assert main(["calibrate", "motors", "--robot", str(robot), "--write"]) == 2
    said = capsys.readouterr()
    assert "nothing can be written there: no permission" in said.err
    assert "moves" not in said.out
