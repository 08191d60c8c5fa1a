"""Sensor chains that a controller may have, and the relations between them."""

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
"""The usual chains and three more. A firmware with its own clock differs from one in step with the rows by a
millisecond of each wheel's readings, and is tested beside causes. So is a median without slots, which is
rare, and which backlash imitates. A controller that samples all motors at the end of a cycle may let them
coast for that, or be a simulation."""
CONTINUOUS_CYCLE_S = 0.00125
"""Step in s of a filter that runs in continuous time, as finely as a simulation steps. Such a filter of 22.5
ms is 2 ms later than one of the same time constant that takes a sample every 5 ms, and the newest at once."""


def with_driver_of(chain: Chain, own: Chain) -> Chain:
    """A chain with the motor driver of `own` (current from the battery, form of the deadband), and with the
    pause of `own` if the chain has pauses."""
    pause = own.pause if chain.coast_share else 0.0
    return replace(chain, whole=own.whole, threshold=own.threshold, cut=own.cut, pause=pause)


def known_chain_of(chain: Chain) -> Chain:
    """The one of `KNOWN_CHAINS` to which a chain is equal apart from its battery filter, cycle and driver;
    the chain itself if there is none."""
    times, own = {each.battery_time_constant for each in KNOWN_CHAINS}, with_driver_of(chain, Chain())
    alike = (replace(own, battery_time_constant=each, cycle=Chain().cycle) for each in times)
    return next((each for each in alike if each in KNOWN_CHAINS), chain)


def has_back_emf(roles: Iterable[str]) -> bool:
    """Whether any of these channels is back-EMF. A controller that reads none need not let motors coast."""
    return any(each in BEMF for each in roles)


def without_unneeded_pause(chain: Chain, own: Chain, roles: Iterable[str]) -> Chain:
    """A chain; with the coast share of `own` if it runs by its own clock and no back-EMF is read."""
    if not chain.free_running or has_back_emf(roles):
        return chain
    return replace(chain, coast_share=own.coast_share)


def pauses_at_cycle_end(chain: Chain) -> bool:
    """Whether a chain is that of a controller that lets all motors coast at once to sample them."""
    return known_chain_of(chain) == PAUSING_AT_CYCLE_END


def alternative_chains(chain: Chain) -> list[Chain]:
    """The other chains that a controller may have. If the chain's battery filter is none of the known ones,
    they keep it. The last is the one in which all motors pause at once, which only makes sense if all are
    sampled at once."""
    usual, cycle = known_chain_of(chain), sample_cycle_of(chain)
    others = [replace(with_driver_of(each, chain), cycle=cycle) for each in KNOWN_CHAINS if each != usual]
    if chain == replace(with_driver_of(usual, chain), cycle=chain.cycle):
        return others
    return [replace(each, battery_time_constant=chain.battery_time_constant) for each in others]


def sample_cycle_of(chain: Chain) -> float:
    """Time in s between two samples of a chain; the usual one for a filter in continuous time."""
    return Chain().cycle if chain.cycle == CONTINUOUS_CYCLE_S else chain.cycle


def with_pause_slowdown_toggled(chain: Chain) -> Chain | None:
    """A chain whose wheels are slower when they are sampled, at the end of a pause, than on average, or
    without that if the chain has it. None for a chain without pauses."""
    if not chain.coast_share:
        return None
    return replace(chain, pause=0.0 if chain.pause else chain.coast_share * Chain().cycle)
