"""Sensor chains that a controller may have: which there are, and what tells one from another."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from raccoon.core.readings import RACCOON_COASTS
from raccoon.diagnose.drives.log import BEMF
from raccoon.sim.effects.chain import Chain

USUAL_CHAINS = (Chain.firmware(), Chain())
FREE_RUNNING = replace(Chain.firmware(), slots=False, free_running=True)
MEDIAN_AT_CYCLE_END = Chain(median=True)
PAUSING_AT_CYCLE_END = replace(MEDIAN_AT_CYCLE_END, coast_share=RACCOON_COASTS)
KNOWN_CHAINS = (*USUAL_CHAINS, FREE_RUNNING, MEDIAN_AT_CYCLE_END, PAUSING_AT_CYCLE_END)
"""The firmware by its own clock differs from one in step by a millisecond of each wheel, and is tried beside
causes. So is a median without slots, which is rare: to wheels with play it looks right. Whoever samples all
motors at the end of a cycle may let them coast for it, or be a simulation."""
CONTINUOUS_CYCLE_S = 0.00125
"""s between two steps of a filter that runs as finely as a simulation steps. One of 22.5 ms is 2 ms later
then than one of the same time constant that takes in a sample each 5 ms, and the newest at once."""


def with_driver_of(chain: Chain, own: Chain) -> Chain:
    """A chain whose driver takes from the battery, and does with a deadband, what that of the own one does,
    and with the own one's pause where it makes pauses."""
    pause = own.pause if chain.coast_share else 0.0
    return replace(chain, whole=own.whole, threshold=own.threshold, cut=own.cut, pause=pause)


def known_chain_of(chain: Chain) -> Chain:
    """The one of `KNOWN_CHAINS` that this chain is, but for its battery's filter, its cycle and its driver;
    where it is none, the chain itself."""
    times, own = {each.battery_time_constant for each in KNOWN_CHAINS}, with_driver_of(chain, Chain())
    alike = (replace(own, battery_time_constant=each, cycle=Chain().cycle) for each in times)
    return next((each for each in alike if each in KNOWN_CHAINS), chain)


def has_back_emf(roles: Iterable[str]) -> bool:
    """Whether any of these channels is back-EMF. Whoever reads none need not let motors coast for it."""
    return any(each in BEMF for each in roles)


def without_unneeded_pause(chain: Chain, own: Chain, roles: Iterable[str]) -> Chain:
    """A chain, with the own one's share of pauses where it is by its own clock and no back-EMF is read."""
    if not chain.free_running or has_back_emf(roles):
        return chain
    return replace(chain, coast_share=own.coast_share)


def pauses_at_cycle_end(chain: Chain) -> bool:
    """Whether a chain is that of a controller that lets all motors coast at once to sample them."""
    return known_chain_of(chain) == PAUSING_AT_CYCLE_END


def alternative_chains(chain: Chain) -> list[Chain]:
    """The chains that a controller may have if not this one, with the filter of the battery's readings kept
    where that is none of theirs. The last is that in which all motors pause at once, which is of no use
    unless all are sampled at once."""
    usual, cycle = known_chain_of(chain), sample_cycle_of(chain)
    others = [replace(with_driver_of(each, chain), cycle=cycle) for each in KNOWN_CHAINS if each != usual]
    if chain == replace(with_driver_of(usual, chain), cycle=chain.cycle):
        return others
    return [replace(each, battery_time_constant=chain.battery_time_constant) for each in others]


def sample_cycle_of(chain: Chain) -> float:
    """s between two samples of a chain; the usual ones for a filter that runs all the time."""
    return Chain().cycle if chain.cycle == CONTINUOUS_CYCLE_S else chain.cycle


def with_pause_slowdown_toggled(chain: Chain) -> Chain | None:
    """A chain whose wheels are slower when they are read, at the end of a pause, than on average; as fast
    where they were slower. None for one without pauses."""
    if not chain.coast_share:
        return None
    return replace(chain, pause=0.0 if chain.pause else chain.coast_share * Chain().cycle)
