import math

import pytest

from raccoon.model.angles import difference, wrapped


@pytest.mark.parametrize(
    ("angle", "expected"),
    [
        (0.0, 0.0),
        (math.pi, -math.pi),
        (-math.pi, -math.pi),
        (3.5 * math.pi, -0.5 * math.pi),
        (7.0, 7.0 - 2 * math.pi),
    ],
)
def test_wrapped_lies_in_half_open_turn(angle: float, expected: float) -> None:
    assert wrapped(angle) == pytest.approx(expected, abs=1e-12)


def test_difference_takes_the_short_way_over_the_seam() -> None:
    assert difference(math.radians(-170), math.radians(170)) == pytest.approx(math.radians(20))
    assert difference(math.radians(170), math.radians(-170)) == pytest.approx(math.radians(-20))


@pytest.mark.parametrize("angle", [math.nan, math.inf, -math.inf])
def test_an_angle_that_is_not_finite_is_refused(angle: float) -> None:
    with pytest.raises(ValueError, match="must be finite"):
        wrapped(angle)
