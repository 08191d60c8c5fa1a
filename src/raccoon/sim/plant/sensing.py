"""The controller's cycle, and what it makes of a command: part of the plant's one text (see equations)."""

from __future__ import annotations

from raccoon.sim.plant.quantities import Plant, State
from raccoon.sim.plant.series import decay, middle_of


def duty_at_motor(duty: float, deadband: float, lost: float, stretched: float) -> float:
    """Share of the battery voltage that a command gives: nothing up to the deadband. Beyond it that much is
    lost (1), or nothing (0), and what is left is stretched so that 1 gives all (1), or not (0)."""
    size = abs(duty)
    size = (size - deadband * lost if size > deadband else 0.0) / (
        1.0 - deadband * stretched
    )  # effect: actuation.deadband
    return size if duty >= 0.0 else -size


def filtered(raw: float, recent: float, older: float, before: float, keep: float, median: float) -> float:
    """The controller's back-EMF filter: median of three (where it has one), then exponential."""
    return before * keep + (1.0 - keep) * (raw + median * (middle_of(raw, recent, older) - raw))


def reported(counts: float, dead_zone: float) -> float:
    """Filtered counts as the controller reports them."""
    counts *= 1.0 if abs(counts) > dead_zone else 0.0  # effect: bemf.dead_zone
    return counts


def period_of(dt: float, cycle: float) -> float:
    """For how long a cycle counts in the controller's filters, s.

    The firmware mixes a fixed share of each sample in, whenever that comes: a cycle that is up to a quarter
    off is one whose time stamp jitters. Others are rows of another rate, in whole 2^-40 s (1 ps), so that
    rounding of the clock does not make it another period.
    """
    other = int(dt * 1099511627776.0 + 0.5) * (1.0 / 1099511627776.0)
    return cycle if abs(dt - cycle) < 0.25 * cycle else other


def kept_shares(p: Plant, dt: float) -> tuple[float, float, float]:
    """What the filters of left and right back-EMF and of the battery keep of their values in `dt` seconds."""
    return decay(dt * p.filter_rate_left), decay(dt * p.filter_rate_right), decay(dt * p.battery_rate)


def battery_word(reading: float, voltage: float, keep: float, held: float) -> float:
    """The battery's filtered word one cycle later.

    keep: share of it that the filter keeps. held: V that a voltage may be above it before it rises, 14 counts
    where fractions of a count are cut off after a share of 0.05 is mixed in. That loses half a count a cycle
    on average, so it falls as if the voltage were 10 counts further down, though not below the true one.
    """
    rising = reading * keep + (1.0 - keep) * max(reading, voltage - held)
    falling = max(voltage, reading * keep + (1.0 - keep) * (voltage - 0.7 * held))
    return rising if voltage > reading else falling


def dipped(speed: float, dip: float) -> float:
    """A wheel's speed at the end of a pause; one that stands does so in the pause."""
    return speed - dip if abs(speed) > abs(dip) else speed


def sensed(
    s: State, p: Plant, dt: float, keeps: tuple[float, float, float], noise_left: float, noise_right: float
) -> State:
    """The controller's cycle: back-EMF words, counters and battery word from what it sampled.

    dt: s since the last cycle. keeps: `kept_shares` of it. noise: counts on the raw samples.
    """
    torque_left = p.back_emf_left * s.current_left
    torque_right = p.back_emf_right * s.current_right
    looked_left = dipped(s.sampled_left, p.dip_own * torque_left + p.dip_other * torque_right)
    looked_right = dipped(s.sampled_right, p.dip_own * torque_right + p.dip_other * torque_left)
    raw_left = p.counts_left * looked_left + p.offset_left + noise_left
    raw_right = p.counts_right * looked_right + p.offset_right + noise_right
    keep_left, keep_right, keep = keeps
    filtered_left = filtered(raw_left, s.recent_left, s.older_left, s.filtered_left, keep_left, p.median)
    filtered_right = filtered(
        raw_right, s.recent_right, s.older_right, s.filtered_right, keep_right, p.median
    )
    bemf_left = reported(filtered_left, p.dead_zone_left)
    bemf_right = reported(filtered_right, p.dead_zone_right)
    return State(
        s.time, s.speed_left, s.speed_right, s.acceleration_left, s.acceleration_right,
        s.play_left, s.play_right, s.wheel_left, s.wheel_right, s.rolling_left, s.rolling_right,
        s.forward_speed, s.yaw_rate, s.gyro_followed, s.gyro_rate,
        s.wheel_cos_left, s.wheel_sin_left, s.wheel_cos_right, s.wheel_sin_right,
        s.x, s.y, s.heading, s.heading_cos, s.heading_sin,
        s.heat_left, s.heat_right, s.charge, s.current_left, s.current_right, s.bus,
        s.grip_left, s.grip_right,
        s.sampled_left, s.sampled_right, raw_left, raw_right, s.recent_left, s.recent_right,
        filtered_left, filtered_right, bemf_left, bemf_right,
        s.position_left + bemf_left * dt, s.position_right + bemf_right * dt,
        battery_word(s.battery, s.bus, keep, p.battery_held),
    )  # fmt: skip
