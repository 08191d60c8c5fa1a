"""robot.toml is read, or refused with file, key, value and what is allowed."""

from datetime import date
from pathlib import Path

import pytest

from raccoon.core.config import (
    BumperConfig,
    DriveConfig,
    Measured,
    MechanismConfig,
    MotorConfig,
    RobotConfig,
    ServoConfig,
    TophatConfig,
    load_robot,
    template,
)
from raccoon.core.errors import ConfigError

EXAMPLE = """
name = "drumbot"
[controller]
port = "wombat"
[drive]
left = 0
right = 1
[motor.0]
inverted = false
radians_per_tick = { value = 0.00388, std = 0.00004, date = 2026-03-01, battery_voltage = 6.7 }
[tophat.front_left]
analog = 0
forward = 0.11
left = 0.02
[model.battery]
open_circuit_voltage = { value = 6.8, std = 0.03 }
internal_resistance = 0.05
[model.motor]
armature_resistance = { value = 1.8, std = 0.03 }
[model.motor.left]
back_emf_constant = 1.107
"""


def write(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "robot.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_documented_file_is_read(tmp_path: Path) -> None:
    robot = load_robot(write(tmp_path, EXAMPLE))
    assert robot.name == "drumbot"
    assert robot.motor(0).radians_per_tick == Measured(0.00388, 0.00004, date(2026, 3, 1), 6.7)
    assert robot.motor(3).radians_per_tick is None
    assert robot.tophats["front_left"].left == 0.02
    assert robot.model.left.back_emf_constant.value == 1.107
    assert robot.model.right.back_emf_constant.value == 1.08
    assert (
        robot.model.left.armature_resistance == robot.model.right.armature_resistance == Measured(1.8, 0.03)
    )


def test_an_empty_file_is_the_default_robot(tmp_path: Path) -> None:
    assert load_robot(write(tmp_path, "")) == RobotConfig()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "nam = 'x'",
            r"robot.toml: nam: there is no such key \(did you mean name\?\); allowed are name, controller",
        ),
        ("name = 3", r"name = 3: it must be a text"),
        (
            "[controller]\nport = 'Wombt'",
            r"port = 'Wombt': allowed is .*raccoon \(did you mean wombat\?\)",
        ),
        (
            "[model.motor.lefft]\nback_emf_constant = 1",
            r"model.motor.lefft: there is no such key \(did you mean left\?\); .*, left, right",
        ),
        ("drive = 3", r"drive = 3: it must be a table"),
        (
            "[controler]",
            r"controler: there is no such key \(did you mean controller\?\); allowed are name, contr",
        ),
        (
            "[motion]\nspead = 1",
            r"motion.spead: there is no such key \(did you mean speed\?\); allowed are speed,",
        ),
        ("[drive]\nleft = 4", r"drive.left = 4: allowed are the ports 0 to 3"),
        ("[drive]\nleft = 0.5", r"drive.left = 0.5: allowed are the ports 0 to 3"),
        ("[drive]\nleft = true", r"drive.left = True: allowed are the ports"),
        ("[drive]\nleft = 1", r"drive.left and drive.right are both motor port 1"),
        ("[motor.4]\ninverted = true", r"motor.4: allowed are the ports 0 to 3"),
        (
            "[motor]\ninverted = true",
            r"motor.inverted: allowed are the ports .* a section each, as in \[motor.0\]",
        ),
        ("[tophat]\nanalog = 1", r"tophat.analog = 1: it must be in a section with .* name, \[tophat.NAME\]"),
        ("[motor.0]\ninverted = 1", r"motor.0.inverted = 1: allowed are true and false"),
        (
            "[motor.0]\nradians_per_tick = 0",
            r"motor.0.radians_per_tick = 0: allowed are numbers from 1e-08 to 0.1 rad$",
        ),
        ("[motor.0]\nradians_per_tick = 0.2223", r"allowed are numbers from 1e-08 to 0.1 rad$"),
        ("[motor.0]\nradians_per_tick = {std = 1}", r"motor.0.radians_per_tick has no value"),
        (
            "[motor.0]\nradians_per_tick = {value = 0.01, date = 3}",
            r"radians_per_tick.date = 3: it must be a date",
        ),
        ("[motor.0]\nradians_per_tick = {value = 0.01, std = -1}", r"radians_per_tick.std = -1: allowed are"),
        ("[controller]\nport = 'ev3'", r"controller.port = 'ev3': allowed is wombat \| wombat-raccoon"),
        ("[controller]\nport = 'replay'", r"emulator-raccoon; a recording is played by raccoon.replay\("),
        ("[controller]\nrate_hz = nan", r"controller.rate_hz = nan: allowed are numbers from 20 to 500"),
        ("[controller]\nrate_hz = 10", r"controller.rate_hz = 10: allowed are numbers from 20 to 500 Hz"),
        (  # less is refused by whatever works ticks out of it
            "[controller]\ncounter_rate_hz = 49",
            r"controller.counter_rate_hz = 49: allowed are 0 and numbers from 50 to 1000 Hz",
        ),
        (
            "[controller]\nport = 'sim'\nrate_hz = 501",  # the same program must run on a Wombat
            r"controller.rate_hz = 501: allowed are numbers from 20 to 500",
        ),
        (
            "[model.battery]\ninternal_resistance = -0.1",
            r"internal_resistance = -0.1: allowed are numbers from 0",
        ),
        ("[model.drive]\ntrack_width = 0", r"model.drive.track_width = 0: allowed are numbers from 0.01"),
        ("[model.drive]\ntrack_width = '16 cm'", r"track_width = '16 cm': allowed are numbers"),
        (
            "[drive]\nwheel_radius = 0.03",
            r"drive.wheel_radius: it belongs below a line with its section, \[model.drive\]",
        ),
        (
            "track_width = 0.2",
            r"toml: track_width: it belongs below a line with its section, \[model.drive\]",
        ),
        ("[model.motor.left]\nback_emf = 1", r"model.motor.left.back_emf: there is no such key"),
        (
            "[tophat.a]\nanalog = 1\n[tophat.b]\nanalog = 1",
            r"tophat.b.analog = 1: the port is taken by tophat.a",
        ),
        ("[tophat.a]\nanalog = 6", r"tophat.a.analog = 6: allowed are the ports 0 to 5"),
        (
            "[servo.claw]\npositions_us = { open = 500 }",
            r"servo.claw.positions_us.open = 500: allowed are numbers from 600 to 2400",
        ),
        (
            "[servo.claw]\nhighest_us = 2000\npositions_us = { open = 2100 }",
            r"servo.claw.positions_us.open = 2100: allowed are numbers from 600 to 2000",
        ),
        ("[servo.claw]\npositions_us = 1200", r"servo.claw.positions_us = 1200: it must be a table"),
        (
            "[servo.claw]\nlowest_us = 2000\nhighest_us = 1000",
            r"servo.claw.lowest_us = 2000: it must be below highest_us = 1000",
        ),
        ("[servo.a]\n[servo.b]", r"servo.b.port = 0: the port is taken by servo.a"),
        ("[bumper.a]\n[bumper.b]", r"bumper.b.digital = 0: the port is taken by bumper.a"),
        ("[bumper.a]\ndigital = 10", r"bumper.a.digital = 10: allowed are the ports 0 to 9"),
        (
            '[bumper.a]\nside = "top"',
            r"bumper.a.side = 'top': allowed is front \| back \| left \| right$",
        ),
        ("[bumper.a]\nbegin = 0.05\nend = -0.05", r"bumper.a.begin = 0.05: it must be below end = -0.05$"),
        (
            "[bumper.a]\nend = -0.1",
            r"bumper.a.end = -0.1: the part is beyond the front side of \[body\], which goes from -0.09 to",
        ),
        (
            '[body]\nfront = 0.2\n[bumper.a]\nside = "left"\nbegin = 0.21',
            r"bumper.a.begin = 0.21: the part is beyond the left side of \[body\], .* from -0.09 to 0.2 m$",
        ),
        ("[mechanism.arm]\nmotor = 1", r"mechanism.arm.motor = 1: the drive is on that port"),
        ("[mechanism.a]\n[mechanism.b]", r"mechanism.b.motor = 2: the port is taken by mechanism.a"),
        ("name = ", r"not a TOML file"),
        ('port = "sim"', r"robot.toml: port: it belongs below a line with its section, \[controller\]$"),
        ("left = 0", r"robot.toml: left: it belongs below a line with its section, \[drive\]$"),
        ("[motor.0]\ninverted = True", r"'inverted = True'; write true and false in small letters$"),
        ("[motion]\nspeed = 0,15", r"'speed = 0,15'; write a number with a decimal point$"),
        (
            "[battery]\ntuned_at =  # V, resting voltage\n",
            r"Invalid value \(at line 2, column \d+\): 'tuned_at =  # V, resting voltage'; write a value",
        ),
        ("[controller]\nport = sim", r"'port = sim'; put a text in quotes$"),
        ("[controller]\nport = wombat-raccoon  # ours", r"; put a text in quotes$"),
        ("[controller]\nport = “sim”", r"'port = “sim”'; write straight quotes, as on the keyboard$"),
        (
            "[servo.the claw]",
            r"'\[servo.the claw\]'; put a name with spaces or letters beyond a to z in quotes",
        ),
        (
            "[servo.Tür] # zu",
            r"'\[servo.Tür\] # zu'; put a name with spaces or letters .* \[servo\.\"the claw\"\]$",
        ),
        ("[servo.a]\npositions_us = { zu = 700, öffnen = 900 }", r"; put a name with spaces or letters"),
        ("[servo.a]\nport = 1 2 # für", r"'port = 1 2 # für'$"),
        (
            "[model.battery]\nopen_circuit_voltage = 2.0",
            r"model.battery.open_circuit_voltage = 2.0: allowed are numbers from 3.1 to 30",
        ),
        (
            f"[motion]\nspeed = {'9' * 400}",
            r"motion.speed = 9{60}\.\.\.: allowed are numbers from 0.001 to 3 m/s$",
        ),
        ("[motion]\nspeed = 15", r"motion.speed = 15: allowed are numbers from 0.001 to 3 m/s$"),
        ("[motion]\nturn_rate = 90", r"motion.turn_rate = 90: allowed are numbers from 0.001 to 20 rad/s$"),
        (
            "[mechanism.arm]\nspeed = 90",
            r"mechanism.arm.speed = 90: allowed are numbers from 0.001 to 20 rad/s$",
        ),
        (f"[motion]\nspeed = 0x{'f' * 5000}", r"motion.speed = a number of thousands of digits: allowed are"),
        (f"[drive]\nleft = {'9' * 400}", r"drive.left = 9{60}\.\.\.: allowed are the ports 0 to 3"),
        (f"[motor.0]\nradians_per_tick = {{value = {'9' * 400}}}", r"radians_per_tick.value = 9{60}\.\.\.:"),
        (f"name = {'9' * 5000}", r"robot.toml: not a TOML file: "),
        (f"name = {'[' * 5000}", r"robot.toml: not a TOML file: "),
        (
            "[model.drive]\ntrack_width = 1e-320",
            r"model.drive.track_width = 1e-320: allowed are numbers from",
        ),
        ("[motion]\njerk = 1e-320", r"motion.jerk = 1e-320: allowed are 0 and numbers from 0.001 to 1e\+06"),
    ],
    ids=lambda each: each[:40],
)
def test_every_bad_value_is_named(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        load_robot(write(tmp_path, text))


def test_a_weakest_battery_above_the_battery_of_the_model_is_said(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    load_robot(write(tmp_path, "[battery]\nweakest = 6.8\n"))
    assert caplog.messages == []
    load_robot(write(tmp_path, "[battery]\nweakest = 8\n"))
    [said] = caplog.messages
    assert "robot.toml: battery.weakest = 8 V is above model.battery.open_circuit_voltage = 6.8 V" in said


def test_a_file_of_another_encoding_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_bytes(b"name = '\xff'")
    with pytest.raises(ConfigError, match=r"not a TOML file.*; save it as UTF-8"):
        load_robot(path)


def test_a_file_of_a_windows_editor_is_read(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    path.write_bytes(b"\xef\xbb\xbf" + EXAMPLE.strip().replace("\n", "\r\n").encode())
    assert load_robot(path) == load_robot(write(tmp_path, EXAMPLE))


@pytest.mark.parametrize("table", ["[chain]", "[[effect]]", "[provenance]"])
def test_a_model_is_no_robot(tmp_path: Path, table: str) -> None:
    path = tmp_path / "model.toml"
    path.write_text(f"{table}\n")
    with pytest.raises(
        ConfigError,
        match=r"it is a model\.toml, which --model of diagnose, excite and sweep takes; name a robot\.toml",
    ):
        load_robot(path)


def test_a_missing_file_is_said(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        load_robot(tmp_path / "nowhere.toml")


@pytest.mark.parametrize(("value", "std"), [(float("nan"), 0.0), (1.0, -1.0), (1.0, float("inf"))])
def test_a_measured_number_is_finite_with_a_real_std(value: float, std: float) -> None:
    with pytest.raises(ConfigError):
        Measured(value, std)


def test_the_template_is_the_default_robot_and_names_every_key(tmp_path: Path) -> None:
    text = template()
    assert load_robot(write(tmp_path, text)) == RobotConfig(motors={0: MotorConfig()})
    switched_on = "\n".join(
        line[2:] if line.startswith("# ") and "=  #" not in line else line for line in text.splitlines()
    )
    assert load_robot(write(tmp_path, switched_on)) == RobotConfig(
        motors={0: MotorConfig()},
        tophats={"front": TophatConfig()},
        bumpers={"front": BumperConfig()},
        servos={"claw": ServoConfig()},
        mechanisms={"arm": MechanismConfig()},
    )


def test_the_template_goes_with_a_drive_on_any_ports(tmp_path: Path) -> None:
    text = template().replace("# left = 0 ", "left = 2 ").replace("# right = 1 ", "right = 3 ")
    assert load_robot(write(tmp_path, text)).drive == DriveConfig(left=2, right=3)


def test_the_page_shows_the_template() -> None:
    page = (Path(__file__).parents[3] / "docs" / "robot-toml.md").read_text(encoding="utf-8")
    assert f"```toml\n{template()}```" in page


def test_a_recording_in_place_of_a_robot_toml_is_called_so(tmp_path: Path) -> None:
    path = tmp_path / "run.jsonl.gz"
    path.write_bytes(b"\x1f\x8b\x08\x00")
    with pytest.raises(
        ConfigError, match=r"run\.jsonl\.gz: not a TOML file: it is compressed, like a recording"
    ):
        load_robot(path)
