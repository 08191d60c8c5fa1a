"""The held-out recording, on which a model that was fitted to another one is judged."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace

import numpy as np

from raccoon.core.errors import HoldoutError, TraceError
from raccoon.diagnose.drives.log import Log
from raccoon.diagnose.drives.stops import motors_brake


@contextmanager
def naming_holdout() -> Iterator[None]:
    """Raise a TraceError as HoldoutError, which tells the reader that it concerns the held-out recording."""
    try:
        yield
    except TraceError as error:
        raise HoldoutError(str(error)) from None


def missing_phrase(names: Sequence[str]) -> str:
    """The beginning of a sentence that says that columns are missing."""
    return f"{', '.join(names)} {'is' if len(names) == 1 else 'are'} missing"


def check_none_missing(lacking: Sequence[str]) -> None:
    """Raise TraceError if the held-out recording lacks columns. lacking: their names."""
    if lacking:
        raise TraceError(
            f"{missing_phrase(lacking)} or broken in it, and not "
            "in the recording that is diagnosed: name one with the same channels"
        )


def with_channels_of(fitted: Log, other: Log) -> Log:
    """The held-out log with the channels that were fitted, in their order. If only the fitted log records
    when motors brake, the held-out log's stops decide whether its motors do.

    Raises TraceError that names missing channels.
    """
    own = {each.role: each for each in other.channels}
    check_none_missing([each.name for each in fitted.channels if each.role not in own])
    brake = other.brake
    if fitted.brake is not None and brake is None:
        brake = np.full(other.duty.shape, motors_brake(other))
    channels = tuple(own[each.role] for each in fitted.channels)
    return replace(other, channels=channels, missing=fitted.missing, brake=brake)
