"""The plant's equations: the single source from which the code for one robot and for lanes of many is made.

All functions take and return plain floats, so the same text runs as Python and compiled by numba, for one
robot or many side by side. That requires three rules: no branches in what is computed (a choice is `a if c
else b`), no division by what can be 0, and no function that a vector unit does not have.

A statement that ends with `# effect: ID` is the term of that effect. At the neutral value it changes nothing,
not even the last bit: without the statement the plant gives the same numbers. A statement with `# world:
contact` is omitted for robots in lanes, which have no table; one with `# creeping` for robots with presliding
friction that let go at |w|. docs/simulator.md derives the equations.
"""

from __future__ import annotations

from raccoon.sim.plant.friction import expected, frictions, gripped, settled
from raccoon.sim.plant.quantities import Circuit, Command, Plant, Rubbing, State
from raccoon.sim.plant.series import freed, lagging, rotated, slack, staying, trailing


def substep(s: State, p: Plant, u: Command, h: float, per_h: float) -> State:
    """The state one step of `h` seconds later; per_h: 1 / h.

    Linear terms by the trapezoidal rule, dry friction as the exact solution of its inclusion for both wheels
    together, the rest at the speeds expected in the middle of the step: second order and unconditionally
    stable.
    """
    c = circuit(s, p, u, h)
    left, right = frictions(s, p, c, h)
    speed_left, speed_right, grip_left, grip_right = driven(s, p, c, left, right, h, per_h)
    return moved(s, p, u, c, speed_left, speed_right, grip_left, grip_right, h, per_h)


def circuit(s: State, p: Plant, u: Command, h: float) -> Circuit:
    """Battery and windings at the expected wheel speeds; the battery's sag couples the motors."""
    left = expected(s.speed_left, s.acceleration_left, h)
    right = expected(s.speed_right, s.acceleration_right, h)
    ohm_left = p.resistance_left
    ohm_right = p.resistance_right
    ohm_left *= 1.0 + p.heating_left * s.heat_left  # effect: motor.heating
    ohm_right *= 1.0 + p.heating_right * s.heat_right  # effect: motor.heating
    per_both = 1.0 / (ohm_left * ohm_right)  # one division for both: they are what costs most
    wire_left = u.closed_left * (ohm_right * per_both)
    wire_right = u.closed_right * (ohm_left * per_both)
    source = p.open_circuit_voltage
    source -= p.volts_per_coulomb * s.charge  # effect: battery.discharge
    sag = p.internal_resistance
    held_left = 0.0
    held_right = 0.0
    gain_left = u.left * wire_left
    gain_right = u.right * wire_right
    volts_left = p.back_emf_left * left
    volts_right = p.back_emf_right * right
    share_left = u.left
    share_right = u.right
    share_left = carried(u.left, source, volts_left, p.whole)  # chain: whole
    share_right = carried(u.right, source, volts_right, p.whole)  # chain: whole
    feed_left = share_left * wire_left
    feed_right = share_right * wire_right
    # The voltage and the currents times `scale`: finding a limit exceeded then takes no division.
    scale = 1.0 + sag * (feed_left * u.left + feed_right * u.right)
    bus = source + sag * (feed_left * volts_left + feed_right * volts_right)
    free_left = gain_left * bus - wire_left * volts_left * scale
    free_right = gain_right * bus - wire_right * volts_right * scale
    # Currents are means over pauses for samples, a limit is that of a motor while it is driven.
    held_left = u.closed_left * p.limit_left  # effect: motor.current_limit
    held_right = u.closed_right * p.limit_right  # effect: motor.current_limit
    held_left = beyond(free_left, held_left * scale, held_left)  # effect: motor.current_limit
    held_right = beyond(free_right, held_right * scale, held_right)  # effect: motor.current_limit
    wire_left = wire_left if held_left == 0.0 else 0.0  # effect: motor.current_limit
    wire_right = wire_right if held_right == 0.0 else 0.0  # effect: motor.current_limit
    gain_left = gain_left if held_left == 0.0 else 0.0  # effect: motor.current_limit
    gain_right = gain_right if held_right == 0.0 else 0.0  # effect: motor.current_limit
    feed_left = feed_left if held_left == 0.0 else 0.0  # effect: motor.current_limit
    feed_right = feed_right if held_right == 0.0 else 0.0  # effect: motor.current_limit
    source -= sag * (share_left * held_left + share_right * held_right)
    share = 1.0 / (1.0 + sag * (feed_left * u.left + feed_right * u.right))
    source *= share
    sag *= share
    bus = source + sag * (feed_left * volts_left + feed_right * volts_right)
    # What the battery carries of one motor is then not what the other one gets of its voltage: it is held for
    # the step.
    source += p.whole * (bus - source)  # chain: whole
    sag -= p.whole * sag  # chain: whole
    return Circuit(
        source, sag, wire_left, wire_right, held_left, held_right,
        p.back_emf_left * gain_left, p.back_emf_right * gain_right,
        gain_left * bus - wire_left * volts_left + held_left,
        gain_right * bus - wire_right * volts_right + held_right,
    )  # fmt: skip


def carried(duty: float, source: float, volts: float, whole: float) -> float:
    """Share of a motor's current that the battery carries: its duty; if `whole`, 1 or -1 by its direction."""
    way = 1.0 if duty * source > volts else -1.0
    return duty + whole * (way - duty)


def beyond(current: float, bound: float, limit: float) -> float:
    """`limit` with the sign of `current` if that exceeds `bound` in magnitude; otherwise 0."""
    over = limit if current > bound else 0.0
    return -limit if current < -bound else over


def driven(
    s: State, p: Plant, c: Circuit, left: Rubbing, right: Rubbing, h: float, per_h: float
) -> tuple[float, float, float, float]:
    """Wheel speeds at the end of the step, rad/s, and the torques of the friction's bristles then, N m."""
    drive_left = c.pull_left * c.source + p.back_emf_left * c.held_left
    drive_right = c.pull_right * c.source + p.back_emf_right * c.held_right
    fed_left = c.pull_left * c.sag
    damp_left = p.back_emf_left * p.back_emf_left * c.wire_left - c.pull_left * fed_left
    damp_right = p.back_emf_right * p.back_emf_right * c.wire_right - c.pull_right * c.pull_right * c.sag
    damp_both = -c.pull_right * fed_left
    damp_left += left.drag
    damp_right += right.drag
    turning = 0.0
    turning = turned(
        s, p, drive_left, drive_right, damp_left, damp_right, damp_both, left, right, h
    )  # effect: drive.turn_scrub
    scrub = p.scrub / (turning if turning > 0.02 else 0.02)
    damp_left += scrub  # effect: drive.turn_scrub
    damp_right += scrub  # effect: drive.turn_scrub
    damp_both -= scrub  # effect: drive.turn_scrub
    slope = 0.0
    slope += p.slope_x * s.heading_cos + p.slope_y * s.heading_sin  # effect: drive.slope
    half = 0.5 * h
    cross = p.inertia_other - half * damp_both
    push_left = (p.inertia_own - half * damp_left) * s.speed_left + cross * s.speed_right
    push_right = (p.inertia_own - half * damp_right) * s.speed_right + cross * s.speed_left
    own_left = p.inertia_own + half * damp_left
    own_right = p.inertia_own + half * damp_right
    other = p.inertia_other + half * damp_both
    drive_left += p.pushed_left  # world: contact
    drive_right += p.pushed_right  # world: contact
    push_left += h * (drive_left + slope)
    push_right += h * (drive_right + slope)
    sliding_left = Rubbing(h * left.forward, h * left.backward, 0.0)
    sliding_right = Rubbing(h * right.forward, h * right.backward, 0.0)
    new_left = 0.0
    new_right = 0.0
    new_left, new_right = settled(
        own_left, own_right, other, push_left, push_right, sliding_left, sliding_right
    )  # without effect: friction.presliding
    grip_left = 0.0
    grip_right = 0.0
    new_left, new_right, grip_left, grip_right = gripped(
        s, p, own_left, own_right, other, push_left, push_right, left, right, new_left, new_right, h, per_h
    )  # effect: friction.presliding
    return new_left, new_right, grip_left, grip_right


def turned(
    s: State, p: Plant, drive_left: float, drive_right: float, damp_left: float, damp_right: float,
    damp_both: float, left: Rubbing, right: Rubbing, h: float,
) -> float:  # fmt: skip
    """Magnitude of the difference of the wheel speeds in the middle of the step, rad/s, predicted from the
    torques.

    The difference in the last step does not tell when a command begins to turn the robot: a scrub of 0.03 N m
    was ten times too large in the first step.
    """
    pull_left = drive_left - damp_left * s.speed_left - damp_both * s.speed_right
    pull_right = drive_right - damp_right * s.speed_right - damp_both * s.speed_left
    pull_left = rubbed(s.speed_left, pull_left, left)
    pull_right = rubbed(s.speed_right, pull_right, right)
    per_torque = 0.5 * h / (p.inertia_own - p.inertia_other)
    free = abs(s.speed_right - s.speed_left + per_torque * (pull_right - pull_left))
    taken = per_torque * 2.0 * p.scrub
    return free - taken if free > taken else 0.0


def rubbed(speed: float, pull: float, rubbing: Rubbing) -> float:
    """Torque on a wheel, N m, less dry friction, which opposes its motion; at rest it cancels what it can
    bear."""
    left = pull - (rubbing.forward if speed > 0.0 else -rubbing.backward)
    return left if speed != 0.0 else freed(pull, rubbing.forward, rubbing.backward)


def moved(
    s: State, p: Plant, u: Command, c: Circuit, left: float, right: float, grip_left: float,
    grip_right: float, h: float, per_h: float,
) -> State:  # fmt: skip
    """The state after a step to the wheel speeds `left` and `right`: pose, wheels, battery and windings."""
    way_left, rim_left, play_left, wheel_left, rolling_left, cos_left, sin_left = rolled(
        s.speed_left, left, s.play_left, s.wheel_left, s.rolling_left, p.half_play_left, p.coasting_left,
        p.slip_left, p.kick_left, s.wheel_cos_left, s.wheel_sin_left, p.radius_left, p.runout_cos_left,
        p.runout_sin_left, h, per_h,
    )  # fmt: skip
    way_right, rim_right, play_right, wheel_right, rolling_right, cos_right, sin_right = rolled(
        s.speed_right, right, s.play_right, s.wheel_right, s.rolling_right, p.half_play_right,
        p.coasting_right, p.slip_right, p.kick_right, s.wheel_cos_right, s.wheel_sin_right, p.radius_right,
        p.runout_cos_right, p.runout_sin_right, h, per_h,
    )  # fmt: skip
    angle = (way_right - way_left) * p.per_track
    heading_cos, heading_sin = rotated(s.heading_cos, s.heading_sin, angle)
    # The chord of an arc is way * sin(a/2) / (a/2), along the middle heading, whose cosine is
    # (cos + cos') / (2 cos(a/2)): together way * (cos + cos') / 2 * tan(a/2) / (a/2).
    chord = 0.25 * (way_left + way_right) * (1.0 + angle * angle * (1.0 / 12.0))

    # Currents in the middle of the step feed heat and charge; the voltage at its end is what a reading finds.
    middle_left = 0.5 * (s.speed_left + left)
    middle_right = 0.5 * (s.speed_right + right)
    bus = c.source + c.sag * (c.pull_left * middle_left + c.pull_right * middle_right)
    current_left = c.wire_left * (u.left * bus - p.back_emf_left * middle_left) + c.held_left
    current_right = c.wire_right * (u.right * bus - p.back_emf_right * middle_right) + c.held_right
    drawn = u.left * current_left + u.right * current_right
    drawn += p.whole * (abs(current_left) + abs(current_right) - drawn)  # chain: whole
    yaw_rate = (rim_right - rim_left) * p.per_track
    followed = yaw_rate
    followed = passed(s, p, yaw_rate, h, per_h)  # effect: imu.low_pass
    looks = 1.0 + (u.to_go - p.gyro_lag) * per_h  # where in the step, if in this one
    looks = looks if looks <= 1.0 else 0.0
    return State(
        s.time + h, left, right,
        slope_of(s.speed_left, left, per_h), slope_of(s.speed_right, right, per_h),
        play_left, play_right, wheel_left, wheel_right, rolling_left, rolling_right,
        0.5 * (rim_left + rim_right), yaw_rate,
        followed, sampled(s.gyro_followed, followed, looks, s.gyro_rate),
        cos_left, sin_left, cos_right, sin_right,
        s.x + chord * (s.heading_cos + heading_cos), s.y + chord * (s.heading_sin + heading_sin),
        s.heading + angle, heading_cos, heading_sin,
        warmed(s.heat_left, current_left, h * p.heating_rate_left),
        warmed(s.heat_right, current_right, h * p.heating_rate_right),
        s.charge + h * drawn, current_left, current_right,
        c.source + c.sag * (c.pull_left * left + c.pull_right * right),
        grip_left, grip_right,
        *sampled_both(s, left, right, u.sample_left, u.sample_right),
        s.recent_left, s.recent_right, s.older_left, s.older_right, s.filtered_left, s.filtered_right,
        s.bemf_left, s.bemf_right, s.position_left, s.position_right, s.battery,
    )  # fmt: skip


def slope_of(before: float, after: float, per_h: float) -> float:
    """Acceleration expected to continue, rad/s2; 0 for a wheel that stopped within the step."""
    return (after - before) * per_h if after != 0.0 else 0.0


def rolled(
    before: float, after: float, play: float, wheel: float, rolling: float, half_play: float, coasting: float,
    slip: float, kick: float, cosine: float, sine: float, radius: float, runout_cos: float,
    runout_sin: float, h: float, per_h: float,
) -> tuple[float, float, float, float, float, float, float]:  # fmt: skip
    """One wheel after a step: way (m), rim speed (m/s), play (rad), speed behind the gear and rolling speed
    (rad/s), cosine and sine of its angle."""
    turn = 0.5 * h * (before + after)
    # Between the teeth a wheel rolls on alone. `free`: the part of the step in which it does.
    stays = staying(coasting, h)
    alone = wheel * stays
    ahead = turn - coasting * (1.0 - stays) * wheel
    taken = 0.0
    free = 0.0
    taken = slack(play, ahead, after - alone, half_play, h, per_h) - play  # effect: drive.backlash
    free = (
        1.0 if abs(play + taken) < half_play else taken / (ahead if ahead != 0.0 else 1.0)
    )  # effect: drive.backlash
    turn -= taken
    cosine, sine = rotated(cosine, sine, turn)
    behind = after
    behind += free * (alone - after)  # effect: drive.backlash
    follows = behind
    follows = lagging(rolling, wheel, behind, slip, h, per_h)  # effect: drive.wheel_slip
    turn -= slip * (follows - rolling)  # effect: drive.wheel_slip
    rim = follows
    rim -= kick * (behind - wheel) * per_h  # effect: drive.wheel_slip
    turn -= kick * (behind - wheel)  # effect: drive.wheel_slip
    radius *= 1.0 + runout_cos * cosine + runout_sin * sine  # effect: drive.wheel_eccentricity
    return radius * turn, radius * rim, play + taken, behind, follows, cosine, sine


def warmed(heat: float, current: float, share: float) -> float:
    """Squared current, A2, after the winding's first-order thermal lag. share: step over time constant."""
    return heat + share * (1.0 - 0.5 * share) * (current * current - heat)


def passed(s: State, p: Plant, yaw_rate: float, h: float, per_h: float) -> float:
    """A first-order low-pass of the yaw rate, which changes linearly from `s.yaw_rate` to `yaw_rate` in the
    step; without a time constant the yaw rate itself.

    Exact except for the exponential, for which four terms of its series suffice: no step is longer than two
    time constants.
    """
    x = h * p.low_pass_rate
    stays = 1.0 - x * (1.0 - x * (1.0 / 2.0 - x * (1.0 / 6.0 - x * (1.0 / 24.0))))
    return trailing(s.gyro_followed, s.yaw_rate, yaw_rate, p.low_pass, stays, per_h)


def sampled_both(
    s: State, left: float, right: float, place_left: float, place_right: float
) -> tuple[float, float]:
    """Last sampled speeds of both wheels, rad/s, after a step to `left` and `right`."""
    return (
        sampled(s.speed_left, left, place_left, s.sampled_left),
        sampled(s.speed_right, right, place_right, s.sampled_right),
    )


def sampled(before: float, after: float, place: float, last: float) -> float:
    """Speed at `place` of a step (1 is its end); the last sample if the step contains none (place 0 or
    less)."""
    return after - (1.0 - place) * (after - before) if place > 0.0 else last
