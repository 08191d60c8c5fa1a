"""A recording to judge on, beside the one that is fitted."""

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
    """Raise a TraceError as HoldoutError, so that its reader knows which of the two recordings is meant."""
    try:
        yield
    except TraceError as error:
        raise HoldoutError(str(error)) from None


def missing_phrase(names: Sequence[str]) -> str:
    """That columns are not there, as a sentence begins."""
    return f"{', '.join(names)} {'is' if len(names) == 1 else 'are'} missing"


def check_none_missing(lacking: Sequence[str]) -> None:
    """Raise TraceError where there are columns that the other recording lacks."""
    if lacking:
        raise TraceError(
            f"{missing_phrase(lacking)} or broken in it, and not "
            "in the recording that is diagnosed: name one with the same channels"
        )


def with_channels_of(fitted: Log, other: Log) -> Log:
    """The other log with the channels that were fitted, in their order. Where only the fitted one says when
    motors brake, the other's stops tell whether its own do.

    Raises TraceError naming those that it does not have.
    """
    own = {each.role: each for each in other.channels}
    check_none_missing([each.name for each in fitted.channels if each.role not in own])
    brake = other.brake
    if fitted.brake is not None and brake is None:
        brake = np.full(other.duty.shape, motors_brake(other))
    channels = tuple(own[each.role] for each in fitted.channels)
    return replace(other, channels=channels, missing=fitted.missing, brake=brake)
