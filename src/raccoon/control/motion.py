"""Feedback of every motion: from reference and present pose to the velocities that reduce the error."""

from __future__ import annotations

from raccoon.control.profile import ProfileState

ALONG_GAIN, MAX_CATCH_UP_SPEED = 5.0, 0.06
"""1/s, speed per metre of error along the line; and m/s, bound on what that adds to the profile's speed."""
HEADING_GAIN, ACROSS_GAIN = 4.0, 120.0
"""1/s, turn rate per radian of heading error; and rad/m2, turn rate, per m/s of speed, for each metre beside
the line. With heading error h and offset y, y' = v h and h' = -HEADING h - ACROSS v y: a critically damped
approach has ACROSS v^2 = HEADING^2 / 4."""
TURN_GAIN = 6.0
"""1/s, turn rate per radian of error in a turn."""


def line_command(
    reference: ProfileState, along: float, across: float, heading_error: float
) -> tuple[float, float]:
    """(velocity m/s, turn rate rad/s) that follow a line.

    along, across: m ahead of the line's start and to its left. heading_error: rad, present minus the line's.
    """
    gap = ALONG_GAIN * (reference.position - along)
    velocity = reference.velocity + max(-MAX_CATCH_UP_SPEED, min(MAX_CATCH_UP_SPEED, gap))
    turn_rate = -HEADING_GAIN * heading_error - ACROSS_GAIN * reference.velocity * across
    return velocity, turn_rate


def turn_command(reference: ProfileState, turned: float) -> float:
    """Turn rate (rad/s) that follows a turn's profile; `turned`: rad since its start."""
    return reference.velocity + TURN_GAIN * (reference.position - turned)


def limit_slew(value: float, wanted: float, step: float) -> float:
    """`wanted`, limited to at most `step` away from `value`."""
    return max(value - step, min(value + step, wanted))
