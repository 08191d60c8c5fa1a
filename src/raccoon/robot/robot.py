"""The robot: joins a port, the estimators and the drive, and owns the loop.

One tick is `port.read() -> estimate -> decide -> port.write()`; a recording port around the real one records.
Nothing here reads a clock, a file or a random number: time comes with the readings.
"""

from __future__ import annotations

from contextlib import ExitStack
from threading import RLock, get_ident
from types import TracebackType
from typing import TYPE_CHECKING, Any, Never, NoReturn, Self, TypeVar

from raccoon.core.config import RobotConfig
from raccoon.core.errors import HardwareError, Stopped
from raccoon.core.port import Port
from raccoon.core.readings import Inputs
from raccoon.robot.actions.actions import Action
from raccoon.robot.actions.limits import COMPOSE_HINT, SEVERAL_ACTIONS_HINT, check_kind
from raccoon.robot.actions.sequences import start_in_steps
from raccoon.robot.actions.steps import Steps, advance, close
from raccoon.robot.deadline import MatchOver, end_match
from raccoon.robot.parts.tophat_array import TophatArray
from raccoon.robot.remarks import add_remark, remark_cycle, remark_settings, remark_undriven
from raccoon.robot.robot_state import RobotState, replayed_numbers

if TYPE_CHECKING:
    from raccoon.robot.actions.sequences import StepTime

T = TypeVar("T")

PAUSE_S = 0.1  # s from a reading to the next, longer than anything that delays a tick; two cycles at least
LATE_CYCLES, MAX_LATE_CYCLES = 5.0, 20
"""Length of a cycle, in nominal ones, at which the wheels' speed loop rings; how many are reported."""


class Robot(RobotState):
    """A robot behind `port`, described by `config`. Use it as a context: leaving it stops the motors.

    Everything that moves goes through `run`; whatever ends that (the action's own end, an error, Ctrl-C), the
    motors are stopped first. A mechanism that is held brakes until the next tick; after an error it is
    released. One program uses one thread: another thread may only call `stop`.
    """

    def __init__(self, port: Port, config: RobotConfig | None = None) -> None:
        super().__init__(port, config)
        self._tophat_array = TophatArray(self.tophats)
        self.ticks = 0
        """Cycles so far."""
        self.dt = 0.0
        """s between the last two readings. After a pause it is one cycle: nothing was controlled meanwhile,
        so nothing may make up for it at once."""
        self.paused = False
        """Whether this tick is the first after a pause, in which the program kept the robot from reading."""
        self.deadline: float | None = None
        """s, time of a reading after which nothing runs any more: the end of the match."""
        self.ends = 0
        """How often MatchOver was raised in the program."""
        self.ended_in = ""
        """What was running at the end of the match, "" for nothing."""
        self.stuck: dict[str, float] = {}
        """s for which a motor has had power without turning, by its name."""
        self.steps: list[StepTime] = []
        """Every step so far."""
        self._background: list[Steps[Any]] = []
        self._closed = ""  # or what is said to who runs something all the same
        self._match_over = False
        self._cycle = 1.0 / self.config.controller.rate_hz
        self._pause = max(PAUSE_S, 2.0 * self._cycle)
        self._late = 0  # cycles in a row that were too long
        self._undriven = 0  # times in a row that a loop asked for a speed, and nothing drove it
        self._running: str | None = None
        self._thread = 0  # in which it runs, or ran last
        self._turn = RLock()  # held while something begins, ends or is stopped, never during a cycle
        self._stopping = False  # as `stop` has asked
        self._names = {*self.__dict__, "_names"} if type(self) is Robot else set()  # of a subclass any

    def __repr__(self) -> str:
        return f"<Robot {self.config.name}: {self.pose}, {self.estimate.status}>"

    # -- the loop -----------------------------------------------------------------------------------------

    def run(self, action: Action[T], *more: Never) -> T:
        """Run an action to its end and return its result. The motors are stopped however it ends; its errors
        are passed on. What runs in the background pauses until the next `run` or `tick`.

        Raises before anything moves: the errors of `action.check` (ConfigError, ValueError), HardwareError if
        the robot is closed, RuntimeError after its match or inside another `run`. Stopped: see `stop`.
        """
        given = (action, *more) if more else action
        check_kind(given, Action, "run()", SEVERAL_ACTIONS_HINT if isinstance(given, list | tuple) else "")
        body: Steps[T] = start_in_steps(self, action)
        self._begin(f"run({action.name})", COMPOSE_HINT)
        try:
            if self.drive.asked:  # by a loop that ended before its tick
                self.drive.stop()
                self.replan()
                self._undriven += 1
                remark_undriven(self, self._undriven)
            while True:
                self._sense()
                try:
                    advance(body)
                except StopIteration as end:
                    self._act(resting=True)
                    result: T = end.value
                    return result
                self._act()
        except BaseException as error:
            self._stop_after_error(error)
            raise
        finally:
            self._end()
            close(body)

    def tick(self) -> Inputs:
        """Run one cycle with whatever runs in the background and nothing else; returns its readings.

        What it drives goes on until the next cycle; the next motion starts from where that ends. The motors
        are stopped if it fails, as in `run`. Raises RuntimeError inside a `run` and inside another `tick`;
        Stopped as `run` does.
        """
        self._begin("tick()", "run() reads the sensors itself; let time pass with wait()")
        self._undriven = 0
        if self.drive.asked:
            self.replan()
            self.drive.speeds.was_limited |= self.drive.cut
        try:
            self._sense()
            self._act()
        except BaseException as error:
            self._stop_after_error(error)
            raise
        finally:
            self._end()
        assert self.inputs is not None
        return self.inputs

    def _begin(self, asked: str, instead: str) -> None:
        """Mark `asked` as running, unless something runs already (instead: what to write then)."""
        with self._turn:
            self.require(asked, instead)
            remark_settings(self, self._names)
            self._thread = get_ident()
            if self._stopping:
                self._obey_stop(asked)
            self._running = asked

    def _end(self) -> None:
        with self._turn:
            self._running = None

    def _obey_stop(self, running: str | None) -> NoReturn:
        """Carry out a pending `stop`."""
        self._stopping = False
        raise Stopped(f"robot.stop() ended {running}")

    def _refuse_to_run(self, asked: str, instead: str) -> NoReturn:
        """Raise an error that something runs already, in this thread or in one that must not."""
        if get_ident() != self._thread:
            raise RuntimeError(
                f"{asked} while another thread is in {self._running}: use a robot from one thread only; to "
                "do things at the same time use parallel() or background()"
            )
        raise RuntimeError(f"{asked} inside {self._running}: {instead}")

    def add_background(self, action: Action[Any]) -> None:
        """Run `action` beside everything that follows, during each `run` and at each `tick`."""
        self._background.append(action.start(self))

    def _sense(self) -> None:
        inputs, elapsed = self._read()
        self.paused = not 0.0 <= elapsed <= self._pause  # how long it was is not known where time ran back
        self.dt, elapsed = self._cycle if self.paused else elapsed, max(elapsed, 0.0)
        self.inputs = inputs
        self._keep_words(inputs)
        self.ticks += 1
        slow = elapsed > (LATE_CYCLES - 0.5) * self._cycle and (any(self._outputs.duty) or not self.paused)
        self._late = self._late + 1 if slow else 0
        if self._late == MAX_LATE_CYCLES:
            add_remark(
                self,
                f"a cycle takes {1e3 * elapsed:.0f} ms instead of {1e3 * self._cycle:.0f} (rate_hz): the "
                "wheels cannot be controlled well; a condition, background action or other code is slow",
            )
        if self.deadline is not None and inputs.time >= self.deadline:
            end_match(self)
        estimate = self.odometry.update(inputs, self._outputs)
        remark_cycle(self, inputs)
        self.drive.configure(inputs.device)
        self.battery.update(inputs.time, inputs.battery_voltage)
        if self.battery.voltage is not None:
            drawn = self.drive.current(estimate.left_speed, estimate.right_speed, self.battery.voltage)
            self.pack.update(inputs.time, inputs.battery_voltage, drawn)
        self.attachments.sense(inputs, elapsed)
        self._tophat_array.sense(self, inputs, elapsed)
        if self.paused:
            self.drive.resume()
            self.attachments.resume()
        if self._annotated_port is not None:
            self._annotated_port.annotate("drive", replayed_numbers(estimate))

    def _act(self, *, resting: bool = False) -> None:
        """Send the command of this tick. resting: no tick may follow for long, so nothing is left driving."""
        for body in tuple(self._background):
            try:
                advance(body)
            except StopIteration:
                self._background.remove(body)
        if self._stopping:
            self._obey_stop(self._running)
        if resting:
            self.drive.stop()
        voltage = self.battery.voltage
        if self.drive.speeds.has_remark:
            add_remark(self, self.drive.speeds.remark())
        driven = self.drive.outputs(self.estimate, self.dt, voltage, self.odometry.silent_wheels)
        self._outputs = self.attachments.add_to(driven, self.dt, voltage, resting=resting)
        self.port.write(self._outputs)

    # -- stopping -----------------------------------------------------------------------------------------

    def stop(self) -> None:
        """End what runs and switch the motors off; servos hold. Any thread, and a function of a `do`, may
        call this. It acts now, or in the next cycle of a `run` or `tick`, which raises Stopped; from another
        thread between two cycles, in the program's next `run` or `tick`."""
        with self._turn:
            if self._running is not None:
                self._stopping = True
                return
            # A thread that looks on cannot know that the program is between two cycles just now.
            self._stopping = self._thread not in (0, get_ident())
            self.switch_off()

    def switch_off(self) -> None:
        """Command every motor off now; servos hold. Inside a cycle only whoever ends it may: see `stop`."""
        if not self._closed:
            self.drive.stop()
            self._outputs = self.attachments.stop_motors()
            self.port.write(self._outputs)

    def _stop_after_error(self, error: BaseException) -> None:
        """Switch the motors off on the way out of an error, which a second error must not hide."""
        if isinstance(error, MatchOver):
            self.ended_in = self.ended_in or self._running or ""
        try:
            if not isinstance(error, Exception):  # the program ends; one that it catches does not end it
                self.end_background()
        finally:
            self._stopping = False  # by what cleaned up, or besides
            try:
                self.switch_off()
            except (OSError, ValueError, AssertionError) as lost:
                self.close()
                self._closed = str(lost) or self._closed

    def close(self) -> None:
        """Motors and servos off, port released. May be called twice."""
        if self._closed:
            return
        self._closed = "use it inside the with block of open_robot (indented), or open it again"
        try:
            self.end_background()
        finally:
            self.port.close()

    def end_match(self) -> None:
        """Switch motors, servos and background off for good: as the rules demand, nothing moves or holds
        then."""
        self._match_over = True
        try:
            self.end_background()
        finally:
            self.attachments.switch_off()
            self.switch_off()

    def end_background(self) -> None:
        """End everything that runs in the background, even if ending one action fails."""
        bodies, self._background = self._background, []
        with ExitStack() as cleanly:
            for body in bodies:
                cleanly.callback(close, body)

    def require(self, asked: str = "", instead: str = "call it between two runs, not during one") -> None:
        """Raise HardwareError if the robot is closed; RuntimeError if its match is over or `asked` is called
        inside a run."""
        if self._closed:
            raise HardwareError(f"the robot is closed: {self._closed}")
        if self._match_over:
            raise RuntimeError("the match of this robot is over: open the robot again to run something")
        if asked and self._running is not None:
            self._refuse_to_run(asked, instead)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
