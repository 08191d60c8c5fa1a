"""Parts go by their names: a port in the place of one is refused at the line that says it."""

from collections.abc import Callable
from typing import Any

import pytest

from raccoon import (
    align_on_line,
    blocked,
    follow_line,
    move,
    move_by,
    on_black,
    on_white,
    over_line,
    release,
    servo,
    servo_off,
    spin,
    zero,
)

PORT: Any = 2


@pytest.mark.parametrize(
    ("make", "of"),
    [
        (lambda: servo(PORT, 1200), "name"),
        (lambda: servo_off(PORT), "name"),
        (lambda: move(PORT, 1.0), "name"),
        (lambda: move_by(PORT, 1.0), "name"),
        (lambda: spin(PORT, 1.0), "name"),
        (lambda: release(PORT), "name"),
        (lambda: zero(PORT), "name"),
        (lambda: blocked(PORT), "mechanism"),
        (lambda: on_black(PORT), "tophat"),
        (lambda: on_white(PORT), "tophat"),
        (lambda: over_line(PORT), "tophat"),
        (lambda: follow_line(PORT), "tophat"),
        (lambda: align_on_line("left", PORT), "right"),
    ],
)
def test_a_port_is_no_name(make: Callable[[], object], of: str) -> None:
    with pytest.raises(
        TypeError, match=f"{of} is 2: it must be a name from robot.toml, where its port is set"
    ):
        make()
