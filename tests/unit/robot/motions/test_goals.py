"""Motions on the simulated robot, judged by its true pose."""

import math
from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import pytest

from raccoon import (
    Action,
    MotionResult,
    MotionTimeout,
    Pose,
    Robot,
    RobotConfig,
    after_angle,
    after_distance,
    after_time,
    arc,
    deg,
    drive,
    drive_to,
    follow_path,
    motors,
    open_robot,
    pivot,
    pressed,
    seq,
    spin,
    straight,
    turn,
    turn_to,
    wait,
    wait_for,
    when,
)
from raccoon.core.config import ControllerConfig, MechanismConfig
from raccoon.core.readings import STOP, Outputs
from raccoon.robot import remarks
from raccoon.robot.actions.steps import Steps
from raccoon.robot.emulated import open_emulated
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.sim.world.table import World
from robots import CONFIG, InterceptingPort, run, simulated_port


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_the_outer_wheel_of_an_arc_has_the_speed_that_was_asked_for(way: float) -> None:
    fastest = [0.0, 0.0]

    def seen(robot: Robot) -> bool:
        for side, speed in enumerate((robot.estimate.left_speed, robot.estimate.right_speed)):
            fastest[side] = max(fastest[side], 0.0345 * speed)
        return False

    run(arc(0.2, way * deg(90), speed=0.15).until(when(seen)))
    inner, outer = fastest if way > 0.0 else fastest[::-1]
    assert outer == pytest.approx(0.15, abs=0.01)
    assert inner == pytest.approx(0.15 * (0.2 - 0.08) / (0.2 + 0.08), abs=0.01)


@pytest.mark.parametrize("motion", [arc(0.01, deg(90)), pivot(deg(90), "left")])
def test_a_tight_arc_keeps_its_speed_and_ends_with_its_outer_wheel_on_the_mark(
    motion: Action[MotionResult],
) -> None:
    """The outer wheel's way at 0.15 m/s, 0.75 s more to speed up, slow down and close in. Sped up as hard as
    a straight its outer wheel would take nine times the voltage, for which 0.06 m/s were left."""
    result, end, robot = run(motion)
    half = robot.drive.half_track
    way = deg(90) * (half + 0.01 if "arc" in motion.name else 2.0 * half)
    assert result.planned > 0.95
    assert result.duration < way / 0.15 + 0.75
    assert math.degrees(end.heading) == pytest.approx(90.0, abs=0.75)


def test_the_wheel_that_stands_in_a_pivot_may_be_held_by_friction() -> None:
    """In a dead band of 20 % it takes more than a stalled wheel's spare volts to turn it by a hair."""
    port = simulated_port(seed=2, effects={"actuation.deadband": {"duty": 0.2}})
    _, end, robot = run(pivot(deg(-90), "left"), port)
    assert math.degrees(end.heading) == pytest.approx(-90.0, abs=0.75)
    assert robot.drive.remarks == {}


@pytest.mark.parametrize(
    ("motion", "said"),
    [
        (pivot(deg(-40), "left", timeout=0.05), r"pivot not done after 0\.1 s: -?0\.\d of -40\.0 deg; "),
        (arc(0.2, deg(40), backwards=True, timeout=0.05), r"arc not done after 0\.1 s: -?0\.\d of 40\.0 deg"),
    ],
)
def test_a_motion_that_gives_up_says_what_it_is_and_how_much_of_its_angle_was_turned(
    motion: Action[MotionResult], said: str
) -> None:
    with pytest.raises(MotionTimeout, match=said):
        run(motion)


@pytest.mark.parametrize("distance", [0.6, -0.3, 0.03])
def test_straight_ends_on_the_mark(distance: float) -> None:
    _, end, _ = run(straight(distance))
    assert end.x == pytest.approx(distance, abs=0.003)
    assert end.y == pytest.approx(0.0, abs=0.003)
    assert math.degrees(end.heading) == pytest.approx(0.0, abs=0.5)


@pytest.mark.parametrize("angle_deg", [90, -90, 5, 200])
def test_turn_ends_on_its_angle(angle_deg: float) -> None:
    _, end, _ = run(turn(deg(angle_deg)))
    assert math.degrees(end.heading) == pytest.approx(angle_deg, abs=0.5)
    assert math.hypot(end.x, end.y) < 0.005


def test_turn_to_takes_the_shorter_way_and_means_the_field() -> None:
    _, end, _ = run(seq(turn(deg(170)), turn_to(deg(-170))))
    assert math.degrees(end.heading) == pytest.approx(190.0, abs=0.7)


@pytest.mark.parametrize("off", [-1e-3, 1e-3])
@pytest.mark.parametrize(
    ("motion", "way"),
    [
        (turn_to(deg(180)), 1.0),
        (turn_to(deg(-180)), -1.0),
        (turn_to(deg(540)), 1.0),
        (drive_to(-0.3, 0.0), 1.0),
        (drive_to(0.0, 0.0, deg(-180)), -1.0),
        (follow_path([(-0.3, 0.0)]), 1.0),
        (follow_path([(0.3, 0.0)], backwards=True), 1.0),
    ],
    ids=lambda each: each.name if isinstance(each, Action) else None,
)
def test_half_a_turn_goes_one_way_whatever_the_noise(
    motion: Action[MotionResult], way: float, off: float
) -> None:
    """Where it began 0.06 degrees to the left it went to the right, and the other way round."""

    def begun(robot: Robot) -> Steps[None]:
        robot.plan = Pose(0.0, 0.0, off)
        yield from motion.until(after_angle(deg(5))).start(robot)

    _, end, _ = run(Action("half a turn", begun))
    assert way * end.heading > deg(4)


@pytest.mark.parametrize("angle_deg", [90, -60])
def test_arc_ends_where_the_circle_does(angle_deg: float) -> None:
    radius, angle = 0.25, deg(angle_deg)
    _, end, _ = run(arc(radius, angle))
    assert end.x == pytest.approx(radius * math.sin(abs(angle)), abs=0.006)
    assert end.y == pytest.approx(math.copysign(radius * (1 - math.cos(angle)), angle), abs=0.006)
    assert math.degrees(end.heading) == pytest.approx(angle_deg, abs=0.7)


@pytest.mark.parametrize("battery", [6.1, 7.0])
def test_the_battery_does_not_matter(battery: float) -> None:
    port = simulated_port(effects={"battery.open_circuit_voltage": {"voltage": battery}})
    _, end, _ = run(straight(0.5), port)
    assert end.x == pytest.approx(0.5, abs=0.003)


def test_drive_until_a_distance_holds_its_heading() -> None:
    _, end, robot = run(drive(0.15).until(after_distance(0.4)))
    assert end.x == pytest.approx(0.4, abs=0.02)  # it stops from full speed
    assert math.degrees(end.heading) == pytest.approx(0.0, abs=0.5)
    assert robot.plan.heading == pytest.approx(0.0, abs=1e-3)


def test_drive_with_a_turn_rate_until_an_angle() -> None:
    _, end, _ = run(drive(0.1, 0.5).until(after_angle(deg(45))))
    assert math.degrees(end.heading) == pytest.approx(45.0, abs=3.0)


def test_errors_of_one_motion_are_made_good_by_the_next() -> None:
    legs = [straight(0.05)] * 6
    _, end, _ = run(seq(*legs))
    assert end.x == pytest.approx(0.3, abs=0.004)


def test_a_blocked_robot_gives_up_and_says_why() -> None:
    with pytest.raises(MotionTimeout, match=r"no motion at left \(motor port 0\) and right"):
        run(straight(0.2), InterceptingPort(sent=lambda _: STOP))


def test_a_robot_that_was_moved_does_not_drive_back() -> None:
    with open_robot(CONFIG, port=simulated_port()) as robot:
        robot.run(wait(0.5))
        robot.odometry.reset(1.0, 2.0, 0.5)
        assert robot.plan.x == pytest.approx(1.0, abs=1e-3)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: straight(math.nan), "distance is nan"),
        (lambda: straight(1.0, speed=-0.2), "speed is -0.2: it must be above 0"),
        (lambda: turn(math.inf), "angle is inf"),
        (lambda: arc(0.0, 1.0), "radius is 0.0 m"),
        (lambda: drive(math.nan), "speed is nan"),
    ],
)
def test_nonsense_is_refused_before_anything_moves(make: Callable[[], object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()


class Listening(SimPort):
    """The simulated robot, and the duties of its left wheel."""

    def __init__(self, config: RobotConfig) -> None:
        super().__init__(Parameters.from_robot(config), robot=config, rate_hz=config.controller.rate_hz)
        self.duties: list[float] = []

    def write(self, outputs: Outputs) -> None:
        self.duties.append(outputs.duty[0])
        super().write(outputs)


@pytest.mark.parametrize("rate_hz", [20.0, 50.0])
def test_a_slow_loop_drives_as_steadily(rate_hz: float) -> None:
    config = replace(CONFIG, controller=ControllerConfig(rate_hz=rate_hz))
    port = Listening(config)
    with open_robot(config, port=port) as robot:
        robot.run(wait(0.5))
        assert abs(robot.run(straight(0.5)).along) < 0.002
        assert sum(abs(after - before) for before, after in pairwise(port.duties)) < 4.0
        assert abs(robot.run(turn(deg(90))).heading) < deg(0.3)


def test_a_pose_that_was_set_anew_is_where_the_next_motion_starts() -> None:
    """The plan is of the old frame: within its reach it was kept, and 40 mm were driven twice."""
    port = simulated_port()
    with open_robot(CONFIG, port=port) as robot:
        robot.run(seq(wait(0.5), straight(0.04), wait(0.2)))
        assert robot.inputs is not None
        assert robot.inputs.truth is not None
        begin = robot.inputs.truth.x
        robot.odometry.reset()
        robot.run(seq(straight(0.1), wait(0.2)))
        assert robot.inputs.truth is not None
        assert robot.inputs.truth.x - begin == pytest.approx(0.1, abs=0.002)
        assert robot.plan.x == pytest.approx(0.1, abs=1e-4)


@pytest.mark.parametrize(("radius", "angle_deg"), [(5.0, 3.0), (2.0, -7.0)])
def test_a_wide_arc_ends_on_its_mark(radius: float, angle_deg: float) -> None:
    """A heading that is 0.3 degrees off is 27 mm of such an arc: there the place tells how far it is."""
    with open_robot(RobotConfig(), port=open_emulated(RobotConfig(), 21, world=World.empty())) as robot:
        robot.run(wait(0.5))
        result = robot.run(arc(radius, deg(angle_deg)))
    assert abs(result.along) < 0.002
    assert abs(result.across) < 0.002
    assert abs(result.heading) < deg(0.4)


def test_after_a_loop_of_its_own_a_motion_starts_from_where_that_came_to() -> None:
    """It was within the reach of the plan before it: the loop's way was taken off the next motion."""
    port = simulated_port()
    with open_robot(CONFIG, port=port) as robot:
        robot.run(seq(wait(0.5), straight(0.1)))
        for _ in range(30):
            robot.drive.velocity(0.1)
            robot.tick()
        for _ in range(20):
            robot.tick()
        assert robot.inputs is not None
        assert robot.inputs.truth is not None
        begin = robot.inputs.truth.x
        assert 0.11 < begin < 0.145
        robot.run(seq(straight(0.1), wait(0.2)))
        assert robot.inputs.truth is not None
        assert robot.inputs.truth.x - begin == pytest.approx(0.1, abs=0.002)


@pytest.mark.parametrize(("seconds", "told"), [(0.01, True), (0.05, True), (0.2, False)])
def test_drives_that_are_too_short_to_come_to_their_speed_are_told(seconds: float, told: bool) -> None:
    with open_robot(CONFIG, port=simulated_port()) as robot:
        robot.run(wait(0.5))
        for _ in range(20):
            robot.run(drive(0.1).until(after_time(seconds)))
        assert any("started again and again" in each for each in robot.drive.remarks.values()) is told


def test_a_result_and_a_pose_are_printed_for_people() -> None:
    """All digits of a float, in m and rad, are nothing to read at a table."""
    result = MotionResult(0.00123, -0.0001, deg(-0.5), 2.375, 0.0113, False)
    assert str(result) == "+1.2 mm along, -0.1 mm across (+- 11.3), -0.50 deg, in 2.38 s"
    held = replace(result, held=0.12, remarks=("the left wheel slips",))
    assert str(held).endswith("in 2.38 s; may stand 0.120 m before its goal; the left wheel slips")
    assert str(replace(result, planned=0.173)).endswith("in 2.38 s; planned at 17 % of the wished speed")
    assert str(Pose(0.4, -1e-9, deg(90))) == "x 0.400 m, y 0.000 m, heading 90.0 deg"


@pytest.mark.parametrize("action", [drive(0.1), motors(0.3, 0.3), spin("arm", 1.0), wait_for(pressed(0))])
def test_a_motion_that_nothing_ends_is_said_once(
    action: Action[None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(remarks, "ENDLESS_AFTER_S", 0.3)
    arm = {"arm": MechanismConfig(motor=2)}
    config = replace(CONFIG, controller=ControllerConfig(port="sim"), mechanisms=arm)
    with open_robot(config, port=simulated_port(config=config)) as robot:
        robot.run(action.until(after_time(0.2)))
        assert not robot.drive.remarks
        robot.run(action.until(after_time(0.4)))
        said = [
            each
            for each in robot.drive.remarks.values()
            if "has run for 0.3 s and nothing has ended it" in each
        ]
        assert len(said) == 1
        assert said[0].startswith(action.name)
