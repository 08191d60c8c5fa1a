"""Friction of the plant's wheels: its size, and the wheel speeds that result from it.

A part of the plant's source text, by the same rules (see `equations`); docs/simulator.md derives it.
"""

from __future__ import annotations

from math import sqrt

from raccoon.sim.plant.quantities import Circuit, Plant, Rubbing, State
from raccoon.sim.plant.series import decay, freed


def expected(speed: float, acceleration: float, h: float) -> float:
    """Speed expected in the middle of the step, rad/s, extrapolated with the acceleration of the last
    step."""
    return speed + 0.5 * h * acceleration


def frictions(s: State, p: Plant, c: Circuit, h: float) -> tuple[Rubbing, Rubbing]:
    """Friction of the left and of the right wheel at their expected speeds."""
    left = expected(s.speed_left, s.acceleration_left, h)
    right = expected(s.speed_right, s.acceleration_right, h)
    return friction(
        left, p.back_emf_left * c.current_left, p.coulomb_left, p.viscous_left, p.quadratic_left,
        p.stiction_left, p.stiction_rate_left, p.load_left, p.asymmetry_left, p.viscous_asymmetry_left,
    ), friction(
        right, p.back_emf_right * c.current_right, p.coulomb_right, p.viscous_right, p.quadratic_right,
        p.stiction_right, p.stiction_rate_right, p.load_right, p.asymmetry_right, p.viscous_asymmetry_right,
    )  # fmt: skip


def friction(
    speed: float, moment: float, coulomb: float, viscous: float, quadratic: float,
    stiction: float, stiction_rate: float, load: float, asymmetry: float, viscous_asymmetry: float,
) -> Rubbing:  # fmt: skip
    """Friction of one wheel. speed: rad/s. moment: torque that its gear transmits, N m. The others as in
    `Plant`."""
    forward = coulomb
    backward = coulomb
    drag = viscous
    lean = viscous_asymmetry if speed > 0.0 else -viscous_asymmetry
    forward *= 1.0 + asymmetry  # effect: friction.direction_dependent
    backward *= 1.0 - asymmetry  # effect: friction.direction_dependent
    drag *= 1.0 + lean  # effect: friction.direction_dependent
    ratio = speed * stiction_rate
    more = 0.0
    more += stiction * decay(ratio * ratio)  # effect: friction.stiction
    more += load * abs(moment)  # effect: friction.load_dependent
    drag += quadratic * abs(speed)  # effect: friction.quadratic
    return Rubbing(forward + more, backward + more, drag)


def gripped(
    s: State, p: Plant, own_left: float, own_right: float, other: float, push_left: float, push_right: float,
    left: Rubbing, right: Rubbing, rigid_left: float, rigid_right: float, h: float, per_h: float,
) -> tuple[float, float, float, float]:  # fmt: skip
    """Speeds at the end of a step and torques of the bristles, for wheels with presliding friction; the given
    rigid speeds and 0 if the robot has none.

    Bristles (Canudas de Wit et al. 1995), with torque as their state instead of deflection: compliance grip'
    = w - |w| grip / level, and friction = grip + damping compliance grip'. This is linear in the new speeds:
    the spring is taken in the middle of the step, sliding at the expected speed, so fast sliding is stable.
    """
    moving_left, level_left, pulled_left = bristles(
        p, left, s.speed_left, s.acceleration_left, s.grip_left, h
    )
    moving_right, level_right, pulled_right = bristles(
        p, right, s.speed_right, s.acceleration_right, s.grip_right, h
    )
    gives = p.compliance > 0.0 or p.creep > 0.0
    # A torque that follows the speed at once is that of the middle of the step already.
    share = 0.5 + p.grip_damping * p.compliance * per_h if p.compliance > 0.0 else 1.0
    kept = h * (1.0 - share)
    # Both rows times what bristles would divide by, so that one division does for all.
    stiff = h * share
    whole_left = own_left * moving_left + 0.5 * h * stiff * level_left
    whole_right = own_right * moving_right + 0.5 * h * stiff * level_right
    rest_left = moving_left * (push_left - kept * s.grip_left) - stiff * pulled_left
    rest_right = moving_right * (push_right - kept * s.grip_right) - stiff * pulled_right
    determinant = whole_left * whole_right - other * other * moving_left * moving_right
    per_both = 1.0 / (determinant * stiff)
    inverse = stiff * per_both
    new_left = (whole_right * rest_left - other * moving_left * rest_right) * inverse
    new_right = (whole_left * rest_right - other * moving_right * rest_left) * inverse
    per_stiff = determinant * per_both
    grip_left = (push_left - own_left * new_left - other * new_right - kept * s.grip_left) * per_stiff
    grip_right = (push_right - own_right * new_right - other * new_left - kept * s.grip_right) * per_stiff
    return (
        new_left if gives else rigid_left,
        new_right if gives else rigid_right,
        grip_left if gives else 0.0,
        grip_right if gives else 0.0,
    )


def bristles(
    p: Plant, rubbing: Rubbing, speed: float, acceleration: float, grip: float, h: float
) -> tuple[float, float, float]:
    """Coefficients (moving, level, pulled) of one wheel: new grip = (pulled + h / 2 level new speed) /
    moving."""
    middle = expected(speed, acceleration, h)
    level = rubbing.forward if middle > 0.0 else rubbing.backward
    held = p.compliance * level
    sliding = abs(middle)
    sliding = let_go(sliding, p.creep, p.creep_tail) if p.creep > 0.0 else sliding  # creeping
    sliding *= plastic_share(p, level, grip, middle, h) if p.break_away > 0.0 else 1.0  # creeping
    least = 1e-12  # not 0 for a rigid wheel at rest either, whose speeds are not taken from here
    return held + h * sliding + least, level, held * grip + 0.5 * h * level * speed


def plastic_share(p: Plant, level: float, grip: float, speed: float, h: float) -> float:
    """Share of the rate |w| at which bristles let go, if up to the part `break_away` of their level they are
    elastic (Dupont, Hayward, Armstrong, Altpeter 2002). 1 is that of bristles that creep at any torque.

    Of a torque x in levels, x - break_away of 1 - break_away lets go, that is (x - break_away) / ((1 -
    break_away) x) of what creeps. It is that of the torque that the bristles would have at the end of the
    step if they were elastic: with the torque before a step that slides by far more than they give, they
    would wind up beyond their level.
    """
    way = 1.0 if speed > 0.0 else -1.0
    part = way * (p.compliance * grip + h * speed) / (p.compliance * level + 1e-12)
    beyond = part if part > p.break_away else p.break_away
    share = (beyond - p.break_away) / ((1.0 - p.break_away) * beyond + 1e-12)
    share = share if part < 1.0 else 1.0
    return share if part > 0.0 else 1.0 - p.break_away


def let_go(speed: float, creep: float, tail: float) -> float:
    """Rate, rad/s, at which bristles let go at a `speed` (rad/s, not below 0). With creep they do so at rest
    as well.

    Steady friction is level * speed / let_go, a curve through 0 instead of a step. tail: the part of it that
    approaches the level slowly, as speed / (speed + creep); the rest approaches it as tanh(speed / creep).
    """
    squared = speed * speed
    crept = creep * creep
    return (1.0 - tail) * sqrt(sqrt(squared * squared + crept * crept)) + tail * (speed + creep)


def settled(
    own_left: float, own_right: float, other: float, push_left: float, push_right: float,
    left: Rubbing, right: Rubbing,
) -> tuple[float, float]:  # fmt: skip
    """The speeds that solve A w = push - dry friction, where friction on a wheel at rest takes any value it
    needs.

    The friction that a wheel needs to stand still decreases as it turns faster, whatever the other wheel
    does. So a wheel moves in the direction in which it is pushed while it is held and the other is free, and
    rests where friction can bear that push.
    """
    both = own_left * own_right
    spare = both - other * other
    per_all = 1.0 / (both * spare)  # one division for all three
    inverse_left = own_right * spare * per_all
    inverse_right = own_left * spare * per_all
    inverse = both * per_all
    alone_left = freed(push_left, left.forward, left.backward) * inverse_left
    alone_right = freed(push_right, right.forward, right.backward) * inverse_right
    way_left = freed(push_left - other * alone_right, left.forward, left.backward)
    way_right = freed(push_right - other * alone_left, right.forward, right.backward)
    net_left = push_left - (left.forward if way_left > 0.0 else -left.backward)
    net_right = push_right - (right.forward if way_right > 0.0 else -right.backward)
    both_left = (own_right * net_left - other * net_right) * inverse
    both_right = (own_left * net_right - other * net_left) * inverse
    exact_left = both_left if way_right != 0.0 else net_left * inverse_left
    exact_right = both_right if way_left != 0.0 else net_right * inverse_right
    return (
        exact_left if exact_left * way_left > 0.0 else 0.0,
        exact_right if exact_right * way_right > 0.0 else 0.0,
    )
