"""How actions are put together, on a robot that only counts ticks."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

import pytest

from raccoon.core.errors import MotionTimeout
from raccoon.robot.actions.actions import (
    Action,
    Steps,
    background,
    parallel,
    race,
    repeat,
    wait,
    wait_for,
)
from raccoon.robot.actions.condition import Condition
from raccoon.robot.actions.conditions import after_time, when
from raccoon.robot.actions.functions import do
from raccoon.robot.actions.sequences import seq
from raccoon.robot.robot import Robot


class Bench:
    """Enough of a robot to run actions on: a clock whose ticks (1/128 s) add up exactly, and a log."""

    def __init__(self) -> None:
        self.ticks = 0
        self.log: list[str] = []
        self.notes: list[str] = []
        self.background: list[Steps[Any]] = []
        self.drive = SimpleNamespace(describe_state=lambda: "the wheels follow")
        self.attachments = SimpleNamespace(moving=())
        self.blind = ()
        self.config = SimpleNamespace(controller=SimpleNamespace(port="wombat"))

    @property
    def time(self) -> float:
        return self.ticks / 128.0

    def note(self, text: str) -> None:
        self.notes.append(text)

    def add_background(self, action: Action[Any]) -> None:
        self.background.append(action.start(cast(Robot, self)))

    def run(self, action: Action[Any]) -> Any:
        body = action.start(cast(Robot, self))
        try:
            while True:
                self.ticks += 1
                try:
                    next(body)
                except StopIteration as end:
                    return end.value
                for each in self.background:
                    next(each, None)
        finally:
            body.close()


def work(name: str, ticks: int, result: object = None) -> Action[Any]:
    """An action that logs its beginning and its end, whatever ends it."""

    def steps(robot: Any) -> Steps[Any]:
        robot.log.append(f"{name} begins")
        try:
            for _ in range(ticks):
                yield
            robot.log.append(f"{name} done")
            return result
        finally:
            robot.log.append(f"{name} ends")

    return Action(name, steps)


def tick_is(number: int) -> Condition:
    return when(lambda robot: robot.ticks >= number, f"tick {number}")


def test_seq_gives_all_results_in_order() -> None:
    bench = Bench()
    assert bench.run(seq(work("a", 2, "A"), work("b", 0, "B"), work("c", 1, "C"))) == ["A", "B", "C"]
    assert bench.ticks == 4  # 2 + 0 + 1 ticks of waiting, and the tick that sees the end
    assert [line for line in bench.log if "begins" in line] == ["a begins", "b begins", "c begins"]


def test_parallel_waits_for_the_last() -> None:
    bench = Bench()
    assert bench.run(parallel(work("a", 5, 1), work("b", 2, 2))) == [1, 2]
    assert bench.ticks == 6


def test_race_stops_the_losers() -> None:
    bench = Bench()
    assert bench.run(race(work("slow", 50), work("quick", 3, "won"))) == (1, "won")
    assert "slow ends" in bench.log
    assert "slow done" not in bench.log


def test_an_error_in_one_stops_the_others() -> None:
    def fails(robot: Robot) -> Steps[None]:
        yield
        raise RuntimeError("broken")

    bench = Bench()
    with pytest.raises(RuntimeError, match="broken"):
        bench.run(parallel(work("other", 50), Action("fails", fails)))
    assert bench.log == ["other begins", "other ends"]


def test_until_ends_at_once_and_cleans_up() -> None:
    bench = Bench()
    assert bench.run(work("a", 1000, "never").until(tick_is(7))) is None
    assert bench.ticks == 7
    assert bench.log == ["a begins", "a ends"]


def test_until_gives_the_result_where_the_action_ends_first() -> None:
    assert Bench().run(work("a", 3, "done").until(after_time(5.0))) == "done"


def test_timeout_names_the_action_and_the_reason() -> None:
    bench = Bench()
    with pytest.raises(MotionTimeout, match=r"a: not done after 0.1 s \(the wheels follow\)"):
        bench.run(work("a", 1000).timeout(0.1))
    assert "a ends" in bench.log
    assert bench.time == pytest.approx(0.1, abs=0.02)


def test_timeout_or_goes_on_with_the_other() -> None:
    bench = Bench()
    assert bench.run(work("a", 1000).timeout_or(0.05, work("b", 1, "rescued"))) == "rescued"
    assert bench.notes == ["a: not done after 0.05 s (the wheels follow): b instead"]


def test_results_are_passed_on() -> None:
    assert Bench().run(work("a", 1, 20).then(lambda value: work("b", value, value + 1))) == 21


def test_repeat_counts_and_starts_afresh() -> None:
    bench = Bench()
    bench.run(repeat(work("a", 2), 3))
    assert bench.log.count("a done") == 3


def test_repeating_nothing_for_ever_does_not_hang_the_loop() -> None:
    bench = Bench()
    bench.run(repeat(do(lambda _: None)).until(tick_is(5)))
    assert bench.ticks == 5


def test_background_goes_on_beside_what_follows() -> None:
    bench = Bench()
    bench.run(seq(background(work("b", 3)), wait(0.1)))
    assert "b done" in bench.log


def test_do_takes_no_time() -> None:
    bench = Bench()
    assert bench.run(do(lambda _: 5)) == 5
    assert bench.ticks == 1


def test_wait_and_wait_for() -> None:
    bench = Bench()
    bench.run(wait(20 / 128))
    assert bench.ticks == 21
    bench.run(wait_for(tick_is(30)))
    assert bench.ticks == 30


def test_an_action_can_be_run_twice() -> None:
    bench, action = Bench(), wait(5 / 128)
    bench.run(action)
    bench.run(action)
    assert bench.ticks == 12


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: wait(-1.0), "seconds is -1: "),
        (lambda: wait(float("nan")), "seconds is nan"),
        (lambda: wait(1.0).timeout(0.0), "seconds is 0.0"),
        (lambda: repeat(wait(1.0), -1), "times is -1"),
        (race, "race has no actions"),
    ],
)
def test_nonsense_is_refused_when_it_is_written(make: Callable[[], object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()


def held(condition: Condition, *ticks: int) -> list[bool]:
    """The condition's value at each of these ticks of one run."""
    bench = Bench()
    test = condition.start(cast(Robot, bench))
    values = []
    for bench.ticks in ticks:
        values.append(test())
    return values


def test_conditions_compose_like_logic() -> None:
    early, late = tick_is(3), tick_is(6)
    assert held(early & late, 2, 4, 7) == [False, False, True]
    assert held(early | late, 2, 4, 7) == [False, True, True]
    assert held(~early, 2, 4) == [True, False]
    assert held(~(early & ~late), 2, 4, 7) == [True, False, True]
    assert (early & ~late).name == "(tick 3 and not tick 6)"


def test_time_is_measured_from_the_start_of_each_run() -> None:
    condition = after_time(5 / 128)
    bench = Bench()
    bench.run(wait(1.0).until(condition))
    first = bench.ticks
    bench.run(wait(1.0).until(condition))
    assert (first, bench.ticks) == (6, 12)


def test_a_condition_used_as_a_bool_is_a_mistake_that_is_said() -> None:
    with pytest.raises(TypeError, match=r"combine conditions with & \| ~"):
        bool(tick_is(3) and tick_is(4))
