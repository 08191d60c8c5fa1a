"""Names by habit: of KIPR's library, of the robot's own parts, and calls of what is none."""

from typing import Any

import pytest

import raccoon
from raccoon import (
    Pose,
    Robot,
    after_time,
    do,
    drive,
    open_robot,
    parallel,
    pressed,
    straight,
    turn,
    wait,
    wait_for,
    when,
)
from raccoon.core.config import MechanismConfig, RobotConfig, ServoConfig, TophatConfig
from raccoon.robot import robot_state
from robots import InterceptingPort, simulated_port

CONFIG = RobotConfig(
    tophats={"front": TophatConfig(0, 0.11, 0.0)},
    servos={"claw": ServoConfig(0)},
    mechanisms={"arm": MechanismConfig(2)},
)


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ("robot.drive(0.15)", r"a Drive cannot be called: write robot.run\(drive\(speed, turn_rate\)"),
        ("robot.servo('claw', 1500)", r"moves nothing: write robot.run\(servo\('claw', 1500\)\)"),
        ("robot.mechanism('arm', 1.0)", r"moves nothing: write robot.run\(move\('arm', 1.0\)\)"),
        ("robot.servo('claw').open", r"a Servo has no open: it has pulse; else write robot.run\(servo\("),
        ("robot.mechanism('arm').move(1)", "a Mechanism has no move: it has angle and rate; else"),
        ("robot.tophat('front').is_black", "has no is_black: it has black, .*counts"),
        ("robot.arm", r"a robot has no arm: write robot.mechanism\('arm'\)"),
        ("robot.claw", r"write robot.servo\('claw'\)"),
        ("robot.front", r"write robot.tophat\('front'\)"),
        ("robot.motor(0, 50)", r"a robot has no motor: write robot.run\(motors\(left, right\)"),
        ("robot.straight(0.1)", r"a robot has no straight: write robot.run\(straight\(...\)\)"),
        ("robot.pressed(0)", r"it is a condition, as in robot.run\(wait_for\(pressed\(...\)\)\)"),
        ("robot.run_match(1)", r"a robot has no run_match: write run_match\(robot, ...\)"),
        ("robot.search(0.1, 1)", "a robot has no search$"),
        ("robot.deg(90)", "a robot has no deg$"),
        ("robot.open_robot()", "a robot has no open_robot$"),
        ("robot.ao()", r"a robot has no ao: write robot.stop\(\), from a thread"),
        ("robot.reset()", r"a robot has no reset: write robot.odometry.reset\(x, y, heading\)"),
        ("robot.stop_motors()", r"a robot has no stop_motors: write robot.stop\(\), from a thread"),
        ("robot.angle", "a robot has no angle: write robot.pose.heading"),
        (
            "setattr(robot, 'pose', Pose(0, 0))",
            r"be set directly to x 0.000 m, .*: write robot.odometry.reset\(x, y, heading\)",
        ),
        ("straight(0.1).run(robot)", r"action 'straight 0.1 m' has no run: run it with robot.run"),
        ("raccoon.msleep(500)", r"raccoon has no msleep: write robot.run\(wait\(seconds\)\)"),
        (
            "setattr(robot.servo('claw'), 'pulse', 1500)",
            r"cannot be set directly: write robot\.run\(servo\('claw', 1500\)\)",
        ),
        (
            "setattr(robot.mechanism('arm'), 'angle', 1)",
            r"cannot be set directly: robot\.run\(move\('arm', 1\)\) turns the mechanism",
        ),
        ("setattr(robot, 'plan', (0, 0))", r"robot.plan takes a Pose, not \(0, 0\)"),
        ("Robot('robot.toml')", "port of a Robot is 'robot.toml': .*with open_robot"),
    ],
)
def test_what_is_meant_is_said(asked: str, said: str) -> None:
    with open_robot(CONFIG, port=simulated_port(config=CONFIG)) as robot:
        robot.tick()
        names = {"robot": robot, "raccoon": raccoon, "straight": straight, "Robot": Robot, "Pose": Pose}
        with pytest.raises((TypeError, AttributeError), match=said):
            eval(asked, names)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("max_speed", r"robot.max_speed cannot be set: write speed under \[motion\]"),
        ("acceleraton", r"cannot be set: write acceleration under \[motion\]"),
        ("plam", r"a robot has none \(did you mean plan\?\); keep a value of your own in a variable"),
        ("stop", "robot.stop cannot be set: it is a function"),
    ],
)
def test_what_looks_like_a_robots_own_cannot_be_set(name: str, said: str) -> None:
    with open_robot(CONFIG, port=simulated_port(config=CONFIG)) as robot:
        setattr(robot, name, 1.0)
        with pytest.raises(AttributeError, match=said):
            robot.run(straight(0.1))
        assert robot.ticks == 0


def test_while_it_drives_a_robot_goes_on_and_says_so_and_a_programs_own_names_are_its_own() -> None:
    with open_robot(CONFIG, port=simulated_port(config=CONFIG)) as robot:
        robot.lap, robot.arm_speed = 1, 0.5  # type: ignore[attr-defined]
        robot.tick()
        assert robot.drive.remarks == {}
        robot.max_speed = 0.3  # type: ignore[attr-defined]
        robot.tick()
        (said,) = robot.drive.remarks.values()
        assert said.startswith("robot.max_speed was set, which changes nothing: write speed under [motion]")


def noted(call: str) -> list[str]:
    """What a program that does `call` is told beside Python's own error."""
    names = {"wait_for": wait_for, "when": when, "straight": straight, "one": 1}

    def program() -> None:
        with open_robot(CONFIG, port=simulated_port(config=CONFIG)) as robot:
            robot.tick()
            eval(call, {**names, "robot": robot})

    with pytest.raises(TypeError) as caught:
        program()
    return getattr(caught.value, "__notes__", [])


@pytest.mark.parametrize(
    ("call", "value"),
    [
        ("robot.pose().x", "pose"),
        ("robot.estimate.velocity()", "velocity"),
        ("robot.run(wait_for(when(lambda robot: robot.time() > 2.0)))", "time"),
    ],
)
def test_a_value_that_is_called_is_said_to_be_one(call: str, value: str) -> None:
    assert noted(call) == [f"{value} is a value, not a function: write .{value} without ()"]


@pytest.mark.parametrize(
    ("call", "reader"),
    [
        ("robot.analog[0] > 5", "analog"),
        ("one + robot.digital[robot.drive.asked]", "digital"),
        ("(robot.analog(0),\nrobot.run[0])", ""),
    ],
)
def test_a_function_that_is_taken_for_a_list_is_said_to_be_one(call: str, reader: str) -> None:
    assert noted(call) == ([f"{reader} is a function: write .{reader}(...)"] if reader else [])


@pytest.mark.parametrize("call", ["robot.time(robot.dt)", "robot.time + one()", "straight()"])
def test_of_another_call_no_value_is_said(call: str) -> None:
    assert noted(call) == []


def test_an_import_of_kipr_says_what_stands_here() -> None:
    with pytest.raises(ImportError, match=r"raccoon has no motor: write robot.run\(motors\("):
        exec("from raccoon import motor")
    with pytest.raises(ImportError, match=r"raccoon has no modor \(did you mean motors\?\)"):
        exec("from raccoon import modor")
    assert not hasattr(raccoon, "motor")


@pytest.mark.parametrize(
    "make",
    [
        lambda: wait(1.0).timeout(5000),
        lambda: straight(0.1, timeout=5000),
        lambda: turn(1.0, timeout=5000),
        lambda: raccoon.turn_to(1.0, timeout=5000),
        lambda: raccoon.arc(0.2, 1.0, timeout=5000),
        lambda: raccoon.pivot(1.0, "left", timeout=5000),
        lambda: raccoon.drive_to(0.2, 0.1, timeout=5000),
        lambda: raccoon.follow_path([(0.2, 0.1)], timeout=5000),
        lambda: raccoon.align_on_wall(timeout=5000),
        lambda: raccoon.move("arm", 1.0, timeout=5000),
        lambda: raccoon.move_by("arm", 1.0, timeout=5000),
        lambda: raccoon.servo("claw", 1500, seconds=5000),
    ],
)
def test_a_limit_in_milliseconds_is_refused(make: Any) -> None:
    with pytest.raises(ValueError, match=r"is 5000: allowed are .* up to 600 s \(500 ms are 0.5\)"):
        make()


def test_a_loop_that_waits_and_never_reads_is_said_once(caplog: pytest.LogCaptureFixture) -> None:
    port = InterceptingPort(simulated_port(config=CONFIG))
    with open_robot(CONFIG, port=port) as robot:
        robot.tick()
        for _ in range(3000):  # while not robot.digital(0): pass
            robot.digital(0)
        robot.tick()
        for _ in range(3000):  # while robot.time - begin < 2.0: pass
            assert robot.time >= 0.0
        robot.run(wait_for(pressed(0) | after_time(0.1)))
    assert caplog.text.count("the robot reads its sensors only in run() and tick()") == 1


def test_a_loop_that_never_reads_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(robot_state, "REFUSE_AFTER_ASKED", 5000)

    def play(robot: Robot) -> None:
        while not robot.digital(0):
            pass

    with open_robot(CONFIG, port=simulated_port(config=CONFIG)) as robot:
        with pytest.raises(
            RuntimeError,
            match=r"for 5000 times in one cycle, in which they do not change: the robot reads",
        ):
            robot.run(do(play))
        assert not any(robot.outputs.duty)


def test_a_loop_that_ticks_may_ask_as_it_likes(caplog: pytest.LogCaptureFixture) -> None:
    with open_robot(CONFIG, port=simulated_port(config=CONFIG)) as robot:
        for _ in range(30):
            for _ in range(50):
                assert robot.digital(0) is not True
            robot.tick()
        robot.run(parallel(*[wait(0.02) for _ in range(600)]))
    assert "they do not change" not in caplog.text


def test_a_test_that_gives_a_function_does_not_hold() -> None:
    with open_robot(CONFIG, port=simulated_port(config=CONFIG)) as robot:
        digital: Any = when(lambda robot: robot.digital)  # type: ignore[arg-type, return-value]
        with pytest.raises(TypeError, match="condition 'when': its test returns digital without calling it"):
            robot.run(drive(0.1).until(digital))
        assert not any(robot.outputs.duty)
