"""A match: wait for the light, run the program, stop everything when the time is over."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

from raccoon.core.config import REAL_CONTROLLERS
from raccoon.core.readings import SIMULATOR
from raccoon.robot.actions.actions import Action, Steps
from raccoon.robot.actions.functions import NOTHING_RUN_HINT, check_program, perform
from raccoon.robot.actions.limits import check_kind, check_number, check_robot
from raccoon.robot.actions.sequences import StepTime
from raccoon.robot.calibration.light import check_lamp, light_counts, no_tophat, simulate_lamp, tell_light
from raccoon.robot.deadline import Alarm, MatchOver, real_deadline
from raccoon.robot.remarks import add_remark, remark_oddities

if TYPE_CHECKING:
    from raccoon.estimate.start_light import StartLightCalibration
    from raccoon.robot.robot import Robot

T = TypeVar("T")
MATCH_SECONDS = 120.0
LONGEST_MATCH_S = 3600.0
"""s; longest match. A longer time is in milliseconds."""
CAUGHT_END_REMARK = (
    "the program went on after the end of the match: its except BaseException (or bare except) also "
    "catches the end of the match; write except Exception"
)


@dataclass(frozen=True, slots=True)
class MatchReport:
    """Report of a match.

    seconds: from the light to the end. finished: whether the program ended by itself, in time. steps: every
    one of `run`, `seq`, `mission` and `timed`. result: what the program returned. remarks: what was strange,
    in words, each once. stopped: what the clock ended, such as "run(straight 1 m)"; "" if nothing was
    running.
    """

    seconds: float
    finished: bool
    steps: tuple[StepTime, ...]
    result: Any = None
    remarks: tuple[str, ...] = ()
    stopped: str = ""

    def __str__(self) -> str:
        """The table, as text."""
        return self.table()

    def table(self) -> str:
        """The steps as text, one a line."""
        lines = [f"{step.begin:7.2f} s  {step.seconds:7.2f} s  {step.label}" for step in self.steps]
        where = self.stopped and f" in {self.stopped}"
        state = "finished" if self.finished else f"stopped by the clock{where}"
        notes = [f"remark: {each}" for each in self.remarks]
        return "\n".join(["  begin    took     step", *lines, f"{self.seconds:7.2f} s  {state}", *notes])


def wait_for_light(port: int, calibration: StartLightCalibration | None = None) -> Action[None]:
    """Stand until the start light over the sensor on analog `port` goes on. The estimators keep learning
    meanwhile.

    calibration: its levels off and on (`calibrate_light`); without one the reading must fall by 35 %,
    quickly, and stay there. It waits without limit: append `.timeout(seconds)` to set one. In simulation the
    lamp goes on after 2 s. It reports light that stays on and is ignored, and light that is too bright to see
    a lamp. Raises ValueError if the port does not exist, TypeError for anything that is not a calibration.
    """
    check_lamp(port, calibration)

    def steps(robot: Robot) -> Steps[None]:
        from raccoon.estimate.start_light import StartLight

        light = StartLight(calibration)
        simulate_lamp(robot, port, calibration)
        while not (reading := light.update(robot.time, light_counts(robot, port))).fired:
            tell_light(robot, port, reading)
            yield
        robot.note("start light")

    return Action(f"wait for the light on analog {port}", steps, no_tophat(port))


def run_match(
    robot: Robot,
    program: Action[Any] | Callable[[Robot], Any],
    *,
    start: Action[Any] | None = None,
    seconds: float = MATCH_SECONDS,
    alarm: bool | None = None,
) -> MatchReport:
    """Run `start` (such as `wait_for_light`), then `program`, for at most `seconds` s; then everything is
    switched off.

    program: an action, or a function that runs what it likes on the robot; an action that it returns is run
    as well. The robot's clock ends it at its next reading, whatever it is doing or catching; an alarm of the
    wall clock also ends code that never returns to the robot (alarm: None sets it on a real controller only).
    When the program has ended, by itself or not, the match is over: the servos are off too, the background
    has ended, and the robot runs nothing more. Errors of the program are passed on with the motors off;
    handlers that continue after them end with the match. Raises RuntimeError for a second match: open the
    robot again for each.
    """
    _check_match(robot, program, start, seconds)
    if start is not None:
        robot.run(start)
    if robot.inputs is None:
        robot.tick()
    begin, known, before = robot.time, len(robot.steps), robot.ticks
    robot.deadline = begin + seconds
    robot.note(f"match begins: {seconds:g} s")
    result, ended = None, False
    try:
        real = _is_real_time(robot, alarm)
        with real_deadline(seconds, robot.port.close) if real else nullcontext(Alarm()) as bell:
            result = perform(robot, program)
        ended = True
    except MatchOver:
        robot.note(f"match over: everything off{robot.ended_in and f'; it ended {robot.ended_in}'}")
    finally:
        try:
            robot.end_background()
        finally:
            robot.switch_off()
    robot.end_match()
    finished = ended and not bell.rings and robot.time < robot.deadline
    if ended and not finished:
        add_remark(robot, CAUGHT_END_REMARK)
    # Where the alarm came, the last reading is older than the end.
    took = robot.time - begin if finished else max(robot.time - begin, seconds)
    steps = tuple(
        StepTime(each.name, each.begin - begin, each.end - begin, each.ended) for each in robot.steps[known:]
    )
    robot.note(f"match ends after {took:.2f} s")
    if finished and robot.ticks == before:
        add_remark(robot, NOTHING_RUN_HINT)
    remark_oddities(robot)
    return MatchReport(took, finished, steps, result, tuple(robot.drive.remarks.values()), robot.ended_in)


def _check_match(
    robot: Robot, program: Action[Any] | Callable[[Robot], Any], start: Action[Any] | None, seconds: float
) -> None:
    check_robot(robot, "run_match()")
    check_program(program, "run_match()")
    if start is not None:
        check_kind(start, Action, "run_match(): start", ", such as wait_for_light(port) or wait(1.0)")
    check_number("seconds", seconds, "of a match, above 0")
    if not 0.0 < seconds <= LONGEST_MATCH_S:
        raise ValueError(f"seconds is {seconds}: allowed are numbers above 0 up to {LONGEST_MATCH_S:g}")
    robot.require("run_match()")
    if robot.deadline is not None:
        raise RuntimeError("this robot has already begun a match: open the robot again for another one")
    if isinstance(program, Action):  # before the light is waited for
        program.check(robot)


def _is_real_time(robot: Robot, alarm: bool | None) -> bool:
    """Whether the robot runs in real time: not in simulation and not in a replay."""
    if alarm is not None:
        return alarm
    simulated = robot.inputs is None or robot.inputs.device.name.startswith(SIMULATOR.name)
    return (
        robot.config.controller.port in REAL_CONTROLLERS
        and not simulated
        and not hasattr(robot.port, "trace")
    )
