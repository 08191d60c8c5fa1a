"""Servos and mechanisms: they get there, hold, say why not, and are off at the end."""

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from raccoon import (
    Action,
    ConfigError,
    MotionTimeout,
    RobotConfig,
    after_time,
    background,
    blocked,
    deg,
    do,
    load_robot,
    move,
    move_by,
    open_robot,
    parallel,
    race,
    release,
    seq,
    servo,
    servo_off,
    spin,
    straight,
    wait,
    zero,
)
from raccoon.core.config import MechanismConfig, MotorConfig, ServoConfig
from raccoon.core.readings import STOP, Outputs
from raccoon.hal.wombat.emulator import Firmware
from raccoon.robot.emulated import open_emulated
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.plant.free_motor import FreeMotor
from raccoon.sim.port import SimPort

CLAW = ServoConfig(
    port=1, lowest_us=900.0, highest_us=2100.0, positions_us={"open": 1200.0, "closed": 1900.0}
)
CONFIG = RobotConfig(servos={"claw": CLAW}, mechanisms={"arm": MechanismConfig(motor=3)})


class Spy(SimPort):
    """The simulated robot, and every command it was given."""

    def __init__(self, config: RobotConfig = CONFIG) -> None:
        super().__init__(Parameters.from_robot(config), robot=config)
        self.written: list[Outputs] = []

    def write(self, outputs: Outputs) -> None:
        self.written.append(outputs)
        super().write(outputs)

    @property
    def arm(self) -> FreeMotor:
        return self.free_motors[3]


@pytest.mark.parametrize(
    "make",
    [lambda name: move(name, 90.0), lambda name: move_by(name, -90.0), lambda name: zero(name, 90.0)],
    ids=["move", "move_by", "zero"],
)
def test_an_angle_in_degrees_is_refused_before_an_arm_moves(make: Callable[[str], Action[object]]) -> None:
    winch = replace(CONFIG, mechanisms={"arm": MechanismConfig(2), "winch": MechanismConfig(3, turns=15.0)})
    port = Spy(winch)
    with open_robot(winch, port=port) as robot:
        with pytest.raises(
            ValueError,
            match=r" is -?90: .*up to 1 turn in rad .*deg\(-?90\).*; mechanism\.arm\.turns of robot",
        ):
            robot.run(make("arm"))
        assert all(each.duty == STOP.duty for each in port.written)
        robot.run(make("winch").until(after_time(0.05)))


def test_a_servo_gets_the_time_it_needs_and_holds() -> None:
    port = Spy()
    with open_robot(CONFIG, port=port) as robot:
        robot.run(servo("claw", "open"))
        assert robot.time == pytest.approx((2100.0 - 1200.0) / 3000.0, abs=0.01)  # from the far end
        robot.run(straight(0.05))
        assert all(each.servo_us == (None, 1200, None, None) for each in port.written)
        for us in (100.0, 0.0):
            begin = robot.time
            robot.run(servo("claw", 1300))
            assert robot.time - begin == pytest.approx(us / 3000.0, abs=0.01)


@pytest.mark.parametrize(
    ("to", "seconds"), [("closed", 700 / 3000 - 0.05), ("open", 0.05)], ids=["goes on", "goes back"]
)
def test_a_servo_whose_way_was_cut_short_gets_the_time_from_where_it_is(to: str, seconds: float) -> None:
    with open_robot(CONFIG, port=Spy()) as robot:
        robot.run(servo("claw", "open"))
        robot.run(servo("claw", "closed").until(after_time(0.05)))
        begin = robot.time
        robot.run(servo("claw", to))
        assert robot.time - begin == pytest.approx(seconds, abs=0.02)
        assert robot.servo("claw").pulse_at(robot.time) == robot.servo("claw").place(to)


def test_a_slow_servo_goes_evenly() -> None:
    port = Spy()
    with open_robot(CONFIG, port=port) as robot:
        robot.run(servo("claw", "open"))
        port.written.clear()
        robot.run(servo("claw", "closed", seconds=1.4))
    pulses = [each.servo_us[1] for each in port.written]
    assert pulses == sorted(pulses, key=lambda pulse: pulse or 0)
    assert pulses[140] == pytest.approx(1200 + 350, abs=5)
    assert pulses[-1] == 1900


@pytest.mark.parametrize(
    ("both", "second", "first"),
    [
        (lambda: parallel(move("arm", 1.0), move("arm", -1.0)), "move arm to -57", "move arm to 57"),
        (lambda: parallel(servo("claw", "open"), servo("claw", "closed")), "claw to closed", "claw to open"),
        (
            lambda: seq(background(servo("claw", "open", 2.0)), wait(0.1), servo_off("claw")),
            "claw off",
            "open",
        ),
        (lambda: seq(background(spin("arm", 2.0)), wait(0.1), release("arm")), "release arm", "spin arm"),
        (lambda: seq(background(move_by("arm", 1.0)), wait(0.1), zero("arm")), "zero arm", "move arm by"),
    ],
)
def test_two_that_move_the_same_at_once_are_refused(
    both: Callable[[], Action[object]], second: str, first: str
) -> None:
    with open_robot(CONFIG, port=Spy()) as robot:
        robot.run(servo("claw", 1000))
        with pytest.raises(
            RuntimeError, match=rf"two actions move \w+ at.*{second}.* while .*{first}.*a seq"
        ):
            robot.run(both())
        assert robot.outputs.duty == STOP.duty


def test_what_moved_it_before_has_ended() -> None:
    with open_robot(CONFIG, port=Spy()) as robot:
        robot.run(
            seq(background(servo("claw", "open")), wait(1.0), servo("claw", "closed"), servo_off("claw"))
        )
        robot.run(seq(race(spin("arm", 2.0), wait(0.2)), release("arm"), move("arm", 0.5), move("arm", 0.0)))
        with pytest.raises(MotionTimeout):
            robot.run(spin("arm", 1.0).timeout(0.1))
        robot.run(zero("arm"))


def test_a_servo_is_off_before_its_first_use_and_when_switched_off() -> None:
    port = Spy()
    with open_robot(CONFIG, port=port) as robot:
        robot.run(wait(0.02))
        robot.run(seq(servo("claw", "open"), servo_off("claw")))
    assert port.written[0].servo_us == port.written[-1].servo_us == (None,) * 4


@pytest.mark.parametrize(
    ("name", "to", "error"),
    [
        ("grip", "open", "there is no servo 'grip' in robot.toml; there is claw"),
        ("clwa", "open", r"there is no servo 'clwa' in robot.toml \(did you mean claw\?\); there is claw"),
        (
            "claw",
            "opn",
            r"servo.claw has no position 'opn' \(did you mean open\?\); positions_us has open,",
        ),
    ],
)
def test_unknown_names_are_said_with_those_there_are(name: str, to: str, error: str) -> None:
    with open_robot(CONFIG, port=Spy()) as robot, pytest.raises(ConfigError, match=error):
        robot.run(servo(name, to))


def test_where_there_is_none_it_is_said_what_makes_one() -> None:
    said = r"no servo 'claw' in robot.toml; there is none: \[servo.NAME\] makes one"
    with open_robot(RobotConfig(), port=Spy()) as robot, pytest.raises(ConfigError, match=said):
        robot.run(servo("claw", "open"))


def test_a_pulse_the_mechanism_does_not_stand_is_refused() -> None:
    with (
        open_robot(CONFIG, port=Spy()) as robot,
        pytest.raises(ValueError, match="is 800 us: allowed are 900"),
    ):
        robot.run(servo("claw", 800))
    with pytest.raises(ValueError, match="to is nan"):
        servo("claw", math.nan)
    with pytest.raises(ValueError, match="seconds is -1"):
        servo("claw", "open", seconds=-1)
    with pytest.raises(ValueError, match=r"seconds is 500: allowed are .* up to 60 s \(500 ms are 0\.5\)"):
        servo("claw", "open", seconds=500)


@pytest.mark.parametrize("inverted", [False, True])
def test_an_arm_moves_to_its_angle_and_holds_it_while_the_robot_drives(inverted: bool) -> None:
    config = RobotConfig(mechanisms=CONFIG.mechanisms, motors={3: MotorConfig(inverted=inverted)})
    port = Spy(config)
    with open_robot(config, port=port) as robot:
        arrived, _ = robot.run(parallel(move("arm", deg(60)), straight(0.1)))
        assert arrived == pytest.approx(deg(60), abs=0.03)
        assert port.arm.angle == pytest.approx(deg(60), abs=0.05)
        robot.run(move_by("arm", deg(-90), speed=2.0))
        assert robot.mechanism("arm").angle == pytest.approx(deg(-30), abs=0.04)


def test_an_arm_turns_as_fast_as_it_is_told_to() -> None:
    port = Spy()  # 3 rad/s are usual
    with open_robot(CONFIG, port=port) as robot:
        robot.run(spin("arm", 4.0).until(after_time(0.5)))
        assert port.arm.speed == pytest.approx(4.0, abs=0.1)
        robot.run(wait(0.5))
        begin, angle = robot.time, robot.mechanism("arm").angle
        robot.run(move("arm", angle - 3.0, speed=4.0))
        assert robot.time - begin < 1.05  # at 3 rad/s 1.15 s


def test_at_rest_nothing_is_counted() -> None:
    config = RobotConfig(mechanisms=CONFIG.mechanisms)
    port = Spy(config)
    with open_robot(config, port=port) as robot:
        robot.run(wait(0.1))
        port.arm._counts = 8.0  # an offset of the back-EMF, as boards have
        robot.run(wait(5.0))
        assert robot.mechanism("arm").angle == 0.0


def test_a_blocked_arm_is_named_with_its_port_and_released() -> None:
    port = Spy()
    port.arm.stops = (-0.5, 1.0)
    with open_robot(CONFIG, port=port) as robot:
        robot.run(servo("claw", "closed"))
        with pytest.raises(MotionTimeout, match=r"arm \(motor port 3\).*of 115 deg; power but no motion"):
            robot.run(move("arm", 2.0))
        assert port.written[-1] == Outputs(servo_us=(None, 1900, None, None))  # the claw keeps what it holds
        assert robot.mechanism("arm").goal is None


def test_homing_against_the_end_stop_of_robot_toml(tmp_path: Path) -> None:
    (tmp_path / "robot.toml").write_text(
        "[mechanism.arm]\nmotor = 3\nlowest_stop = -0.5\nhighest_stop = 1.0\n"
    )
    config = load_robot(tmp_path / "robot.toml")
    port = Spy(config)
    with open_robot(config, port=port) as robot:
        robot.run(seq(spin("arm", -1.5).until(blocked("arm")), zero("arm")))
        assert robot.mechanism("arm").angle == 0.0
        robot.run(move("arm", 1.0))
        assert port.arm.angle == pytest.approx(0.5, abs=0.06)
        robot.run(release("arm"))
        robot.run(wait(0.02))
        assert port.written[-1].duty[3] == 0.0
        assert not port.written[-1].brake[3]


def test_a_homing_that_finds_no_end_stop_says_where_the_arm_is() -> None:
    """It said of the wheels alone that nothing drove them."""
    with open_robot(CONFIG, port=Spy()) as robot:
        home = spin("arm", -1.5).until(blocked("arm")).timeout(1.0)
        with pytest.raises(MotionTimeout, match=r"not driven; arm at -[78]\d deg, turning\)"):
            robot.run(home)


def test_an_arm_goes_on_at_once_from_what_blocked_it() -> None:
    home = seq(spin("arm", -1.5).until(blocked("arm")), zero("arm"))
    port = Spy()
    port.arm.stops = (-0.5, 1.0)
    with open_robot(CONFIG, port=port) as robot:
        robot.run(seq(home, move("arm", 1.0)))
        assert port.arm.angle == pytest.approx(0.5, abs=0.06)
        robot.run(move("arm", 3.0).timeout_or(5.0, move("arm", 0.0)))
        assert port.arm.angle == pytest.approx(-0.5, abs=0.06)
        with pytest.raises(MotionTimeout, match="power but no motion"):
            robot.run(move("arm", 3.0))
        robot.run(move("arm", 0.5))
        assert robot.mechanism("arm").angle == pytest.approx(0.5, abs=0.04)
        robot.run(seq(home, spin("arm", 1.5).until(blocked("arm"))))
        assert port.arm.angle == pytest.approx(1.0, abs=0.01)


def test_an_arm_that_holds_against_its_end_stop_moves_away_from_it() -> None:
    port = Spy()
    with open_robot(CONFIG, port=port) as robot:
        robot.run(move("arm", 0.5))
        port.arm.stops = (-1.0, port.arm.angle)
        near = robot.mechanism("arm").angle + 0.025  # it arrives there, and pushes on
        pushes = do(lambda robot: robot.mechanism("arm").stalled)
        assert robot.run(seq(move("arm", near), wait(3.0), pushes, move("arm", -0.5)))[2] is True
        assert robot.mechanism("arm").angle == pytest.approx(-0.5, abs=0.04)


@pytest.mark.parametrize("held", [False, True])
def test_an_exception_in_the_program_stops_the_arm_and_lets_it_go(held: bool) -> None:
    port = Spy()

    def fail(_: object) -> None:
        raise RuntimeError("bug")

    with open_robot(CONFIG, port=port) as robot:
        if held:
            robot.run(move("arm", 0.2))
            assert port.written[-1].brake[3]
        with pytest.raises(RuntimeError, match="bug"):
            robot.run(
                seq(wait(0.05), do(fail)) if held else parallel(spin("arm", 2.0), seq(wait(0.2), do(fail)))
            )
        for _ in range(2):
            assert (port.written[-1].duty, port.written[-1].brake[3]) == ((0.0,) * 4, False)
            robot.run(wait(0.05))


@pytest.mark.parametrize("firmware", ["stock", 21])
def test_an_arm_behind_every_firmware(firmware: Firmware) -> None:
    with open_robot(CONFIG, port=open_emulated(CONFIG, firmware)) as robot:
        robot.run(wait(0.5))
        robot.run(parallel(servo("claw", "open"), move("arm", deg(60)), straight(0.1)))
        assert robot.mechanism("arm").angle == pytest.approx(deg(60), abs=0.04)
        robot.run(move_by("arm", deg(-90)))
        assert robot.mechanism("arm").angle == pytest.approx(deg(-30), abs=0.04)
