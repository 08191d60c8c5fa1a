"""Matches: the light, the clock that ends everything, and the timing of steps."""

from __future__ import annotations

import contextlib
import os
import signal
import time
from collections.abc import Callable
from dataclasses import replace

import pytest

from raccoon import (
    Robot,
    calibrate_light,
    do,
    drive,
    open_robot,
    rehearse_light,
    repeat,
    seq,
    servo,
    straight,
    wait,
)
from raccoon.core.config import ServoConfig
from raccoon.core.readings import STOP, Inputs, Outputs
from raccoon.robot.actions.actions import Action, Steps
from raccoon.robot.actions.sequences import MAX_UNNAMED_STEPS, mission, timed
from raccoon.robot.deadline import MatchOver
from raccoon.robot.match import run_match, wait_for_light
from robots import CONFIG, InterceptingPort, simulated_port


class Lamp(InterceptingPort):
    """The simulated robot with a start light on analog port 3 that goes on at `on` s."""

    def __init__(self, on: float = 1.0) -> None:
        super().__init__(seen=self._lit)
        self._on = on

    @property
    def last(self) -> Outputs:
        return self.written[-1]

    def _lit(self, inputs: Inputs) -> Inputs:
        analog = list(inputs.analog)
        analog[3] = 300.0 if inputs.time >= self._on else 3000.0
        return replace(inputs, analog=tuple(analog))


def test_servos_hold_until_the_end_and_are_off_then() -> None:
    port = Lamp()
    held = []
    with open_robot(replace(CONFIG, servos={"claw": ServoConfig(port=2)}), port=port) as robot:
        program = seq(servo("claw", 1500), straight(0.05), do(lambda _: held.append(port.last.servo_us[2])))
        run_match(robot, program)
        assert held == [1500]
        assert port.last == STOP


def test_a_match_that_waits_for_nothing_begins_now_and_not_when_the_controller_did() -> None:
    port = InterceptingPort(seen=lambda inputs: replace(inputs, time=inputs.time + 5000.0))
    with open_robot(CONFIG, port=port) as robot:
        report = run_match(robot, wait(0.1), seconds=2.0)
    assert report.finished
    assert report.seconds == pytest.approx(0.1, abs=0.021)


def test_what_is_strange_about_the_motors_is_in_the_report() -> None:
    changed = simulated_port(effects={"motor.back_emf_constant@right": {"factor": 1.05}})
    with open_robot(CONFIG, port=changed) as robot:
        report = run_match(robot, straight(0.3), start=wait(0.5))
    assert len(report.remarks) == 1
    assert "remark: compared with the gyro, the right wheel (motor port 1) turns 0.95" in report.table()


def test_the_program_starts_with_the_light_and_its_steps_are_timed() -> None:
    port = Lamp(on=1.5)
    with open_robot(CONFIG, port=port) as robot:
        program = mission(straight(0.05), timed(wait(0.5), "look around"))
        report = run_match(robot, program, start=wait_for_light(3))
    assert report.finished
    assert [step.name for step in report.steps] == ["straight 0.05 m", "look around"]
    assert report.steps[1].seconds == pytest.approx(0.5, abs=0.01)
    assert report.steps[0].begin < 0.02
    assert "start light" in port.notes
    assert any(note.startswith("step ends: straight 0.05 m: done after") for note in port.notes)
    assert "look around" in report.table()


def test_what_a_program_of_plain_calls_runs_are_its_steps() -> None:
    """A loop of them does not bury what is named."""

    def program(robot: Robot) -> None:
        robot.run(wait(0.01))
        robot.run(seq(wait(0.02), seq(wait(0.03), timed(wait(0.01), "look"))))
        for _ in range(MAX_UNNAMED_STEPS):
            robot.run(repeat(wait(0.0), 1))
        robot.run(timed(wait(0.01), "last"))

    port = Lamp(on=1.5)
    with open_robot(CONFIG, port=port) as robot:
        names = [step.name for step in run_match(robot, program).steps]
    assert names[:5] == ["wait 0.01 s", "wait 0.02 s", "wait 0.03 s", "look", "repeat wait 0 s"]
    assert len(names) == MAX_UNNAMED_STEPS + 1
    assert [note.split(":")[1] for note in port.notes if note.startswith("step begins")][-1] == " last"


def catches_everything(robot: Robot) -> None:
    while True:
        try:
            robot.run(drive(0.1))
        except Exception:
            continue


def ignores_the_end(robot: Robot) -> None:
    for _ in range(5):
        try:
            robot.run(drive(0.1))
        except BaseException:
            continue


def swallows(robot: Robot) -> Steps[None]:
    try:
        while True:
            robot.drive.velocity(0.1)
            yield
    finally:
        robot.drive.velocity(0.1)


@pytest.mark.parametrize(
    "program",
    [repeat(straight(0.05)), catches_everything, ignores_the_end, Action("stubborn", swallows)],
    ids=["for ever", "catches everything", "ignores the end", "drives on in finally"],
)
def test_the_clock_ends_it_whatever_the_program_does(program: Action[None] | Callable[[Robot], None]) -> None:
    port = Lamp()
    with open_robot(CONFIG, port=port) as robot:
        report = run_match(robot, program, seconds=1.0)
        assert report.seconds == pytest.approx(1.0, abs=0.05)
        assert not report.finished
        assert report.stopped.startswith("run(")
        assert (
            report.table()
            .splitlines()[-1 - len(report.remarks)]
            .endswith(f"by the clock in {report.stopped}")
        )
        assert any("went on after the end" in each for each in report.remarks) == (program is ignores_the_end)
        assert port.last == STOP
        with pytest.raises(RuntimeError, match="the match of this robot is over: open the robot again"):
            robot.run(straight(0.1))
        assert port.last == STOP


@pytest.mark.parametrize(
    "program",
    [lambda _: straight(0.05), do(lambda _: straight(0.05)), seq(wait(0.0), do(lambda _: straight(0.05)))],
    ids=["a function", "do", "do in a seq"],
)
def test_an_action_that_a_function_gives_back_is_done(
    program: Action[object] | Callable[[Robot], object],
) -> None:
    with open_robot(CONFIG, port=Lamp()) as robot:
        report = run_match(robot, program)
        assert robot.pose.x == pytest.approx(0.05, abs=0.002)
    assert report.seconds > 0.5
    assert report.remarks == ()


def test_a_program_that_runs_nothing_is_remarked() -> None:
    with open_robot(CONFIG, port=Lamp()) as robot:
        report = run_match(robot, lambda _: print(straight(0.05)))
    assert "remark: the program ran nothing on the robot: run an action with robot.run" in report.table()


def test_an_error_of_the_program_comes_through_with_the_motors_off() -> None:
    def broken(_robot: Robot) -> None:
        raise KeyError("pom")

    port = Lamp()
    with open_robot(CONFIG, port=port) as robot, pytest.raises(KeyError, match="pom"):
        run_match(robot, broken)
    assert port.last == STOP


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no interval timer here")
def test_the_alarm_of_the_wall_clock_ends_code_that_never_comes_back() -> None:
    def hangs(_robot: Robot) -> None:
        end = time.monotonic() + 20.0
        while time.monotonic() < end:
            pass

    port = Lamp()
    with open_robot(CONFIG, port=port) as robot:
        # The first ticks of a process load the simulator, and may take longer than this match.
        report = run_match(robot, timed(do(hangs), "think"), start=wait(0.02), seconds=0.1, alarm=True)
        assert robot.time < 0.05  # nothing was read since
    assert not report.finished
    assert port.last == STOP
    # So the match was as long as it should be, and not as long as the readings go.
    assert report.seconds == pytest.approx(0.1)
    assert report.steps[0].end == pytest.approx(0.1)
    assert report.steps[0].ended.startswith("MatchOver")
    assert "   0.10 s  stopped by the clock" in report.table()


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no interval timer here")
def test_an_alarm_that_the_program_catches_is_one_and_comes_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("raccoon.robot.deadline.RING_AGAIN_S", 0.05)
    caught = 0

    def hangs(_robot: Robot) -> str:
        nonlocal caught
        while caught < 2:
            try:
                signal.pause()
            except:  # noqa: E722
                caught += 1
        return "all done"

    handler = signal.getsignal(signal.SIGALRM)
    with open_robot(CONFIG, port=Lamp()) as robot:
        report = run_match(robot, hangs, seconds=0.1, alarm=True)
    assert caught == 2
    # And none after the match.
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)
    assert signal.getsignal(signal.SIGALRM) is handler
    assert not report.finished
    assert report.seconds == pytest.approx(0.1)
    assert "stopped by the clock" in report.table()
    assert (
        "remark: the program went on after the end of the match: its except BaseException" in report.table()
    )


def test_servos_are_off_at_the_end_also_where_the_program_catches_it() -> None:
    port = Lamp()

    def goes_on(robot: Robot) -> None:
        robot.run(servo("claw", 1500))
        with contextlib.suppress(BaseException):
            robot.run(wait(10.0))
        assert port.last == STOP

    with open_robot(replace(CONFIG, servos={"claw": ServoConfig(port=2)}), port=port) as robot:
        assert not run_match(robot, goes_on, seconds=1.5).finished


def drives_on(robot: Robot) -> None:
    robot.run(repeat(straight(0.1)))


def computes(_robot: Robot) -> None:
    signal.raise_signal(signal.SIGALRM)  # the timer's own would come when a busy machine lets it


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="no interval timer here")
@pytest.mark.parametrize("step", [drives_on, computes])
def test_a_program_that_never_ends_is_ended_with_its_process(
    step: Callable[[Robot], None], monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    left: list[int] = []
    monkeypatch.setattr(os, "_exit", left.append)
    for name, value in (("MAX_CAUGHT_ALARMS", 3), ("MAX_CAUGHT_READINGS", 3)):
        monkeypatch.setattr(f"raccoon.robot.deadline.{name}", value)
    monkeypatch.setattr(Lamp, "close", lambda port: port.event("closed"))
    port, caught = Lamp(), 0

    def never_ends(robot: Robot) -> None:
        nonlocal caught
        while not left:
            try:
                step(robot)
            except:  # noqa: E722
                caught += 1

    with open_robot(CONFIG, port=port) as robot:
        run_match(robot, never_ends, seconds=100.0 if step is computes else 0.1, alarm=step is computes)
        assert (left, caught) == ([1], 4)
        assert port.notes.count("closed") == 1
    assert "raccoon: the program did not stop when the time was over" in capfd.readouterr().err


def test_a_robot_has_one_match() -> None:
    with open_robot(CONFIG, port=Lamp()) as robot:
        assert run_match(robot, straight(0.05), start=wait(0.5)).finished
        for again in (lambda: run_match(robot, wait(1.0)), lambda: robot.run(wait(1.0)), robot.tick):
            begin = robot.ticks
            with pytest.raises(RuntimeError, match="the match of this robot is over: open the robot again"):
                again()
            assert robot.ticks == begin


def test_a_program_that_fails_may_be_rescued_until_the_time_is_over() -> None:
    def broken(_robot: Robot) -> None:
        raise KeyError("pom")

    with open_robot(CONFIG, port=Lamp()) as robot:
        with pytest.raises(KeyError):
            run_match(robot, broken, seconds=1.0)
        robot.run(straight(0.05))
        with pytest.raises(RuntimeError, match="has already begun a match: open the robot again"):
            run_match(robot, wait(1.0))
        with pytest.raises(MatchOver):
            robot.run(wait(5.0))


@pytest.mark.parametrize("port", [6, -1, "5", 5.0])
def test_a_light_on_a_port_that_is_not_there_is_refused(port: int) -> None:
    with open_robot(CONFIG, port=Lamp()) as robot:
        for make in (
            lambda: wait_for_light(port),
            lambda: rehearse_light(port),
            lambda: calibrate_light(robot, port, lambda: None),
        ):
            with pytest.raises(ValueError, match=f"analog port is {port!r}: allowed are 0 to 5"):
                make()


def test_a_list_and_a_start_that_is_no_action_are_refused() -> None:
    with open_robot(CONFIG, port=Lamp()) as robot:
        with pytest.raises(TypeError, match=r"takes one action, not a list of them: write seq\(\*actions\)"):
            run_match(robot, [straight(0.1)])  # type: ignore[arg-type]
        with pytest.raises(TypeError, match=r"start takes an Action, not 5, such as wait_for_light\(port\)"):
            run_match(robot, straight(0.1), start=5)  # type: ignore[arg-type]
        assert robot.ticks == 0


@pytest.mark.parametrize("seconds", [0.0, float("nan"), 120_000.0])
def test_a_match_without_time_or_of_days_is_refused(seconds: float) -> None:
    """In milliseconds its end, which is to stop everything, would not come."""
    said = f"seconds is {seconds}: allowed are numbers above 0 up to 3600"
    with open_robot(CONFIG, port=Lamp()) as robot, pytest.raises(ValueError, match=said):
        run_match(robot, wait(1.0), seconds=seconds)
