"""Chains of samples that a controller may have: which there are, and what tells one from another."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from raccoon.core.readings import RACCOON_COASTS
from raccoon.diagnose.drives.log import BEMF
from raccoon.sim.effects.chain import Chain

USUAL_CHAINS = (Chain.firmware(), Chain())
FREE_RUNNING = replace(Chain.firmware(), slots=False, free_running=True)
AT_ITS_END = Chain(median=True)
PAUSING = replace(AT_ITS_END, coast_share=RACCOON_COASTS)
CHAINS = (*USUAL_CHAINS, FREE_RUNNING, AT_ITS_END, PAUSING)
"""The firmware by its own clock differs from one in step by a millisecond of each wheel, and is asked for
beside causes. So is a median without slots, which is rare: to wheels with play it looks right. Whoever
samples all motors at the end of a cycle may let them coast for it, or be a simulation."""
FINE_CYCLE = 0.00125
"""s between two steps of a filter that runs as finely as whoever wrote it steps. One of 22.5 ms is 2 ms later
then than one of the same time constant that takes in a sample each 5 ms, and the newest at once."""


def with_driver_of(chain: Chain, own: Chain) -> Chain:
    """A chain with what the own one's driver takes from the battery, and does with a deadband, and with its
    pauses where it makes some."""
    pause = own.pause if chain.coast_share else 0.0
    return replace(chain, whole=own.whole, threshold=own.threshold, cut=own.cut, pause=pause)


def usual_chain(chain: Chain) -> Chain:
    """That of `CHAINS` which this one is, but for the filter of the battery's readings, its cycle and its
    driver."""
    times, own = {each.battery_time_constant for each in CHAINS}, with_driver_of(chain, Chain())
    alike = (replace(own, battery_time_constant=each, cycle=Chain().cycle) for each in times)
    return next((each for each in alike if each in CHAINS), chain)


def reads_back_emf(roles: Iterable[str]) -> bool:
    """Whether any of these channels is back-EMF. Whoever reads none need not let motors coast for it."""
    return any(each in BEMF for each in roles)


def as_it_pauses(chain: Chain, own: Chain, roles: Iterable[str]) -> Chain:
    """A chain; one by its own clock that reads no back-EMF pauses no more than the own one does."""
    if not chain.free_running or reads_back_emf(roles):
        return chain
    return replace(chain, coast_share=own.coast_share)


def pauses(chain: Chain) -> bool:
    """Whether it is that of a controller that lets motors coast while it samples all of them at once."""
    return usual_chain(chain) == PAUSING


def other_chains(chain: Chain) -> list[Chain]:
    """Those that a controller may have if not this one, with the filter of the battery's readings kept where
    that is none of theirs. Whether all motors pause at once is asked last, and of no use unless all are
    sampled at once."""
    usual, cycle = usual_chain(chain), cycle_of_samples(chain)
    others = [replace(with_driver_of(each, chain), cycle=cycle) for each in CHAINS if each != usual]
    if chain == replace(with_driver_of(usual, chain), cycle=chain.cycle):
        return others
    return [replace(each, battery_time_constant=chain.battery_time_constant) for each in others]


def cycle_of_samples(chain: Chain) -> float:
    """s between two samples of a chain that takes some, where one that filters all the time is another."""
    return Chain().cycle if chain.cycle == FINE_CYCLE else chain.cycle


def slowed_by_pauses(chain: Chain) -> Chain | None:
    """A chain whose wheels are slower when they are read, at the end of a pause, than on average; as fast
    where they were slower. None of one without pauses."""
    if not chain.coast_share:
        return None
    return replace(chain, pause=0.0 if chain.pause else chain.coast_share * Chain().cycle)
