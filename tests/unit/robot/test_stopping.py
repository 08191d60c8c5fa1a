"""Motors stop on every way out of a program: return, error, Ctrl-C, SIGTERM, SIGHUP, sys.exit."""

import asyncio
import gc
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import pytest

from children import default_signals
from raccoon import (
    Action,
    Robot,
    Stopped,
    after_time,
    background,
    do,
    drive,
    open_robot,
    parallel,
    race,
    run_match,
    seq,
    wait,
    when,
)
from raccoon.core.config import ControllerConfig, DriveConfig, RobotConfig
from raccoon.core.errors import HardwareError
from raccoon.core.readings import SIMULATOR, STOP, Inputs, Outputs
from raccoon.robot.actions.actions import Steps
from raccoon.robot.loop import punctual
from robots import CONFIG, InterceptingPort

CHILD = """
from raccoon import RobotConfig, drive, open_robot
from raccoon.core.readings import SIMULATOR, STOP, Inputs

class Loud:
    tick = 0
    def read(self):
        self.tick += 1
        if self.tick == 100:
            print("driving", flush=True)
        return Inputs(time=self.tick * 0.005, device=SIMULATOR, bemf=(300, 300, 0, 0), position=(0, 0, 0, 0))
    def write(self, outputs):
        self.last = outputs
    def close(self):
        print("closed", flush=True)

with open_robot(RobotConfig(), port=Loud()) as robot:
    robot.run(drive(0.1))
"""


class Bench:
    """A port that remembers what was commanded and when it was closed."""

    def __init__(self, dies_at: int | None = None) -> None:
        self.commands: list[Outputs] = []
        self.closed = 0
        self._tick = 0
        self._dies_at = dies_at

    def read(self) -> Inputs:
        self._tick += 1
        if self._tick == self._dies_at:
            raise HardwareError("the cable fell out")
        words = (300, 300, 0, 0)
        return Inputs(time=0.005 * self._tick, device=SIMULATOR, bemf=words, position=(0, 0, 0, 0))

    def write(self, outputs: Outputs) -> None:
        if self._dies_at is not None and self._tick >= self._dies_at:
            raise HardwareError("the cable fell out")
        self.commands.append(outputs)

    def close(self) -> None:
        self.closed += 1


def fail_after(ticks: int) -> Action[None]:
    def steps(robot: Robot) -> Steps[None]:
        for _ in range(ticks):
            robot.drive.velocity(0.1)
            yield
        robot.drive.velocity(0.1)
        raise RuntimeError("a bug in the program")

    return Action("fail", steps)


def test_an_error_in_an_action_stops_the_motors_before_it_is_seen() -> None:
    port = Bench()
    with open_robot(RobotConfig(), port=port) as robot:
        with pytest.raises(RuntimeError, match="a bug in the program"):
            robot.run(fail_after(20))
        assert any(command.duty[0] > 0.0 for command in port.commands)
        assert port.commands[-1] == STOP
        robot.tick()  # the robot is still usable, and what was asked before the error is not done now
        assert port.commands[-1].duty == STOP.duty
    assert port.closed


def test_wheels_of_which_nothing_is_asked_brake_and_no_other_motor_does() -> None:
    port = Bench()
    with open_robot(RobotConfig(drive=DriveConfig(left=3, right=1)), port=port) as robot:
        robot.tick()
        assert port.commands[-1] == Outputs(brake=(False, True, False, True))


def test_a_closed_robot_runs_nothing() -> None:
    port = Bench()
    with pytest.raises(RuntimeError), open_robot(RobotConfig(), port=port) as robot:
        robot.run(fail_after(5))
    assert port.closed
    with pytest.raises(HardwareError, match="the robot is closed: use it inside the with block"):
        robot.run(drive(0.1))


def test_running_inside_a_run_is_a_mistake_that_is_said() -> None:
    with open_robot(RobotConfig(), port=Bench()) as robot:
        nested = do(lambda each: each.run(fail_after(3)), "nested")
        with pytest.raises(RuntimeError, match=r"run\(fail\) inside run\(nested\): compose .* return"):
            robot.run(nested)
        robot.run(do(lambda _: None))


def test_a_port_that_dies_is_closed_and_its_own_error_is_seen() -> None:
    port = Bench(dies_at=10)
    with open_robot(RobotConfig(), port=port) as robot:
        with pytest.raises(HardwareError, match="cable fell out"):
            robot.run(drive(0.1))
        assert port.closed


@pytest.mark.parametrize("in_a_match", [False, True], ids=["run", "match"])
def test_what_cleans_up_after_a_lost_port_says_why_it_was_lost(in_a_match: bool) -> None:
    def program(robot: Robot) -> None:
        try:
            robot.run(drive(0.1))
        finally:
            robot.run(drive(-0.1))

    with (
        open_robot(RobotConfig(), port=Bench(dies_at=10)) as robot,
        pytest.raises(HardwareError, match=r"^the robot is closed: the cable fell out$"),
    ):
        run_match(robot, program) if in_a_match else program(robot)


def test_an_action_that_is_forgotten_does_not_keep_the_motors_running() -> None:
    def once(robot: Robot) -> Steps[None]:
        robot.drive.velocity(0.1)
        for _ in range(5):
            yield

    port = Bench()
    with open_robot(RobotConfig(), port=port) as robot:
        robot.run(Action("once", once))
    assert port.commands[0].duty[0] > 0.0
    assert all(command.duty == STOP.duty for command in port.commands[1:])


@pytest.mark.parametrize(
    ("number", "status"),
    [(signal.SIGTERM, 128 + 15), (signal.SIGINT, 130)],
    ids=["SIGTERM", "Ctrl-C"],
)
def test_signals_unwind_and_close(number: signal.Signals, status: int) -> None:
    with default_signals(number):
        child = subprocess.Popen([sys.executable, "-c", CHILD], stdout=subprocess.PIPE, text=True)
    with child:
        try:
            assert child.stdout is not None
            assert child.stdout.readline() == "driving\n"
            child.send_signal(number)
            assert child.stdout.readline() == "closed\n"
            assert child.wait(20) in (status, -number)
        finally:
            child.kill()


def leaves() -> None:
    sys.exit(3)


def breaks() -> None:
    raise MemoryError


def hangs_up() -> None:
    signal.raise_signal(signal.SIGHUP)


@pytest.mark.parametrize("way", [leaves, breaks, hangs_up])
def test_other_ways_out_close_as_well(way: Callable[[], None]) -> None:
    class Ended(Bench):
        """The program ends in the midst of its drive."""

        def read(self) -> Inputs:
            if len(self.commands) == 100:
                way()
            return super().read()

    port = Ended()
    ended = pytest.raises((SystemExit, MemoryError))
    with default_signals(signal.SIGHUP), ended, open_robot(RobotConfig(), port=port) as robot:
        robot.run(drive(0.1))
    assert port.commands[99].duty[0] > 0.0
    assert port.commands[-1] == STOP
    assert port.closed


def test_signal_handlers_are_put_back() -> None:
    def handler(*_: object) -> None:
        """A program's own."""

    numbers = signal.SIGTERM, signal.SIGINT
    before = [signal.signal(number, handler) for number in numbers]
    try:
        with open_robot(RobotConfig(), port=Bench()):
            assert signal.getsignal(signal.SIGTERM) is not handler
            assert signal.getsignal(signal.SIGINT) is handler  # what it does at Ctrl-C is its own affair
        assert [signal.getsignal(number) for number in numbers] == [handler, handler]
    finally:
        for number, old in zip(numbers, before, strict=True):
            signal.signal(number, old)


def test_a_robot_of_another_thread_leaves_the_signals_alone() -> None:
    seen: list[object] = []

    def program() -> None:
        with open_robot(RobotConfig(), port=Bench()) as robot:
            robot.tick()
            seen.append(signal.getsignal(signal.SIGTERM))

    thread = threading.Thread(target=program)
    thread.start()
    thread.join(10.0)
    assert seen == [signal.getsignal(signal.SIGTERM)]


def test_an_ignored_signal_stays_ignored() -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as nohup leaves it
    try:
        with open_robot(RobotConfig(), port=Bench()):
            os.kill(os.getpid(), signal.SIGHUP)
            assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
        assert signal.getsignal(signal.SIGHUP) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGHUP, before)


def test_ticks_are_not_delayed_by_what_was_loaded_before(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: list[object] = []

    def refuse(*given: object) -> None:
        asked.append(given)
        raise PermissionError

    monkeypatch.setattr(os, "sched_setscheduler", refuse)
    before = gc.get_freeze_count()
    with punctual():
        assert gc.get_freeze_count() > before
        assert len(gc.get_objects()) < 1000  # what a full collection would still look at
    assert gc.get_freeze_count() == 0
    gc.freeze()  # as conftest.py has it
    assert len(asked) == 3  # priority was asked for and put back; without the right to it, it goes on


def test_what_a_program_starts_does_not_inherit_the_priority_of_its_loop(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    policies: list[int] = []

    def limited(_pid: int, policy: int, _parameter: os.sched_param) -> None:
        """As the kernel has it for a user who may take real-time priority and is not root."""
        if policies and policies[-1] & os.SCHED_RESET_ON_FORK and not policy & os.SCHED_RESET_ON_FORK:
            raise PermissionError
        policies.append(policy)

    monkeypatch.setattr(os, "sched_setscheduler", limited)
    usual = os.sched_getscheduler(0)
    with punctual():
        assert policies == [os.SCHED_FIFO | os.SCHED_RESET_ON_FORK]
    gc.freeze()  # as conftest.py has it
    assert policies[1:] == [usual | os.SCHED_RESET_ON_FORK]


def test_only_a_real_controller_gets_priority(monkeypatch: pytest.MonkeyPatch) -> None:
    entered: list[str] = []

    @contextmanager
    def noted() -> Iterator[None]:
        entered.append("punctual")
        yield

    monkeypatch.setattr("raccoon.robot.opening.punctual", noted)
    monkeypatch.setattr("raccoon.robot.opening.open_port", lambda _config, **_: Bench())
    for kind in ("sim", "wombat"):
        with open_robot(RobotConfig(controller=ControllerConfig(port=kind))):
            assert entered == ["punctual"] * (kind == "wombat")


class Watched(Bench):
    """At its 20th reading another thread stops the robot, and has done so before the reading is there."""

    robot: Robot

    def read(self) -> Inputs:
        inputs = super().read()
        if len(self.commands) == 20:
            stopped_by_another_thread(self.robot)
        return inputs


def stopped_by_another_thread(robot: Robot) -> None:
    thread = threading.Thread(target=robot.stop)
    thread.start()
    thread.join(10.0)
    assert not thread.is_alive()


def test_another_thread_stops_what_runs_before_its_next_command() -> None:
    port = Watched()
    with open_robot(RobotConfig(), port=port) as robot:
        port.robot = robot
        with pytest.raises(Stopped, match=r"robot\.stop\(\) ended run\(drive 0.1 m/s\)"):
            robot.run(drive(0.1))
        assert port.commands[19] != STOP
        assert port.commands[20:] == [STOP]
        robot.run(wait(0.1))  # it ended that run alone


@pytest.mark.parametrize(
    "made",
    [
        lambda stop: parallel(drive(0.1), seq(wait(0.1), stop)),
        lambda stop: seq(background(seq(wait(0.1), stop)), drive(0.1)),
        lambda stop: stop.then(lambda _: drive(0.1)),
    ],
    ids=["beside it", "in the background", "before it"],
)
def test_a_function_of_the_program_stops_what_runs(made: Callable[[Action[None]], Action[object]]) -> None:
    port = Bench()
    with open_robot(RobotConfig(), port=port) as robot:
        with pytest.raises(Stopped):
            robot.run(made(do(lambda each: each.stop())))
        assert port.commands[-1] == STOP
        robot.run(do(lambda _: None))


def test_a_loop_of_the_programs_own_is_stopped_between_two_ticks() -> None:
    port = Bench()
    with open_robot(RobotConfig(), port=port) as robot:
        robot.drive.velocity(0.1)
        robot.tick()
        stopped_by_another_thread(robot)
        assert port.commands[-1] == STOP
        with pytest.raises(Stopped, match=r"ended tick\(\)"):
            robot.tick()
        robot.drive.velocity(0.1)
        robot.tick()
        robot.stop()  # the program's own, which knows that it drives no further
        assert port.commands[-1] == STOP
        robot.tick()


def test_what_cleans_up_by_stopping_ends_nothing_else() -> None:
    def steps(robot: Robot) -> Steps[None]:
        try:
            yield from fail_after(5).start(robot)
        finally:
            robot.stop()

    with open_robot(RobotConfig(), port=Bench()) as robot:
        with pytest.raises(RuntimeError, match="a bug in the program"):
            robot.run(Action("cleans up", steps))
        robot.run(wait(0.1))


def holds_on(_robot: Robot) -> Steps[None]:
    while True:
        try:
            yield
        except:  # noqa: E722
            continue


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize(
    "action",
    [Action("holds on", holds_on), parallel(Action("holds on", holds_on), wait(1.0))],
    ids=["alone", "beside another"],
)
def test_steps_that_catch_their_own_end_are_ended_all_the_same(
    action: Action[object], caplog: pytest.LogCaptureFixture
) -> None:
    port = Bench()
    with open_robot(RobotConfig(), port=port) as robot:
        for ended in (
            action.until(after_time(0.05)),
            action.timeout_or(0.05, wait(0.0)),
            race(action, wait(0.05)),
        ):
            robot.run(ended)
        assert not run_match(robot, action, seconds=0.1).finished
        assert port.commands[-1] == STOP
    assert caplog.text.count("steps of an action go on after they were ended") >= 4


def test_a_match_that_is_stopped_is_over() -> None:
    port = Watched()
    with open_robot(RobotConfig(), port=port) as robot:
        port.robot = robot
        with pytest.raises(Stopped):
            run_match(robot, drive(0.1), seconds=1.0)
        assert port.commands[-1] == STOP


@pytest.mark.parametrize("inside", [True, False], ids=["opened in the coroutine", "opened around it"])
def test_ctrl_c_ends_a_run_in_a_coroutine_at_once(inside: bool) -> None:
    """asyncio's own handler waits until the coroutine does, and a run does not."""
    port = InterceptingPort()
    beats: list[float] = []

    def press(robot: Robot) -> bool:
        beats.append(robot.time)
        if len(beats) == 20:
            signal.raise_signal(signal.SIGINT)
        return False

    async def driving(robot: Robot) -> None:
        robot.run(drive(0.2).until(when(press) | after_time(3.0)))

    async def opening() -> None:
        with open_robot(CONFIG, port=port) as robot:
            await driving(robot)

    def program() -> None:
        if inside:
            asyncio.run(opening())
            return
        with open_robot(CONFIG, port=port) as robot:
            asyncio.run(driving(robot))

    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        with pytest.raises(KeyboardInterrupt):
            program()
        assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    finally:
        signal.signal(signal.SIGINT, before)
    assert len(beats) == 20
    assert not any(port.written[-1].duty)
