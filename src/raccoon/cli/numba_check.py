"""Simulations without numba, which compiles the plant: refused where they would take hours, else remarked."""

from __future__ import annotations

import sys

from raccoon.core.errors import ConfigError
from raccoon.core.extras import install


def check_numba(what: str) -> None:
    """Raise ConfigError where numba is not installed. what: a sentence that says what takes so long."""
    from raccoon.sim.plant.compiled import has_numba

    if not has_numba():
        raise ConfigError(f"{what}; that needs numba: {install('sim')}")


def warn_without_numba() -> None:
    """Print a line on the standard error output where numba is not installed."""
    from raccoon.sim.plant.compiled import has_numba

    if not has_numba():
        print(f"numba is not installed, without which this takes longer: {install('sim')}", file=sys.stderr)
