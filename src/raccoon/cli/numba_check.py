"""Checks for numba, which compiles the plant: without it, long simulations are refused and short ones warned
about."""

from __future__ import annotations

import sys

from raccoon.core.errors import ConfigError
from raccoon.core.extras import install


def check_numba(what: str) -> None:
    """Raise ConfigError if numba is not installed. what: beginning of the message, which names the long
    simulation."""
    from raccoon.sim.plant.compiled import has_numba

    if not has_numba():
        raise ConfigError(f"{what}; that needs numba: {install('sim')}")


def warn_without_numba() -> None:
    """Print a warning on standard error if numba is not installed."""
    from raccoon.sim.plant.compiled import has_numba

    if not has_numba():
        print(f"numba is not installed, without which this takes longer: {install('sim')}", file=sys.stderr)
