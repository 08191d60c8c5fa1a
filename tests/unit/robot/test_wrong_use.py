"""Mistakes that programs are full of: each is refused where it is written, with what was meant."""

from collections.abc import Callable
from dataclasses import astuple, replace
from threading import Thread
from typing import Any

import numpy as np
import pytest

from raccoon import (
    Action,
    Condition,
    MotionResult,
    Robot,
    after_angle,
    after_distance,
    after_time,
    align_on_line,
    align_on_wall,
    analog_above,
    analog_below,
    arc,
    background,
    blocked,
    calibrate_drive,
    calibrate_light,
    calibrate_tophats,
    calibrate_tophats_by_hand,
    check_battery,
    deg,
    do,
    drive,
    drive_to,
    follow_line,
    follow_path,
    load_tophats,
    mission,
    motors,
    move,
    move_by,
    on_black,
    open_robot,
    over_line,
    parallel,
    pivot,
    pressed,
    race,
    rehearse_light,
    release,
    repeat,
    run_match,
    seq,
    servo,
    servo_off,
    spin,
    straight,
    timed,
    turn,
    turn_to,
    wait,
    wait_for,
    wait_for_light,
    when,
    zero,
)
from raccoon.core.config import MechanismConfig, ServoConfig
from robots import CONFIG, SCALE, run, simulated_port

NAN = float("nan")
ANY: Any = straight


def loose(value: object) -> Any:
    """What no type checker would let pass."""
    return value


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: straight(30), r"distance is 30: allowed are numbers up to 10 m .*30 cm are 0.30"),
        (lambda: straight(NAN), "distance is nan: it must be a finite number"),
        (
            lambda: straight(0.3, speed=20),
            r"speed is 20: allowed are numbers up to 3 m/s \(20 cm/s are 0.20\)",
        ),
        (
            lambda: straight(0.3, speed=-0.1),
            r"speed is -0.1: it must be above 0 .*give the sign to the distance",
        ),
        (
            lambda: turn(1.0, turn_rate=-1.0),
            "turn_rate is -1.0: .* above 0 .*give the sign to the angle",
        ),
        (lambda: arc(0.3, 1.0, -0.1), "speed is -0.1: it must be above 0 .*backwards=True drives backwards"),
        (lambda: straight(0.3, tolerance=0.0), "tolerance is 0.0: it must be above 0$"),
        (
            lambda: straight(0.3, 1e-9),
            "speed is 1e-09: allowed are numbers from 0.001 m/s: more slowly it would",
        ),
        (lambda: turn(0.3, 1e-4), "turn_rate is 0.0001: allowed are numbers from 0.001 rad/s"),
        (lambda: move("arm", 0.3, 1e-4), "speed is 0.0001: allowed are numbers from 0.001 rad/s"),
        (lambda: straight(0.3, tolerance=2), r"tolerance is 2: .* up to 0.1 m \(5 mm are 0.005\)"),
        (lambda: follow_path([(0.1, 0.2)], tolerance=2), "tolerance is 2: .* up to 0.1 m"),
        (lambda: turn(deg(90), tolerance=1), r"tolerance is 1: .* up to 0.3 rad \(write deg\(1\)"),
        (lambda: turn_to(0.0, tolerance=1), "tolerance is 1: .* up to 0.3 rad"),
        (lambda: align_on_line("l", "r", tolerance=1), "tolerance is 1: .* up to 0.3 rad"),
        (lambda: align_on_wall(heading=0.0, heading_std=1), "heading_std is 1: .* up to 0.3 rad"),
        (lambda: straight(0.3, timeout=NAN), "timeout is nan: it must be above 0$"),
        (lambda: servo("claw", "open", seconds=-1), "seconds is -1: it must be above 0$"),
        (
            lambda: turn(90),
            r"angle is 90: allowed are numbers up to 1 turn in rad .*write deg\(90\).*turns= allows more",
        ),
        (lambda: turn(15), r"angle is 15: .*write deg\(15\)"),
        (lambda: turn(22.5), r"angle is 22.5: .*write deg\(22.5\)"),
        (
            lambda: turn(deg(1441), turns=4),
            r"angle is 25.1502: .*up to 4 turns .*\(it is 1441 degrees; turns= ",
        ),
        (lambda: turn(1.0, turns=0), "turns is 0: it must be above 0"),
        (lambda: spin("arm", 500), r"speed is 500: allowed are numbers up to 20 rad/s \(write deg\(90\)"),
        (lambda: move("arm", 1.0, 90), "speed is 90: allowed are numbers up to 20 rad/s"),
        (lambda: move_by("arm", 1.0, -1.0), "speed is -1.0: it must be above 0 .*give the sign to the angle"),
        (lambda: turn(float("inf")), "angle is inf: it must be a finite number"),
        (lambda: turn(1.0, turn_rate=90), r"turn_rate is 90: allowed are numbers up to 20 rad/s"),
        (lambda: turn_to(-90), r"heading is -90: .*write deg\(-90\)"),
        (lambda: turn_to(20), r"heading is 20: beyond a full turn .*write deg\(20\) for degrees"),
        (lambda: turn_to(-22.5), r"heading is -22.5: .*write deg\(-22.5\)"),
        (lambda: drive_to(0.4, 0.2, 15), r"heading is 15: .*write deg\(15\)"),
        (lambda: align_on_wall(heading=-7), r"heading is -7: .*write deg\(-7\)"),
        (lambda: arc(0.2, 90), r"angle is 90: .*deg\(90\)"),
        (lambda: arc(0.0, 1.0), r"radius is 0.0 m: it must be above 0 \(turn\(\)"),
        (lambda: arc(25.0, 1.0), "radius is 25: .*30 cm are 0.30"),
        (lambda: arc(0.2, 1.0, 15.0), "speed is 15: .*20 cm/s are 0.20"),
        (lambda: pivot(45, "left"), r"angle is 45: .*deg\(45\)"),
        (lambda: pivot(1.0, "left", 15.0), "speed is 15: .*20 cm/s are 0.20"),
        (lambda: pivot(1.0, "left", -0.1), "speed is -0.1: it must be above 0"),
        (lambda: pivot(1.0, loose("front")), "wheel is 'front': allowed are 'left' and 'right'"),
        (lambda: drive(20), "speed is 20: .*20 cm/s are 0.20"),
        (lambda: drive(0.2, 45), r"turn_rate is 45: .*write deg\(90\) for degrees a second"),
        (lambda: drive_to(40, 20), "x is 40: .*30 cm are 0.30"),
        (lambda: drive_to(0.4, 0.2, 90), r"heading is 90: .*deg\(90\)"),
        (lambda: follow_path([(0.1, 0.2), (0.3, 45)]), r"y of points\[1\] is 45: "),
        (lambda: follow_path([]), "points is empty"),
        (
            lambda: follow_line("front", loose("rear")),
            r"'rear': allowed are 'left' and 'right'; with two tophats write follow_line\(left=..., right=",
        ),
        (lambda: follow_line("front", speed=15), "speed is 15: .*20 cm/s are 0.20"),
        (lambda: follow_line("front", speed=-0.1), "speed is -0.1: it must be above 0"),
        (lambda: align_on_line("left", "right", reach=50), "reach is 50: .*30 cm are 0.30"),
        (lambda: align_on_line("left", "right", squint=45), r"squint is 45: .*write deg\(45\)"),
        (lambda: align_on_wall(6), "speed is 6: .*20 cm/s are 0.20"),
        (lambda: align_on_wall(heading=90), r"heading is 90: .*write deg\(90\)"),
        (lambda: after_angle(90), r"angle is 90: .*deg\(90\)"),
        (lambda: after_distance(50), "distance is 50: .*30 cm are 0.30"),
        (lambda: after_time(-1.0), "seconds is -1: allowed are numbers from 0"),
        (lambda: analog_above(6, 1000), "analog port is 6: allowed are 0 to 5"),
        (lambda: analog_below(-1, 1000), "analog port is -1: allowed are 0 to 5"),
        (
            lambda: analog_above(0, 5000),
            "counts is 5000: allowed are numbers from 0, below 4095",
        ),
        (
            lambda: analog_above(0, 4095),
            "counts is 4095: allowed are numbers from 0, below 4095",
        ),
        (lambda: analog_below(0, 0), "counts is 0: allowed are numbers above 0, up to 4095"),
        (
            lambda: motors(0.5, 0.5, tuned_at=70),
            r"tuned_at is 70: allowed are numbers from 3\.1 to 30 V",
        ),
        (lambda: motors(80, 80), r"left duty is 80: allowed are numbers from -1 to 1 \(80 % are 0.8\)"),
        (lambda: motors(0.5, 0.5, tuned_at=NAN), "tuned_at is nan: it must be a finite number"),
        (lambda: pressed(10), "digital port is 10: allowed are 0 to 9"),
        (lambda: pressed(loose(5.0)), r"digital port is 5\.0: allowed are 0 to 9"),
        (lambda: pressed(True), "digital port is True: allowed are 0 to 9"),
        (lambda: repeat(wait(1.0), loose(2.5)), r"times is 2\.5: allowed are whole numbers from 0"),
    ],
)
def test_a_wrong_number_or_unit_is_refused_when_it_is_written(make: Callable[[], object], said: str) -> None:
    with pytest.raises(ValueError, match=said):
        make()


def test_more_than_a_turn_is_turned_where_it_is_asked_for() -> None:
    for make in (
        lambda: turn(deg(360)),
        lambda: turn(-deg(90) - deg(270)),
        lambda: turn_to(deg(720)),
        lambda: turn_to(deg(-1000)),
        lambda: turn(deg(720), turns=2),
        lambda: arc(0.3, deg(720), turns=2),
        lambda: pivot(deg(720), "left", turns=2),
        lambda: after_angle(deg(720), turns=2),
        lambda: turn_to(deg(720)),
    ):
        make()


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (
            lambda: seq(straight(0.1), ANY),
            r"seq\(\) takes an Action, not the function straight: call it, str",
        ),
        (
            lambda: seq(loose([wait(1.0)])),
            r"seq\(\) takes an Action, not \[<Action wait 1 s>\]: write seq\(\*actions\)",
        ),
        (lambda: parallel(wait(1.0), loose(None)), r"parallel\(\) takes an Action, not None"),
        (
            lambda: race(wait(1.0), loose(after_time(1.0))),
            r"race\(\) takes an Action, not <Condition after 1 s>: write wait_for\(",
        ),
        (lambda: repeat(ANY), r"repeat\(\) takes an Action"),
        (lambda: background(ANY), r"background\(\) takes an Action"),
        (
            lambda: do(loose(straight(0.1))),
            r"do\(\) takes a function of the robot, not <Action straight 0.1 m>",
        ),
        (
            lambda: wait(1.0).then(loose(wait(1.0))),
            r"wait 1 s: then\(\) takes a function of the result, not <Action wait 1 s>: write lambda result",
        ),
        (
            lambda: do(loose(lambda: 3)),
            r"do\(\) takes a function of the robot, not <lambda>\(\): write lambda robot: ",
        ),
        (
            lambda: do(loose(None)),  # do(play(robot)), which has played by then
            r"do\(\) takes a function of the robot, not None: give its name without \(\), which would call "
            r"it at",
        ),
        (lambda: when(loose(lambda: True)), r"when\(\) takes a function of the robot, not <lambda>\(\): "),
        (
            lambda: wait(1.0).then(loose(lambda: wait(1.0))),
            r"then\(\) takes a function of the result, not <lambda>\(\): write l",
        ),
        (
            lambda: drive(0.1).until(loose(on_black)),
            "takes a Condition, not the function on_black: call it, on_black",
        ),
        (lambda: drive(0.1).until(loose(lambda _: True)), r"not the function <lambda>; when\(lambda robot"),
        (lambda: wait_for(loose(1.0)), r"wait_for\(\) takes a Condition, not 1.0"),
        (lambda: wait(1.0).timeout_or(1.0, ANY), r"timeout_or\(\) takes an Action"),
        (lambda: after_time(1.0) | loose(True), r"\| takes a Condition, not True"),
        (lambda: when(loose(True)), r"when\(\) takes a function of the robot, not True"),
        (
            lambda: straight(loose("0.3")),
            r"distance is '0\.3': it must be a number, up to 10 m .*30 cm are 0\.30",
        ),
        (lambda: straight(loose(None)), "distance is None: it must be a number"),
        (lambda: straight(0.3, loose("fast")), r"speed is 'fast': it must be a number, up to 3 m/s"),
        (lambda: straight(0.3, timeout=loose("5")), "timeout is '5': it must be a number, above 0"),
        (lambda: turn(loose("90")), r"angle is '90': it must be a number, up to 1 turn .*deg\(90\)"),
        (lambda: drive(0.1, loose("1")), "turn_rate is '1': it must be a number, up to 20 rad/s"),
        (lambda: drive(loose(None)), "speed is None: it must be a number"),
        (lambda: drive(0.1, loose(None)), "turn_rate is None: it must be a number"),
        (lambda: align_on_wall(loose(None)), "speed is None: it must be a number"),
        (lambda: spin("arm", loose(None)), "speed is None: it must be a number"),
        (lambda: motors(loose("a"), 0.0), "left duty is 'a': it must be a number, from -1 to 1"),
        (lambda: spin("arm", loose("2")), "speed is '2': it must be a number, up to 20 rad/s"),
        (lambda: wait(loose("1")), "seconds is '1': it must be a number, from 0"),
        (lambda: wait(1.0).timeout(loose("1")), "seconds is '1': it must be a number, above 0"),
        (lambda: wait(1.0).timeout(loose(None)), "seconds is None: it must be a number, above 0"),
        (lambda: align_on_wall(timeout=loose(None)), "timeout is None: it must be a number, above 0"),
        (lambda: align_on_wall(heading_std=loose(None)), "heading_std is None: it must be a number"),
        (lambda: follow_path([(0.1, 0.0)], rounding=loose(None)), "rounding is None: it must be a number"),
        (lambda: wait_for_light(0, loose(1500)), "calibration takes a StartLightCalibration, not 1500; cal"),
        (lambda: rehearse_light(0, loose("lamp")), "calibration takes a StartLightCalibration, not 'lamp'"),
        (lambda: rehearse_light(0, seconds=loose("9")), "seconds is '9': it must be a number"),
        (
            lambda: Condition("mine", ANY(0.1)),
            "condition 'mine': start is <Action .* a function.robot. that returns",
        ),
        (lambda: follow_path(loose({(0.1, 0.0), (0.3, 0.2)})), r"points is {.*}: it must be a list of \(x"),
        (
            lambda: Robot(simulated_port(), loose("robot.toml")),
            "config takes a RobotConfig, not 'robot.toml'; l",
        ),
        (lambda: check_battery(loose(None)), "tolerance is None: it must be a number, above 0"),
        (lambda: after_time(loose([1.0])), r"seconds is \[1\.0\]: it must be a number, from 0"),
        (lambda: analog_above(0, loose("3")), "counts is '3': it must be a number, from 0, below 4095"),
        (lambda: repeat(wait(1.0), loose("3")), "times is '3': it must be a number"),
        # Python counts True as 1.
        (lambda: straight(True), "distance is True: it must be a number, up to 10 m"),
        (lambda: straight(loose(np.True_)), "distance is .*True_?: it must be a number, up to 10 m"),
        (lambda: turn(1.0, True), "rate is True: it must be a number"),
        (lambda: drive(0.1, False), "turn_rate is False: it must be a number"),
        (lambda: motors(0.5, 0.5, tuned_at=loose("7")), "tuned_at is '7': it must be a number"),
        (lambda: motors(True, True), "left duty is True: it must be a number"),
        (lambda: wait(True), "seconds is True: it must be a number"),
        (
            lambda: follow_path(loose(0.1), 0.2),
            r"points is 0.1: it must be a list of \(x, y\), m of the field",
        ),
        (lambda: follow_path([(0.1, False)]), r"y of points\[0\] is False: it must be a number"),
        (lambda: servo("claw", True), "to is True: it must be a number, a pulse in us, or a name"),
        (lambda: loose(follow_line)("left", left="left", right="right"), "one tophat and its edge, or two"),
        (lambda: loose(follow_line)(), "needs the name of one tophat, or of two"),
        (
            lambda: follow_path([loose((0.1, 0.0, 0.0))]),
            r"points\[0\] is \(0\.1, 0\.0, 0\.0\): it must be \(x, y\)",
        ),
        (
            lambda: follow_path([(0.1, 0.0), loose(0.2)]),
            r"points\[1\] is 0\.2: it must be \(x, y\), m of the",
        ),
        (lambda: follow_path([(0.1, loose("0"))]), r"y of points\[0\] is '0': it must be a number"),
    ],
)
def test_a_wrong_kind_is_refused_when_it_is_written(make: Callable[[], object], said: str) -> None:
    with pytest.raises(TypeError, match=said):
        make()


def test_reading_a_port_that_is_not_there_is_refused() -> None:
    with open_robot(CONFIG, port=simulated_port()) as robot:
        for port in (-1, 6, loose("0")):
            with pytest.raises(ValueError, match=f"analog port is {port!r}: allowed are 0 to 5"):
                robot.analog(port)
        for port in (-1, 10):
            with pytest.raises(ValueError, match=f"digital port is {port}: allowed are 0 to 9"):
                robot.digital(port)
        robot.tick()
        assert robot.analog(5) is not None
        assert robot.digital(9) is False


@pytest.mark.parametrize(
    "asked", [(NAN, 0.0), (0.1, NAN), (float("-inf"), 0.0), (float("inf"), float("-inf"))]
)
def test_a_loop_that_asks_for_no_number_is_refused(asked: tuple[float, float]) -> None:
    """It drove ahead at full power, also where -inf was asked for."""
    with open_robot(CONFIG, port=simulated_port()) as robot:
        robot.run(wait(0.5))
        robot.drive.velocity(0.1)
        robot.tick()
        with pytest.raises(ValueError, match=r"is -?(nan|inf): it must be a finite number"):
            robot.drive.velocity(*asked)
        robot.tick()
        assert robot.outputs.duty == (0.0,) * 4


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ((100, 0), r"forward is 100: allowed are numbers up to 3 m/s \(20 cm/s are 0\.20\)"),
        ((0.1, 90), r"turn_rate is 90: allowed are numbers up to 20 rad/s \(write deg\(90\)"),
        ((True,), "forward is True: it must be a number"),
        (("0.1",), r"forward is '0\.1': it must be a number"),
        ((None,), "forward is None: it must be a number"),
        ((0.1, 0.0, True), "acceleration is True: it must be a number"),
        ((0.1, 0.0, 0.0, NAN), "nan rad/s2: all of them must be finite numbers"),
    ],
)
def test_a_loop_is_asked_for_its_units_as_a_motion_is(asked: tuple[Any, ...], said: str) -> None:
    with open_robot(CONFIG, port=simulated_port()) as robot:
        with pytest.raises((TypeError, ValueError), match=said):
            robot.drive.velocity(*asked)
        with pytest.raises(TypeError, match="left duty is True"):
            robot.drive.duties(True, 0.0)
        for duty in (80.0, -1.01, NAN):
            with pytest.raises(ValueError, match=r"right duty is .*: allowed are numbers from -1 to 1"):
                robot.drive.duties(0.0, duty)
        robot.drive.velocity(3.0, -20.0)
        robot.tick()


def test_a_motion_after_a_loop_that_ended_before_its_tick_is_no_second_one() -> None:
    """It was said to drive at the same time as another action, of which there was none."""
    with open_robot(CONFIG, port=simulated_port()) as robot:
        robot.run(wait(0.5))
        robot.drive.velocity(0.1)
        assert robot.run(straight(0.05)).along == pytest.approx(0.0, abs=0.002)


def test_speeds_that_no_tick_follows_are_said_to_drive_nothing() -> None:
    """The robot stood, without a word: as `mav(); msleep(100);` in C looks like here."""
    with open_robot(CONFIG, port=simulated_port()) as robot:
        for _ in range(3):  # loops that are left before their tick
            robot.drive.velocity(0.1)
            robot.tick()
            robot.drive.velocity(0.1)
            robot.run(wait(0.1))
        assert not robot.drive.remarks
        for _ in range(3):
            robot.drive.velocity(0.1)
            robot.run(wait(0.1))
        (said,) = robot.drive.remarks.values()
        assert "lasts for one robot.tick() only" in said


def test_what_opens_no_robot_is_refused_by_its_name() -> None:
    with pytest.raises(TypeError, match="config is 3: it must be the name of"):
        open_robot(loose(3))
    for seed in (-1, 1.5, "a"):
        with pytest.raises(ValueError, match=f"seed is {seed!r}: it must be a whole number from 0"):
            open_robot(CONFIG, seed=loose(seed))
    with open_robot(replace(CONFIG, name="drumbot"), port=simulated_port(), seed=loose(np.int64(3))) as robot:
        robot.tick()
        assert repr(robot) == "<Robot drumbot: x 0.000 m, y 0.000 m, heading 0.0 deg, ok>"


def test_what_is_no_port_is_refused_by_its_name() -> None:
    with pytest.raises(TypeError, match=r"port is 'sim': it must be a Port; .* controller\.port is opened"):
        open_robot(CONFIG, port=loose("sim"))


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: calibrate_tophats(loose(0.6)), r"first, not 0.6: write calibrate_tophats\(robot,"),
        (lambda: load_tophats(loose("hall.json")), r"load_tophats\(\) takes .* first, not 'hall.json'"),
        (lambda: calibrate_drive(loose(lambda: 0.6), ANY), r"calibrate_drive\(\) takes the robot first"),
        (lambda: calibrate_light(loose(5), ANY, ANY), r"calibrate_light\(\) takes the robot first, not 5"),
        (lambda: run_match(loose(straight(0.1)), ANY), r"run_match\(\) takes .* first, not <Action straight"),
    ],
)  # fmt: skip
def test_a_robot_that_was_left_out_is_asked_for(make: Callable[[], object], said: str) -> None:
    with pytest.raises(TypeError, match=said):
        make()


def test_a_robot_that_is_not_open_yet_says_so_wherever_it_is_handed_in() -> None:
    with pytest.raises(AttributeError, match="the robot is not open yet"):
        run_match(loose(open_robot(CONFIG, port=simulated_port())), straight(0.1))


@pytest.mark.parametrize(
    "drives",
    [
        lambda robot: calibrate_tophats(robot),
        lambda robot: calibrate_tophats_by_hand(robot),
        lambda robot: calibrate_drive(robot, lambda: 0.6),
        lambda robot: calibrate_light(robot, 3, lambda: None),
        lambda robot: run_match(robot, straight(0.1)),
    ],
)
def test_what_runs_actions_by_itself_is_no_step(drives: Callable[[Robot], Any]) -> None:
    """It named the first action inside, such as seq(watched wait 0.4 s, ...), that no program has."""

    def calibrate(robot: Robot) -> None:
        drives(robot)

    with open_robot(CONFIG, port=simulated_port()) as robot:
        why = r"^(calibrate_\w+|run_match)\(\) inside run\(seq\(wait 0 s, do calibrate\)\): call it between"
        with pytest.raises(RuntimeError, match=why):
            robot.run(seq(wait(0.0), do(calibrate)))


def test_a_long_thing_in_place_of_an_action_does_not_bury_the_message() -> None:
    with open_robot(CONFIG, port=simulated_port()) as robot, pytest.raises(TypeError) as caught:
        robot.run(loose({"front": "many numbers " * 50}))
    assert len(str(caught.value)) < 120


def test_a_cycle_within_a_cycle_is_refused() -> None:
    """It took the drive's command away: the wheels stopped for a tick."""
    with open_robot(CONFIG, port=simulated_port()) as robot:
        ticks = do(lambda robot: robot.tick(), "ticks")
        with pytest.raises(RuntimeError, match=r"tick\(\) inside run\(parallel.*let time pass with wait\(\)"):
            robot.run(parallel(drive(0.1), seq(wait(0.2), ticks)))
        robot.add_background(ticks)
        with pytest.raises(RuntimeError, match=r"tick\(\) inside tick\(\)"):
            robot.tick()
        robot.tick()


@pytest.mark.parametrize("taped", [0.601, lambda metres: metres], ids=["a number", "a function of something"])
def test_a_calibration_that_cannot_ask_is_refused_before_it_drives(taped: object) -> None:
    with open_robot(CONFIG, port=simulated_port()) as robot:
        said = r"calibrate_drive\(\) takes a function without arguments, not (0\.601|<lambda>\(metres\))"
        with pytest.raises(TypeError, match=said):
            calibrate_drive(robot, loose(taped))
        with pytest.raises(ValueError, match="tape_std is 0: it must be above 0"):
            calibrate_drive(robot, lambda: 0.6, tape_std=0)
        with pytest.raises(
            TypeError, match=r"calibrate_light\(\) takes a function without arguments, not None"
        ):
            calibrate_light(robot, 5, loose(None))
        assert robot.ticks == 0


def test_a_second_thread_is_told_that_there_is_one() -> None:
    """It was told to compose actions, which it had never heard of."""
    refused: list[str] = []

    def also(robot: Robot) -> None:
        for wrong in (lambda: robot.run(straight(0.1)), robot.tick):
            with pytest.raises(RuntimeError) as error:
                wrong()
            refused.append(str(error.value))

    def meanwhile(robot: Robot) -> None:
        thread = Thread(target=also, args=(robot,))
        thread.start()
        thread.join()

    with open_robot(CONFIG, port=simulated_port()) as robot:
        robot.run(do(meanwhile, "threads"))
    said = "while another thread is in run(threads): use a robot from one thread only; "
    assert [text.partition("to do")[0] for text in refused] == [
        f"run(straight 0.1 m) {said}",
        f"tick() {said}",
    ]


@pytest.mark.parametrize("kind", [np.float64, np.float32])
@pytest.mark.parametrize(
    "make",
    [
        lambda n: straight(n(0.05), n(0.1)),
        lambda n: turn(np.radians(n(10.0)), n(1.0)),
        lambda n: turn_to(n(0.1)),
        lambda n: arc(n(0.2), n(0.2), n(0.1)),
        lambda n: pivot(n(0.1), "left"),
        lambda n: drive_to(n(0.05), n(0.02), n(0.0)),
        lambda n: follow_path(loose(np.array([(0.05, 0.0), (0.1, 0.05)], n))),
        lambda n: drive(n(0.1), n(0.1)).until(after_distance(n(0.03))),
        lambda n: motors(n(0.3), n(0.3)).until(after_time(n(0.1))),
        lambda n: move("arm", n(0.2)),
        lambda n: spin("arm", n(1.0)).until(after_time(n(0.1))),
        lambda n: servo("claw", n(1300.0), n(0.2)),
        lambda n: repeat(do(lambda robot: robot.drive.velocity(n(0.1), n(0.0)))).until(after_time(n(0.1))),
        lambda n: repeat(do(lambda robot: robot.drive.duties(n(0.1), n(0.0)))).until(after_time(n(0.1))),
    ],
)
def test_numbers_of_numpy_are_numbers(make: Callable[[Any], Action[Any]], kind: Any) -> None:
    """np.radians(90) made every motion fail in the middle, with the robot on its way."""
    config = replace(CONFIG, servos={"claw": ServoConfig()}, mechanisms={"arm": MechanismConfig()})
    result, _, robot = run(make(kind), simulated_port(config=config), config)
    numbers = [*robot.outputs.duty, *robot.outputs.servo_us, robot.plan.x, robot.plan.y, robot.plan.heading]
    if isinstance(result, MotionResult):
        numbers += [value for value in astuple(result) if not isinstance(value, tuple)]
    assert {type(number) for number in numbers} <= {float, int, bool, type(None)}


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        ("half", r"the taped way is 'half': it must be a number, up to 10 m either way"),
        (60.0, r"the taped way is 60: allowed are numbers up to 10 m either way \(30 cm are 0\.30\)"),
    ],
)
def test_a_wrong_answer_of_the_tape_is_named(answer: object, said: str) -> None:
    with (
        open_robot(CONFIG, port=simulated_port()) as robot,
        pytest.raises((TypeError, ValueError), match=said),
    ):
        calibrate_drive(robot, loose(lambda: answer), distance=0.05)


def test_who_mistypes_the_tape_is_asked_again(caplog: pytest.LogCaptureFixture) -> None:
    """Otherwise the robot would have to drive again. What `input` gives is a text, somewhere with a comma."""
    answers = iter(["abc", 60, "0,301"])
    with open_robot(CONFIG, port=simulated_port()) as robot:
        found = calibrate_drive(robot, loose(lambda: next(answers)), distance=0.30)
    ticks = found.motor(0).radians_per_tick
    assert ticks is not None
    assert ticks.value == pytest.approx(SCALE.value * 0.301 / 0.3, rel=0.005)
    assert "the taped way is 'abc': it must be a number" in caplog.text
    assert "the taped way is 60: allowed are numbers up to 10 m" in caplog.text


def test_a_robot_that_was_not_opened_by_a_block_says_how() -> None:
    opened = open_robot(CONFIG, port=simulated_port())
    with pytest.raises(AttributeError, match="no run: write `with open_robot"):
        loose(opened).run(wait(0.1))
    with opened as robot:
        robot.tick()


def test_running_what_is_no_action_is_refused() -> None:
    with open_robot(CONFIG, port=simulated_port()) as robot:
        with pytest.raises(TypeError, match=r"run\(\) takes an Action, not the function straight: call it"):
            robot.run(ANY)
        with pytest.raises(TypeError, match=r"not \[<Action wait 1 s>\]: write seq\(\*actions\) for a list"):
            robot.run(loose([wait(1.0)]))
        with pytest.raises(
            TypeError, match=r"not \(<Action wait 1 s>, <Action wait 2 s>\): write seq\(\*actions\)"
        ):
            robot.run(wait(1.0), loose(wait(2.0)))
        with pytest.raises(TypeError, match=r"run\(\) takes an Action, not None"):
            robot.run(loose(None))
        with pytest.raises(TypeError, match=r"from its function then\(\) takes an Action, not None"):
            robot.run(wait(0.1).then(loose(lambda _: None)))
        with pytest.raises(TypeError, match=r"action 'straight 1 m' is neither true nor false"):
            robot.run(wait_for(when(loose(lambda _: straight(1.0)))))
        for program in (None, lambda: None):
            with pytest.raises(TypeError, match=r"run_match\(\) takes a function of the robot, not "):
                run_match(robot, loose(program))


@pytest.mark.parametrize(
    "both",
    [
        lambda: parallel(straight(0.3), turn(deg(90))),
        lambda: parallel(straight(0.3), align_on_wall()),
        lambda: seq(background(drive(0.1)), straight(0.3)),
        lambda: race(straight(0.3), repeat(do(lambda robot: robot.drive.duties(0.3, 0.3)))),
    ],
    ids=["in parallel", "at a wall", "in the background", "by hand"],
)
def test_two_that_drive_at_once_are_refused(both: Callable[[], Action[Any]]) -> None:
    with open_robot(CONFIG, port=simulated_port()) as robot:
        robot.run(wait(0.5))
        with pytest.raises(RuntimeError, match="two actions drive the wheels at the same time"):
            robot.run(both())
        assert robot.outputs.duty[:2] == (0.0, 0.0)
        robot.run(straight(0.02))


def test_a_loop_that_forgets_its_tick_is_told_of_it() -> None:
    with open_robot(CONFIG, port=simulated_port()) as robot:
        robot.drive.velocity(0.15)
        with pytest.raises(RuntimeError, match=r"call robot\.tick\(\) after each"):
            robot.drive.velocity(0.15)


def test_one_that_drives_beside_others_that_do_not_is_allowed() -> None:
    beside = parallel(straight(0.1), wait(0.5), repeat(do(lambda _: None)).until(after_time(0.3)))
    results, _, _ = run(seq(beside, race(straight(0.5), wait(0.3)), straight(0.05)))
    assert results[2].along == pytest.approx(0.0, abs=0.002)


def test_what_beginners_write_is_answered_with_what_they_meant() -> None:
    def steps(robot: Robot) -> Any:
        yield from loose(straight(0.1))

    with open_robot(CONFIG, port=simulated_port()) as robot:
        for name, said in (
            ("straight", r"write robot\.run\(straight\("),
            ("straght", r"no straght \(did you mean straight\?\): write robot\.run\(straight\("),
            ("heading", r"write robot\.pose\.heading"),
            ("gyro", r"write robot\.estimate\.turn_rate"),
            ("sleep", r"write robot\.run\(wait\("),
        ):
            with pytest.raises(AttributeError, match=said):
                getattr(robot, name)
        with pytest.raises(AttributeError, match=r"a robot has no wheelbase$"):
            loose(robot).wheelbase  # noqa: B018
        with pytest.raises(TypeError, match=r"yield from action\.start\(robot\)"):
            robot.run(Action("mine", steps))
        with pytest.raises(TypeError, match=r"not what the function steps yields.* Action\('steps', steps\)"):
            robot.run(steps(robot))
        with pytest.raises(TypeError, match=r"not the result of one: run\(\) has already run it"):
            seq(wait(0.1), loose(robot.run(straight(0.02))))
        assert robot.outputs.duty[:2] == (0.0, 0.0)


@pytest.mark.parametrize("make", [wait, after_time])
def test_a_wait_in_milliseconds_is_refused(make: Callable[[float], object]) -> None:
    """The robot would stand for the whole match."""
    with pytest.raises(ValueError, match=r"seconds is 1000: .* from 0 to 600 s \(500 ms are 0\.5\)"):
        make(1000)


def test_a_property_of_the_robot_that_fails_fails_with_its_own_error() -> None:
    class Broken(Robot):
        @property
        def broken(self) -> float:
            return float(loose(None).nothing_like_it)

    with Broken(simulated_port(), CONFIG) as robot, pytest.raises(AttributeError, match="nothing_like_it"):
        robot.broken  # noqa: B018


NAMES = replace(
    CONFIG,
    servos={"claw": ServoConfig(positions_us={"open": 1200.0})},
    mechanisms={"arm": MechanismConfig(motor=2)},
)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (servo("claw", "opn"), "servo.claw has no position 'opn'"),
        (servo("claw", 3000), "pulse of servo claw is 3000 us"),
        (servo("hand", "open"), "there is no servo 'hand'"),
        (servo_off("hand"), "there is no servo 'hand'"),
        (move("arm", 90), r"to is 90: allowed are numbers up to 1 turn .*mechanism\.arm\.turns"),
        (move_by("leg", 1.0), "there is no mechanism 'leg'"),
        (spin("leg", 1.0), "there is no mechanism 'leg'"),
        (release("leg"), "there is no mechanism 'leg'"),
        (zero("arm", 90.0), "angle is 90"),
        (drive(0.1).until(after_time(1.0) | ~on_black("midle")), "there is no tophat 'midle'"),
        (wait_for(over_line("midle") & blocked("arm")), "there is no tophat 'midle'"),
        (drive(0.1).until(blocked("leg")), "there is no mechanism 'leg'"),
        (follow_line("midle"), "there is no tophat 'midle'"),
        (align_on_line("right", "left"), "tophat right is not to the left of left"),
    ],
)
@pytest.mark.parametrize(
    "within",
    [
        lambda wrong: seq(straight(0.1), wrong),
        lambda wrong: parallel(straight(0.1), seq(wait(1.0), background(wrong))),
        lambda wrong: race(straight(0.1), repeat(wrong).timeout(1.0)),
        lambda wrong: mission(straight(0.1), timed(wrong, "late")),
        lambda wrong: straight(0.1).timeout_or(1.0, wrong).until(after_time(5.0)).then(lambda _: wait(1.0)),
    ],
    ids=["seq", "parallel", "race", "mission", "timeout_or"],
)
def test_what_robot_toml_lacks_is_said_before_anything_moves(
    wrong: Action[Any], said: str, within: Callable[[Action[Any]], Action[Any]]
) -> None:
    """It drove for five seconds, and then there was no such place of the claw."""
    with open_robot(NAMES, port=simulated_port(config=NAMES)) as robot:
        with pytest.raises(ValueError, match=said):
            robot.run(within(wrong))
        with pytest.raises(ValueError, match=said):
            run_match(robot, within(wrong), start=wait(1.0))
        assert robot.ticks == 0
        with pytest.raises(ValueError, match=said):
            robot.run(do(lambda _: within(wrong)))
        assert robot.outputs.duty == (0.0,) * 4


def test_the_check_of_an_action_of_ones_own_is_asked_too() -> None:
    def refuse(_robot: Robot) -> None:
        raise ValueError("not on this table")

    with open_robot(CONFIG, port=simulated_port()) as robot:
        with pytest.raises(ValueError, match="not on this table"):
            robot.run(seq(straight(0.1), Action("mine", wait(1.0).start, refuse)))
        assert robot.ticks == 0


def its_steps(_robot: Robot) -> Any:
    yield


async def waits(_robot: Robot) -> None:
    """Nothing."""


def test_a_function_whose_steps_nobody_would_go_through_is_refused() -> None:
    """It was left undone without a word, and the match had finished."""
    with open_robot(CONFIG, port=simulated_port()) as robot:
        for function in (its_steps, waits):
            name = function.__name__
            for refused in (
                lambda function=function: do(function),
                lambda function=function: when(function),
                lambda function=function: run_match(robot, function),
            ):
                with pytest.raises(TypeError, match=rf"{name} has steps .* write Action\('{name}', {name}\)"):
                    refused()
        for made in (do(lambda _: its_steps(robot)), do(lambda _: waits(robot))):
            with pytest.raises(TypeError, match=r"the function of do\(\) returns .*: return Action\('"):
                robot.run(made)
        with pytest.raises(TypeError, match="the function straight without calling it: write straight"):
            robot.run(do(lambda _: straight))
        with pytest.raises(TypeError, match=r"the program returns the function straight"):
            run_match(robot, lambda _: straight)


def test_a_mission_of_what_is_no_action_is_refused_when_it_is_written() -> None:
    with pytest.raises(TypeError, match=r"mission\(\) takes an Action, not 3"):
        mission(straight(0.1), loose(3))
    with pytest.raises(TypeError, match=r"timed\(\) takes an Action, not the function straight"):
        timed(ANY)
