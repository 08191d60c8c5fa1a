"""From where the robot should be and is to the velocities that close the gap: how hard every motion pulls
back to its path."""

from __future__ import annotations

from raccoon.control.profile import ProfileState

ALONG_GAIN, MAX_CATCH_UP_SPEED = 5.0, 0.06
"""1/s, speed a metre behind, and m/s, the most that the gap along the line adds to the profile's speed."""
HEADING_GAIN, ACROSS_GAIN = 4.0, 120.0
"""1/s, turn rate a radian off, and rad/m2, turn rate, per m/s of speed, a metre beside the line. With heading
error h and offset y, y' = v h and h' = -HEADING h - ACROSS v y: a critically damped approach has
ACROSS v^2 = HEADING^2 / 4."""
TURN_GAIN = 6.0
"""1/s, turn rate a radian behind in a turn."""


def line_command(
    reference: ProfileState, along: float, across: float, heading_error: float
) -> tuple[float, float]:
    """(velocity m/s, turn rate rad/s) that keep to a line.

    along, across: m ahead of the line's start and left of it. heading_error: rad, present minus the line's.
    """
    gap = ALONG_GAIN * (reference.position - along)
    velocity = reference.velocity + max(-MAX_CATCH_UP_SPEED, min(MAX_CATCH_UP_SPEED, gap))
    turn_rate = -HEADING_GAIN * heading_error - ACROSS_GAIN * reference.velocity * across
    return velocity, turn_rate


def turn_command(reference: ProfileState, turned: float) -> float:
    """Turn rate rad/s that keeps to a turn's profile; `turned`: rad since its start."""
    return reference.velocity + TURN_GAIN * (reference.position - turned)


def limit_slew(value: float, wanted: float, step: float) -> float:
    """`wanted`, but at most `step` away from `value`."""
    return max(value - step, min(value + step, wanted))
