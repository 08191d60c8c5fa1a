"""One action at a time moves a servo or a mechanism: of two, one would be lost, and neither arrive."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Protocol

from raccoon.core.errors import ConfigError

if TYPE_CHECKING:
    from raccoon.robot.robot import Robot


class Movable(Protocol):
    """What actions move. name: in robot.toml. moved_by: the action that does now, None where none does."""

    name: str
    moved_by: str | None


@contextmanager
def exclusive_use(movable: Movable, action: str) -> Iterator[None]:
    """Let nobody else move it inside the block. Raises RuntimeError as `require_free` does."""
    require_free(movable, action)
    movable.moved_by = action
    try:
        yield
    finally:
        movable.moved_by = None


def require_wombat(robot: Robot, kind: str, name: str) -> None:
    """Raise ConfigError where the controller has no port for the `kind` (servo, mechanism) of that name."""
    if robot.config.controller.port == "create":
        raise ConfigError(
            f"{kind}.{name}: a Create has no port for a {kind} (its motors are the wheels); a Wombat has some"
        )


def require_free(movable: Movable, action: str) -> None:
    """Raise RuntimeError where another action moves it, which `action` would disturb."""
    if movable.moved_by is not None:
        raise RuntimeError(
            f"two actions move {movable.name} at the same time, in parallel or in the background: "
            f"'{action}' begins while '{movable.moved_by}' goes on; "
            "put them into a seq, or end one before the other begins"
        )
