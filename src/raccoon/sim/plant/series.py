"""Small functions of the plant's equations in a form that a vector unit can compute: polynomials and choices
without calls of a library."""

from __future__ import annotations


def decay(x: float) -> float:
    """exp(-x) for x >= 0 to 1e-13: the Taylor series of x / 256, squared eight times; 0 from 36 on."""
    y = x * (1.0 / 256.0) if x < 36.0 else 0.0
    series = y * (1.0 / 120.0 - y * (1.0 / 720.0))
    series = 1.0 - y * (1.0 - y * (1.0 / 2.0 - y * (1.0 / 6.0 - y * (1.0 / 24.0 - series))))
    series *= series
    series *= series
    series *= series
    series *= series
    series *= series
    series *= series
    series *= series
    series *= series
    return series if x < 36.0 else 0.0


def rotated(cosine: float, sine: float, angle: float) -> tuple[float, float]:
    """Cosine and sine of an angle after a rotation by a small angle, rad (accurate to the last bits below
    0.02 rad)."""
    a = angle * angle
    s = angle * (1.0 - a * (1.0 / 6.0 - a * (1.0 / 120.0)))
    c = 1.0 - a * (0.5 - a * (1.0 / 24.0 - a * (1.0 / 720.0)))
    return cosine * c - sine * s, sine * c + cosine * s


def within(value: float, half: float) -> float:
    """`value` clipped to -half..half."""
    value = value if value < half else half
    return value if value > -half else -half


def within_unit(share: float) -> float:
    """`share` clipped to 0..1."""
    share = share if share > 0.0 else 0.0
    return share if share < 1.0 else 1.0


def freed(push: float, forward: float, backward: float) -> float:
    """The rest of a push after dry friction: 0 if the push is within -backward..forward (the wheel
    sticks)."""
    held = push if push < forward else forward
    return push - (held if held > -backward else -backward)


def middle_of(first: float, second: float, third: float) -> float:
    """The median of three."""
    low = first if first < second else second
    high = second if first < second else first
    upper = high if high < third else third
    return low if low > upper else upper


def slack(play: float, ahead: float, faster: float, half_play: float, h: float, per_h: float) -> float:
    """Play of a gear, rad, after a step in which the motor advances by `ahead` (rad) relative to a wheel that
    rolls on alone, and ends `faster` (rad/s) than it. If it leaves a tooth within the step, play is counted
    from there."""
    began = 2.0 * ahead * per_h - faster
    parted = 0.5 * h * faster * faster / (abs(faster) + abs(began)) if began * faster < 0.0 else 0.0
    low = parted - half_play if faster > 0.0 else -half_play
    high = half_play - parted if faster < 0.0 else half_play
    return within(min(max(play + ahead, low), high), half_play)


def lagging(rolling: float, before: float, after: float, lag: float, h: float, per_h: float) -> float:
    """Solution after one step of lag * rolling' = speed - rolling, with a speed that changes linearly from
    `before` to `after`; exact except for the remaining share (`staying`)."""
    return trailing(rolling, before, after, lag, staying(lag, h), per_h)


def trailing(rolling: float, before: float, after: float, lag: float, stays: float, per_h: float) -> float:
    """As `lagging`, with the remaining share of the initial difference given."""
    behind = lag * (after - before) * per_h
    return after - behind + stays * (rolling - before + behind)


def staying(lag: float, h: float) -> float:
    """Share of the initial value that remains in a first-order lag after a step: exp(-h / lag) to second
    order, 0 without lag."""
    squared = lag * lag
    return squared / (squared + h * (lag + 0.5 * h))
