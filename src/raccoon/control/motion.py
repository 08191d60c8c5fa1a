"""From where the robot should be and is to the velocities that close the gap."""

from __future__ import annotations

from dataclasses import dataclass

from raccoon.control.profile import ProfileState


@dataclass(frozen=True, slots=True)
class TrackingGains:
    """Outer loop gains.

    along 1/s: speed a metre behind. heading 1/s: turn rate a radian off. across rad/m2: turn rate, per m/s
    of speed, a metre beside the line. With heading error h and offset y, y' = v h and
    h' = -heading h - across v y: a critically damped approach has across v^2 = heading^2 / 4.
    """

    along: float = 5.0
    heading: float = 4.0
    across: float = 120.0
    turn: float = 6.0
    catch_up: float = 0.06
    """m/s, the most that the gap along the line adds to the profile's speed."""


def line_command(
    reference: ProfileState, along: float, across: float, heading_error: float, gains: TrackingGains
) -> tuple[float, float]:
    """(velocity m/s, turn rate rad/s) that keep to a line.

    along, across: m ahead of the line's start and left of it. heading_error: rad, present minus the line's.
    """
    gap = gains.along * (reference.position - along)
    velocity = reference.velocity + max(-gains.catch_up, min(gains.catch_up, gap))
    turn_rate = -gains.heading * heading_error - gains.across * reference.velocity * across
    return velocity, turn_rate


def turn_command(reference: ProfileState, turned: float, gains: TrackingGains) -> float:
    """Turn rate rad/s that keeps to a turn's profile; `turned`: rad since its start."""
    return reference.velocity + gains.turn * (reference.position - turned)


def slewed(value: float, wanted: float, step: float) -> float:
    """`wanted`, but at most `step` away from `value`."""
    return max(value - step, min(value + step, wanted))
