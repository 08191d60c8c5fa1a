"""The examination: silent about a healthy robot, and right about each thing that is wrong with a sick one."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from datetime import date
from types import SimpleNamespace
from typing import Any

import pytest

from faulty_robot import FaultyRobot
from raccoon.core.config import BumperConfig, DriveConfig, Measured, MotorConfig, RobotConfig, TophatConfig
from raccoon.core.readings import ANALOG_BOTTOM, ANALOG_TOP, SIMULATOR, STOP, Fault, Inputs
from raccoon.hal.create import CREATE_2
from raccoon.hal.doctor import Finding, Report, Verdict, examine
from raccoon.hal.doctor.link import fault_findings
from raccoon.hal.doctor.sensors import analog_findings
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.sim.world.table import World

ROBOT = RobotConfig(tophats={"front_left": TophatConfig(analog=0), "front_right": TophatConfig(analog=1)})


def found(report: Report, subject: str) -> Finding:
    (finding,) = [each for each in report.findings if each.subject == subject]
    return finding


def examined(subject: str, config: RobotConfig = ROBOT, **switches: Any) -> Finding:
    """The finding about one subject, on a robot with these switches thrown."""
    return found(examine(FaultyRobot(**switches), config), subject)


def test_a_healthy_robot_is_well() -> None:
    robot = FaultyRobot()
    report = examine(robot, ROBOT)
    assert report.well, report.table()
    assert not robot.running
    assert report.table().endswith("All is well: 14 checks.")


def test_every_motor_moves_to_and_fro_alone() -> None:
    robot = FaultyRobot()
    examine(robot, ROBOT)
    commands = list(dict.fromkeys(each.duty for each in robot.written))
    assert commands == [
        (0.0, 0.0, 0.0, 0.0),
        (0.3, 0.0, 0.0, 0.0),
        (-0.3, 0.0, 0.0, 0.0),
        (0.0, 0.3, 0.0, 0.0),
        (0.0, -0.3, 0.0, 0.0),
    ]


def test_nothing_moves_where_that_is_not_wanted() -> None:
    robot = FaultyRobot()
    report = examine(robot, ROBOT, move=False)
    assert set(robot.written) == {STOP}
    assert found(report, "motors").verdict is Verdict.NOT_CHECKED


def test_an_arm_is_not_moved() -> None:
    robot = FaultyRobot()
    config = RobotConfig(motors={3: MotorConfig()})
    assert found(examine(robot, config), "motor 3").verdict is Verdict.NOT_CHECKED
    assert all(each.duty[3] == 0.0 for each in robot.written)


@pytest.mark.parametrize("cycle", [1, 100, 230, 300, 500])
def test_a_device_lost_on_the_way_is_a_finding_and_the_motors_stop(cycle: int) -> None:
    robot = FaultyRobot(dies_at=cycle)
    report = examine(robot, ROBOT)
    assert not report.well
    assert report.findings[-1].problem == "the bus is gone"
    assert not robot.running


@pytest.mark.parametrize("cycle", [1, 290, 400])
def test_ctrl_c_stops_the_motors(cycle: int) -> None:
    robot = FaultyRobot(interrupts_at=cycle)
    with pytest.raises(KeyboardInterrupt):
        examine(robot, ROBOT)
    assert robot.written[-1] == STOP


def test_a_clock_that_stands_still_ends_the_examination() -> None:
    report = examine(FaultyRobot(period=0.0), ROBOT)
    assert "its clock stands still" in report.findings[-1].problem


@pytest.mark.parametrize(
    ("switches", "verdict", "problem"),
    [
        ({"gain": {0: 0.0, 1: 1750.0, 2: 0.0, 3: 0.0}}, Verdict.FAULT, "the motor does not answer"),
        ({"bemf_sign": -1.0}, Verdict.FAULT, "its back-EMF has the opposite sign of its command"),
        ({"position_scale": -1.0}, Verdict.FAULT, "its position counts against its command"),
        ({"backward_gain": 0.3}, Verdict.FAULT, "it is weak backwards"),
        ({"backward_gain": 3.0}, Verdict.FAULT, "it is weak forwards"),
        (
            {"gain": dict.fromkeys(range(4), 700.0)},
            Verdict.WARNING,
            "it is much slower than robot.toml's model",
        ),
        (
            {"gain": dict.fromkeys(range(4), 3500.0)},
            Verdict.WARNING,
            "it is much faster than robot.toml's model",
        ),
        ({"position_scale": 0.7}, Verdict.WARNING, "its position counter runs at 0.70 times"),
        ({"position_scale": 0.0}, Verdict.WARNING, "its position counter runs at 0.00 times"),
        ({"delay": 25}, Verdict.WARNING, "it answered only after 1"),
    ],
)
def test_what_can_be_wrong_with_a_motor(switches: dict[str, Any], verdict: Verdict, problem: str) -> None:
    finding = examined("motor 0", **switches)
    assert finding.verdict is verdict
    assert finding.problem.startswith(problem)
    assert finding.remedy


def test_each_wheel_is_compared_with_the_model_of_its_own_motor() -> None:
    model = ROBOT.model
    resistance = model.right.armature_resistance
    right = replace(model.right, armature_resistance=replace(resistance, value=4.0 * resistance.value))
    config = replace(ROBOT, model=replace(model, right=right))
    assert examined("motor 0", config).verdict is Verdict.OK
    assert "much faster" in examined("motor 1", config).problem


@pytest.mark.parametrize(("volts", "coulomb", "problem"), [(0.0, None, ""), (6.8, 2.0, "it is much faster")])
def test_a_motor_that_cannot_move_by_battery_or_model_and_does_is_judged(
    volts: float, coulomb: float | None, problem: str
) -> None:
    """A battery reading that is dead says nothing about the motor."""
    friction = ROBOT.model.friction
    if coulomb is not None:
        friction = replace(friction, coulomb=Measured(coulomb))
    config = replace(ROBOT, model=replace(ROBOT.model, friction=friction))
    report = examine(FaultyRobot(volts=volts), config)
    assert found(report, "motor 0").problem[: len("it is much faster")] == problem
    assert (found(report, "battery").verdict is Verdict.OK) is bool(problem)


def test_a_healthy_motor_is_measured() -> None:
    finding = examined("motor 1")
    values = finding.values
    assert values["bemf_forward_counts"] == pytest.approx(525.0, abs=10.0)
    assert values["bemf_backward_counts"] == pytest.approx(-525.0, abs=10.0)
    # 525 counts for 0.35 s, less what the lag of 30 ms takes.
    assert values["ticks_forward"] == pytest.approx(525.0 * (0.35 - 0.03), rel=0.05)
    assert values["latency"] == pytest.approx(0.01, abs=0.0051)
    assert finding.measured == (
        f"back-EMF {values['bemf_forward_counts']:+.0f} / {values['bemf_backward_counts']:+.0f} counts, "
        f"{values['ticks_forward']:+.0f} / {values['ticks_backward']:+.0f} ticks at duty +0.3 / -0.3, "
        f"answer after {1e3 * values['latency']:.0f} ms"
    )


def test_an_offset_at_rest_names_the_line_to_write() -> None:
    report = examine(FaultyRobot(offset=60.0), ROBOT)
    moved = found(report, "motor 0").values  # without the offset
    assert moved["bemf_forward_counts"] == pytest.approx(525.0, abs=10.0)
    assert moved["latency"] == pytest.approx(0.01, abs=0.0051)
    finding = found(report, "motor 0 at rest")
    assert finding.verdict is Verdict.WARNING
    assert "the position creeps" in finding.problem
    assert finding.values["offset_counts"] == pytest.approx(60.0, abs=1.0)
    assert finding.values["noise_counts"] == pytest.approx(1.0, rel=0.4)
    assert "under [motor.0]" in finding.remedy
    known = RobotConfig(motors={0: MotorConfig(bemf_offset=Measured(58.0))})
    assert examined("motor 0 at rest", known, offset=60.0).verdict is Verdict.OK


@pytest.mark.parametrize(
    ("signs", "problem", "remedy"),
    [
        ((-1.0, 1.0), "the left wheel turns backwards", "inverted = true under [motor.0]"),
        ((1.0, -1.0), "the right wheel turns backwards", "inverted = true under [motor.1]"),
        ((-1.0, -1.0), "both wheels turn the robot the wrong way", "exchange drive.left and drive.right"),
    ],
)
def test_wiring_signs_are_seen_by_the_gyro(signs: tuple[float, float], problem: str, remedy: str) -> None:
    finding = examined("wiring signs", turn_signs=signs)
    assert finding.verdict is Verdict.FAULT
    assert finding.problem == problem
    assert remedy in finding.remedy


def test_an_inverted_motor_is_right_when_robot_toml_says_so() -> None:
    config = RobotConfig(drive=DriveConfig(left=2, right=3), motors={2: MotorConfig(inverted=True)})
    right = examined("wiring signs", config, wheels=(2, 3), turn_signs=(-1.0, 1.0))
    assert right.verdict is Verdict.OK
    wrong = examined("wiring signs", config, wheels=(2, 3))
    assert "inverted = false under [motor.2]" in wrong.remedy


@pytest.mark.parametrize("switches", [{"on_the_floor": False}, {"no_imu": True}])
def test_signs_cannot_be_judged_without_a_turn(switches: dict[str, Any]) -> None:
    finding = examined("wiring signs", **switches)
    assert finding.verdict is Verdict.NOT_CHECKED
    assert "put it on the floor" in finding.remedy


@pytest.mark.parametrize(
    ("subject", "switches", "problem"),
    [
        ("imu", {"no_imu": True}, "the controller delivers no IMU readings"),
        ("gyro", {"gyro_frozen": True}, "it repeats one reading"),
        ("gyro", {"gyro_noise": 0.3}, "its turn rate drifts"),
        ("gyro", {"gyro_bias": -0.2}, "its bias is far from robot.toml's +0.0000"),
        ("accelerometer", {"force": (0.0, 0.0, 4.9)}, "gravity is not 1 g"),
        ("accelerometer", {"force": (0.0, 0.0, -9.8)}, "it is upside down"),
        ("accelerometer", {"force": (6.0, 0.0, 7.75)}, "the robot is not level"),
        ("battery", {"volts": 5.5}, "below 6.0 V the controller is unreliable"),
        ("battery", {"volts": 12.0}, "above 8.6 V"),
        ("battery", {"volts": None}, "no reading of the battery"),
        ("analog 0 (front_left)", {"analog_levels": (4095, 1, 2, 3, 4, 5)}, "it is saturated"),
        ("analog 1 (front_right)", {"analog_levels": (9, 0, 9, 9, 9, 9)}, "it is saturated"),
        ("analog 0 (front_left)", {"analog_levels": (None,) * 6}, "no reading"),
        ("analog 1 (front_right)", {"analog_noise": (1, 90, 1, 1, 1, 1)}, "it floats"),
        (
            "analog 1 (front_right)",
            {"analog_noise": (1, 1, 30, 1, 1, 1), "follows": (1, 2)},
            "it follows analog 2",
        ),
        ("rate", {"period": 0.01}, "200.0 Hz are wanted"),
        ("link", {"faults": {150: (Fault.RESET,)}}, "the controller's port reports reset"),
        (
            "link",
            {"faults": dict.fromkeys(range(100, 160), (Fault.TORN,))},
            "the controller's port reports torn",
        ),
    ],
)
def test_what_can_be_wrong_beside_the_motors(subject: str, switches: dict[str, Any], problem: str) -> None:
    finding = examined(subject, **switches)
    assert finding.verdict is Verdict.FAULT
    assert finding.problem.startswith(problem)
    assert finding.remedy


@pytest.mark.parametrize(
    ("subject", "switches", "problem"),
    [
        ("battery", {"volts": 6.2}, "it is almost empty"),
        ("battery", {"volts": 7.6, "sag": 1.4}, "it drops too far under load"),
        ("rate", {"stutter": 40, "period": 0.00475}, "too many cycles came late"),
    ],
)
def test_what_is_only_worth_a_warning(subject: str, switches: dict[str, Any], problem: str) -> None:
    finding = examined(subject, **switches)
    assert finding.verdict is Verdict.WARNING
    assert finding.problem == problem


@pytest.mark.parametrize(
    ("level", "saturated"),
    [(ANALOG_BOTTOM, True), (ANALOG_BOTTOM + 1.0, False), (ANALOG_TOP - 1.0, False), (ANALOG_TOP, True)],
)
def test_an_analog_port_is_saturated_where_a_tophat_is(level: float, saturated: bool) -> None:
    quiet = (0.0,) * 6
    finding = examined("analog 0 (front_left)", analog_levels=(level, *quiet[1:]), analog_noise=quiet)
    assert (finding.problem == "it is saturated") is saturated


def test_an_unused_analog_port_may_float() -> None:
    finding = examined("analog 4", analog_noise=(1, 1, 1, 1, 90, 1))
    assert finding.verdict is Verdict.NOT_CHECKED
    assert "it floats" in finding.measured


@pytest.mark.parametrize("hertz", [99.9, 120.2])
def test_lamps_that_flicker_are_no_open_plug(hertz: float) -> None:
    rest = [
        Inputs(
            device=SIMULATOR, time=at, analog=(1270.0 + 120.0 * math.sin(math.tau * hertz * at), *(None,) * 5)
        )
        for at in (0.005 * index for index in range(201))
    ]
    assert analog_findings(ROBOT, rest)[0].verdict is Verdict.OK


def test_a_bias_that_robot_toml_knows_is_no_fault() -> None:
    imu = replace(ROBOT.model.imu, gyro_bias=Measured(-0.2))
    known = replace(ROBOT, model=replace(ROBOT.model, imu=imu))
    assert found(examine(FaultyRobot(gyro_bias=-0.2), known, move=False), "gyro").verdict is Verdict.OK


def test_a_rare_fault_that_the_port_repaired_is_no_illness() -> None:
    finding = examined("link", faults={150: (Fault.TORN,)})
    assert finding.verdict is Verdict.OK
    assert finding.values == {"torn": 1.0}


@pytest.mark.parametrize(
    ("fault", "problem"),
    [
        (Fault.IMU_FROZEN, "its readings stand still"),
        (Fault.IMU_IMPLAUSIBLE, "its readings are impossible"),
    ],
)
def test_an_imu_that_its_port_does_not_believe_is_told_apart(fault: Fault, problem: str) -> None:
    finding = examined("imu", no_imu=True, faults=dict.fromkeys(range(1, 2000), (fault,)))
    assert finding.problem.startswith(problem)


def test_every_fault_of_a_port_has_a_remedy() -> None:
    told = fault_findings([Inputs(device=SIMULATOR, time=0.0, faults=tuple(Fault))])
    assert len(told) == len(Fault) - 1  # the analog ports have findings of their own
    assert all(finding.remedy for finding in told)


def test_a_sick_link_is_told_before_what_it_makes_look_sick() -> None:
    report = examine(FaultyRobot(faults={150: (Fault.RESET,)}), ROBOT)
    assert [each.subject for each in report.findings[:3]] == ["controller", "rate", "link"]


def test_calibrations_are_listed_that_go_before_the_model() -> None:
    ticks = Measured(0.00305, 0.00001, date(2026, 3, 1))
    robot = replace(ROBOT, motors={0: MotorConfig(radians_per_tick=ticks), 3: MotorConfig(inverted=True)})
    report = examine(FaultyRobot(), robot, move=False)
    assert found(report, "calibrations").measured == (
        "motor.0.radians_per_tick (2026-03-01): programs go by these before what [model] says"
    )
    assert report.well
    assert not [each for each in examine(FaultyRobot(), ROBOT).findings if each.subject == "calibrations"]


def test_ticks_of_another_firmware_are_told_and_blame_no_gyro() -> None:
    ticks = MotorConfig(radians_per_tick=Measured(0.00305 / 181.0))  # of RaccoonOS 17, behind the simulator
    report = examine(FaultyRobot(), replace(ROBOT, motors={0: ticks, 1: ticks}))
    finding = found(report, "calibrations")
    assert finding.verdict is Verdict.FAULT
    assert finding.problem.startswith("motor.0.radians_per_tick is 1.69e-05, where a tick of simulator is")
    assert "calibrate again" in finding.remedy
    assert found(report, "wiring signs").verdict is Verdict.OK
    assert not report.well


def test_pressed_buttons_are_told() -> None:
    config = replace(ROBOT, bumpers={"front": BumperConfig(digital=9)})
    assert examined("digital", config, pressed=(3, 9)).measured == "pressed: 3, 9 (bumper front)"


def test_a_base_with_encoders_and_no_imu_is_examined_too() -> None:
    report = examine(
        FaultyRobot(device=CREATE_2, no_bemf=True, no_imu=True, volts=15.5, period=0.015), RobotConfig()
    )
    assert found(report, "imu").verdict is Verdict.NOT_CHECKED
    assert found(report, "motor 0").verdict is Verdict.OK
    assert 0.0 < found(report, "motor 0").values["latency"] < 0.06
    assert found(report, "rate").verdict is Verdict.OK
    assert found(report, "battery").verdict is Verdict.OK
    assert report.well


def test_a_dead_wheel_of_such_a_base_is_found_by_its_encoder() -> None:
    finding = examined("motor 0", device=CREATE_2, no_bemf=True, gain=dict.fromkeys(range(4), 0.0))
    assert finding.problem == "the motor does not answer"


@pytest.mark.parametrize(
    ("name", "measured", "values"),
    [
        ("wombat-stock", "wombat-stock: KIPR's firmware, version 8", {"version": 8.0}),
        ("wombat-raccoon-17", "wombat-raccoon-17: RaccoonOS, protocol version 17", {"version": 17.0}),
        (
            "wombat-raccoon-21+mpu6500",
            "wombat-raccoon-21+mpu6500: RaccoonOS, protocol version 21",
            {"version": 21.0},
        ),
        ("bench", "bench", {}),
    ],
)
def test_firmware_and_version_are_told(name: str, measured: str, values: dict[str, float]) -> None:
    finding = examined("controller", device=replace(SIMULATOR, name=name))
    assert finding.measured == measured
    assert finding.values == values


@pytest.mark.parametrize(("hertz", "verdict"), [(235.4, Verdict.OK), (200.4, Verdict.WARNING)])
def test_the_rate_of_the_counters_is_told_where_the_port_measures_it(hertz: float, verdict: Verdict) -> None:
    class Measuring(FaultyRobot):
        rates = SimpleNamespace(bemf=hertz, expected_bemf=235.0)

    finding = found(examine(Measuring(), ROBOT, move=False), "rate")
    assert finding.measured.endswith(f"; counters {hertz:.0f} Hz")
    assert finding.values["counters_hz"] == hertz
    assert finding.verdict is verdict
    assert ("counter_rate_hz = 200.4" in finding.remedy) is (verdict is Verdict.WARNING)


def test_the_report_is_json_and_names_its_verdicts() -> None:
    report = examine(FaultyRobot(volts=5.5), ROBOT)
    table = json.loads(json.dumps(report.as_json(), allow_nan=False))
    assert table["well"] is False
    (battery,) = [each for each in table["findings"] if each["subject"] == "battery"]
    assert battery["verdict"] == "fault"
    assert battery["values"]["voltage"] == pytest.approx(5.5, abs=0.01)


def test_the_table_tells_problem_and_remedy_below_the_row() -> None:
    lines = examine(FaultyRobot(volts=5.5), ROBOT).table(width=80).splitlines()
    (row,) = [index for index, line in enumerate(lines) if line.startswith("battery")]
    assert lines[row].split() == ["battery", "fault", "5.50", "V,", "drops", "by", "0.10", "V"]
    assert lines[row + 1].strip() == "! below 6.0 V the controller is unreliable"
    assert lines[row + 2].strip() == "> charge the battery"
    assert lines[-1] == "faults: 1, warnings: 0, ok: 13"
    assert all(len(line) <= 80 for line in lines)


def test_an_empty_report_is_not_well() -> None:
    assert not Report().well
    assert not Report([Finding("motors", Verdict.NOT_CHECKED, "")]).well


@pytest.mark.parametrize("factor", [0.5, 0.8, 1.0, 1.25, 2.0])
def test_a_gyro_of_another_full_scale_is_seen(factor: float) -> None:
    parameters = Parameters.from_robot(RobotConfig()).with_effect("imu.gyro_scale", factor=factor)
    found = examine(SimPort(parameters, World()), RobotConfig())
    finding = next(each for each in found.findings if each.subject == "wiring signs")
    if 0.6 < factor < 1.6:
        assert finding.verdict is Verdict.OK
    else:
        assert finding.verdict is Verdict.WARNING
        assert f"the gyro sees {factor:.2f} times" in finding.problem
        assert "gyro_scale" in finding.remedy


def test_a_robot_that_only_drives_backwards_is_seen_by_the_accelerometer() -> None:
    """With left and right exchanged and both reversed, it turns as it should."""
    turned = MotorConfig(inverted=True)
    cables = RobotConfig(drive=DriveConfig(left=1, right=0), motors={0: turned, 1: turned})
    port = SimPort(Parameters.from_robot(cables), World())
    finding = found(examine(port, RobotConfig()), "wiring signs")
    assert finding.verdict is Verdict.WARNING
    assert "accelerates backwards" in finding.problem
    assert "exchange drive.left and drive.right" in finding.remedy
