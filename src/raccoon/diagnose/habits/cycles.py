"""How often the controller takes in a sample of the wheels: once a row, once a cycle, or all the time; and
whether a wheel is slower then."""

from __future__ import annotations

from dataclasses import replace

from raccoon.core.doing import tell
from raccoon.diagnose.habits.chains import FINE_CYCLE, reads_back_emf, slowed_by_pauses
from raccoon.diagnose.habits.controller import with_cycle
from raccoon.diagnose.habits.lags import seen_from
from raccoon.diagnose.habits.others import AGAIN, DOUBT, Onward, Under, best_of, first_ahead
from raccoon.diagnose.rollout.plant_rollout import Habits
from raccoon.diagnose.select.rivals import net_lead
from raccoon.diagnose.select.search import grown_on, whole
from raccoon.diagnose.select.state import Search
from raccoon.sim.effects.chain import Chain


def as_rows_are_made(
    search: Search, habits: Habits, under: Under, by_row: float, by: Onward = whole
) -> tuple[Search, Habits]:
    """The search with motors that are sampled once a row, or once a cycle, where that explains more.

    A filter that runs once a row of 20 ms is 8 ms sooner than one of the same time constant that runs every
    5 ms: of a sound robot that made a filter two thirds as slow. by_row: see `cycle_by_row`.
    """
    cycle = Chain().cycle if habits.chain.cycle == by_row else by_row
    return first_ahead(search, habits, [with_cycle(habits, cycle)], under, by)


def as_the_filter_runs(
    search: Search, habits: Habits, under: Under, by: Onward = whole
) -> tuple[Search, Habits]:
    """The search with a filter of the wheels' readings that runs all the time, where that explains more.

    It was a latency of 2 ms of each of ten sound robots. Asked after other filters, which a lag of some
    milliseconds may be as well. It has no number to pay for.
    """
    if habits.chain.median or habits.chain.free_running:
        return search, habits
    return first_ahead(search, habits, [with_cycle(habits, FINE_CYCLE)], under, by, 0.0)


def as_pauses_slow_the_wheels(
    search: Search, habits: Habits, under: Under, by: Onward = whole
) -> tuple[Search, Habits]:
    """The search with wheels that are slower when they are sampled than on average, or that are not, where
    that explains more.

    A motor that coasts for half a millisecond before each sample loses a count or two until then, whichever
    way it turns: a deadband of 0.002 to 0.004 with a probability of 1, or the scale of a reading, of most
    sound robots with such pauses. Whoever simulates them by the mean of the torque has none of it.
    """
    other = _slowed(search, habits)
    return (search, habits) if other is None else first_ahead(search, habits, [other], under, by, 0.0)


def as_pauses_slow_the_wheels_beside(search: Search, habits: Habits, under: Under) -> tuple[Search, Habits]:
    """The same beside several causes, which stay: a pause takes a count or two."""
    other = None if habits.firmware is not None else _slowed(search, habits)
    if other is None or not under.new(search, habits, [other]):
        return search, habits
    problem = under(other)
    fit = best_of(search, problem, [search.fit.point])
    ahead = net_lead(search, fit, search.fit)
    if ahead < DOUBT:
        under.were_vain(search, habits, [other] if ahead < 0.0 else [])
        return search, habits
    tell(AGAIN)
    return grown_on(seen_from(search, problem, fit.point)), other


def _slowed(search: Search, habits: Habits) -> Habits | None:
    """Habits with wheels that pauses slow down, or that are as fast again; None where there are no pauses."""
    chain = slowed_by_pauses(habits.chain)
    if chain is None or not reads_back_emf(search.problem.features.roles):
        return None
    return replace(habits, chain=chain)
