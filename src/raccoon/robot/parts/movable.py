"""Exclusive use of a servo or mechanism: of two actions that move it at once one would be lost, and neither
would arrive."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Protocol

from raccoon.core.errors import ConfigError

if TYPE_CHECKING:
    from raccoon.robot.robot import Robot


class Movable(Protocol):
    """Something that actions move. name: in robot.toml. moved_by: the action that is moving it, None for
    none."""

    name: str
    moved_by: str | None


@contextmanager
def exclusive_use(movable: Movable, action: str) -> Iterator[None]:
    """Let no other action move it inside the block. Raises RuntimeError as `require_free` does."""
    require_free(movable, action)
    movable.moved_by = action
    try:
        yield
    finally:
        movable.moved_by = None


def require_wombat(robot: Robot, kind: str, name: str) -> None:
    """Raise ConfigError if the controller has no port for the `kind` (servo, mechanism) of that name."""
    if robot.config.controller.port == "create":
        raise ConfigError(
            f"{kind}.{name}: a Create has no port for a {kind} (its only motors are the wheels); use a Wombat"
        )


def require_free(movable: Movable, action: str) -> None:
    """Raise RuntimeError if another action is moving it, which `action` would disturb."""
    if movable.moved_by is not None:
        raise RuntimeError(
            f"two actions move {movable.name} at the same time, in parallel or in the background: "
            f"'{action}' begins while '{movable.moved_by}' is running; put them into a seq, or end one "
            "before the other begins"
        )
