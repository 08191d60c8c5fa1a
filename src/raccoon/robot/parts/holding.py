"""One action at a time moves a servo or a mechanism: of two, one would be lost, and neither arrive."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol


class Movable(Protocol):
    """What actions move. name: in robot.toml. moved_by: the action that does now, None where none does."""

    name: str
    moved_by: str | None


@contextmanager
def held(movable: Movable, action: str) -> Iterator[None]:
    """Let nobody else move it inside the block. Raises RuntimeError as `require_free` does."""
    require_free(movable, action)
    movable.moved_by = action
    try:
        yield
    finally:
        movable.moved_by = None


def require_free(movable: Movable, action: str) -> None:
    """Raise RuntimeError where another action moves it, which `action` would disturb."""
    if movable.moved_by is not None:
        raise RuntimeError(
            f"two actions move {movable.name} at the same time, in parallel or in the background: "
            f"'{action}' begins while '{movable.moved_by}' goes on; "
            "put them into a seq, or end one before the other begins"
        )
