"""The quantities of the plant's equations: state, numbers of the robot, command of one step."""

from __future__ import annotations

from typing import NamedTuple


class State(NamedTuple):
    """State of one robot at one time. SI units; wheel quantities are positive forward; the pose is relative
    to the start pose."""

    time: float
    speed_left: float  # rad/s, motor side at the wheel shaft
    speed_right: float
    acceleration_left: float
    acceleration_right: float
    play_left: float  # rad, where the gear is in its backlash
    play_right: float
    wheel_left: float  # rad/s, behind the gear
    wheel_right: float
    rolling_left: float  # rad/s, of the floor under the wheel, which slips
    rolling_right: float
    forward_speed: float  # m/s, of the robot
    yaw_rate: float  # rad/s
    gyro_followed: float  # rad/s, the yaw rate as the gyro's low-pass follows it
    gyro_rate: float  # rad/s, that when the gyro last looked
    wheel_cos_left: float  # of the wheel's angle since the start
    wheel_sin_left: float
    wheel_cos_right: float
    wheel_sin_right: float
    x: float
    y: float
    heading: float
    heading_cos: float
    heading_sin: float
    heat_left: float  # A2, squared current as the winding's temperature follows it
    heat_right: float
    charge: float  # C, drawn from the battery
    current_left: float  # A, in the middle of the last step
    current_right: float
    bus: float  # V, at the drivers
    grip_left: float  # N m, of the bristles that hold a wheel before it slides
    grip_right: float
    sampled_left: float  # rad/s, when the controller last looked
    sampled_right: float
    recent_left: float  # counts, the last two raw samples
    recent_right: float
    older_left: float
    older_right: float
    filtered_left: float  # counts
    filtered_right: float
    bemf_left: float  # counts as reported
    bemf_right: float
    position_left: float  # counts * s
    position_right: float
    battery: float  # V as reported


class Plant(NamedTuple):
    """The numbers of one robot in the form that the equations use: SI units; back-EMF offsets and dead zones
    in counts."""

    open_circuit_voltage: float
    internal_resistance: float
    volts_per_coulomb: float
    resistance_left: float
    resistance_right: float
    back_emf_left: float
    back_emf_right: float
    heating_left: float
    heating_right: float
    heating_rate_left: float  # 1/s
    heating_rate_right: float
    limit_left: float
    limit_right: float
    coulomb_left: float
    coulomb_right: float
    viscous_left: float
    viscous_right: float
    stiction_left: float
    stiction_right: float
    stiction_rate_left: float  # s/rad
    stiction_rate_right: float
    load_left: float
    load_right: float
    asymmetry_left: float
    asymmetry_right: float
    viscous_asymmetry_left: float
    viscous_asymmetry_right: float
    quadratic_left: float
    quadratic_right: float
    compliance: float  # rad/(N m), 0: rigid
    grip_damping: float  # N m s/rad
    creep: float  # rad/s
    creep_tail: float
    break_away: float  # part of dry friction up to which bristles are elastic
    half_play_left: float
    half_play_right: float
    coasting_left: float  # s
    coasting_right: float
    slip_left: float  # s, by which the floor lags
    slip_right: float
    kick_left: float  # s, slip that follows the wheel's acceleration at once
    kick_right: float
    scrub: float
    radius_left: float
    radius_right: float
    runout_cos_left: float
    runout_cos_right: float
    runout_sin_left: float
    runout_sin_right: float
    per_track: float  # 1/m
    inertia_own: float  # kg m2: torque on a wheel for its own acceleration, and for the other wheel's
    inertia_other: float
    slope_x: float
    slope_y: float
    pushed_left: float  # N m at the wheel, forward, by what the robot touches
    pushed_right: float
    deadband_left: float
    deadband_right: float
    deadband_lost: float  # 1 where commands beyond a deadband lose it, 0: they give all that they say
    deadband_stretched: float  # 1 where a command of 1 gives all nonetheless
    latency: float
    closed_share: float
    counts_left: float  # counts a rad/s
    counts_right: float
    offset_left: float
    offset_right: float
    dead_zone_left: float
    dead_zone_right: float
    filter_rate_left: float  # 1/s
    filter_rate_right: float
    battery_rate: float
    battery_held: float  # V
    median: float
    dip_own: float  # rad/s a N m, by which a motor's own pause slows its wheel until it is sampled
    dip_other: float  # the same of the other wheel's
    gyro_lag: float  # s before the end of a row of commands, when the gyro looks
    low_pass: float  # s, time constant of the gyro's, 0: none
    low_pass_rate: float  # 1/s, of it
    whole: float  # 1 where the battery carries all of each motor's current, 0: the share that is its duty


PLANT_COLUMNS = {name: index for index, name in enumerate(Plant._fields)}
"""Column of each field of `Plant` in an array of robots; searching the field names takes far longer."""


class Command(NamedTuple):
    """Command of the drivers in one step, and whether the controller samples a motor in it.

    left, right: duty. closed: share of the step in which the motor is connected. sample: where in the step
    its back-EMF is sampled (1 is the end); 0 if it is not. to_go: s from the end of the step to the end of
    its row of commands.
    """

    left: float
    right: float
    closed_left: float
    closed_right: float
    sample_left: float
    sample_right: float
    to_go: float


class Circuit(NamedTuple):
    """Battery and windings in one step; currents are linear in the wheel speeds.

    source, sag: the voltage at the drivers is source + sag * (pull . speeds), in V and ohm. wire: conductance
    of a connected winding, 1/ohm, 0 while its current is at the limit. held: this limited current, A. pull:
    torque at the wheel shaft per volt at the drivers, N m/V; equally, current per unit of speed. current:
    expected in the middle of the step, A.
    """

    source: float
    sag: float
    wire_left: float
    wire_right: float
    held_left: float
    held_right: float
    pull_left: float
    pull_right: float
    current_left: float
    current_right: float


class Rubbing(NamedTuple):
    """Friction of one wheel: dry friction against forward and against backward motion, N m, and drag, N m
    s/rad."""

    forward: float
    backward: float
    drag: float
