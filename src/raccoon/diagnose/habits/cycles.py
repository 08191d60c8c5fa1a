"""How often the controller takes in a sample of the wheels: once a row, once a cycle, or all the time."""

from __future__ import annotations

from raccoon.diagnose.habits.controller import FINE_CYCLE, with_cycle
from raccoon.diagnose.habits.others import Under, Way, first_ahead
from raccoon.diagnose.rollout.variants import Habits
from raccoon.diagnose.select.outlook import Search
from raccoon.diagnose.select.search import whole
from raccoon.sim.effects.chain import Chain


def as_rows_are_made(
    search: Search, habits: Habits, under: Under, by_row: float, by: Way = whole
) -> tuple[Search, Habits]:
    """The search with motors that are sampled once a row, or once a cycle, where that explains more.

    A filter that runs once a row of 20 ms is 8 ms sooner than one of the same time constant that runs every
    5 ms: of a sound robot that made a filter two thirds as slow. by_row: see `cycle_by_row`.
    """
    cycle = Chain().cycle if habits.chain.cycle == by_row else by_row
    others = [each for each in (with_cycle(habits, cycle),) if each != habits]
    return first_ahead(search, habits, others, under, by)


def as_the_filter_runs(
    search: Search, habits: Habits, under: Under, by: Way = whole
) -> tuple[Search, Habits]:
    """The search with a filter of the wheels' readings that runs all the time, where that explains more.

    It was a latency of 2 ms of each of ten sound robots. Asked after other filters, which a lag of some
    milliseconds may be as well. It has no number to pay for.
    """
    if habits.chain.median or habits.chain.free_running:
        return search, habits
    return first_ahead(search, habits, [with_cycle(habits, FINE_CYCLE)], under, by, 0.0)
