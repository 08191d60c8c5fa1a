"""The controller's cycle: what it makes of commands and samples. A part of the plant's source text (see
equations)."""

from __future__ import annotations

from raccoon.sim.plant.quantities import Plant, State
from raccoon.sim.plant.series import decay, middle_of


def duty_at_motor(duty: float, deadband: float, lost: float, stretched: float) -> float:
    """Share of the battery voltage that the motor receives for a duty: 0 up to the deadband. Beyond it, the
    deadband is subtracted (lost 1) or not (lost 0), and the result is stretched so that duty 1 gives 1
    (stretched 1) or not (0)."""
    size = abs(duty)
    size = (size - deadband * lost if size > deadband else 0.0) / (
        1.0 - deadband * stretched
    )  # effect: actuation.deadband
    return size if duty >= 0.0 else -size


def filtered(raw: float, recent: float, older: float, before: float, keep: float, median: float) -> float:
    """The controller's back-EMF filter, counts: a median of three (if median is 1), then exponential. recent,
    older: the raw samples before. before: the last filtered value. keep: the share of it that remains."""
    return before * keep + (1.0 - keep) * (raw + median * (middle_of(raw, recent, older) - raw))


def reported(counts: float, dead_zone: float) -> float:
    """Filtered counts as the controller reports them: 0 within the dead zone."""
    counts *= 1.0 if abs(counts) > dead_zone else 0.0  # effect: bemf.dead_zone
    return counts


def period_of(dt: float, cycle: float) -> float:
    """Time that a cycle counts for in the controller's filters, s. dt: its length by time stamps, s. cycle:
    nominal, s.

    The firmware mixes in a fixed share of each sample, whenever it arrives: a cycle that differs from nominal
    by up to a quarter has a time stamp with jitter. Other lengths are rows of another rate; they are rounded
    to whole 2^-40 s (1 ps), so that rounding of the clock does not produce a different period.
    """
    other = int(dt * 1099511627776.0 + 0.5) * (1.0 / 1099511627776.0)
    return cycle if abs(dt - cycle) < 0.25 * cycle else other


def kept_shares(p: Plant, dt: float) -> tuple[float, float, float]:
    """Shares of their values that the filters of left back-EMF, right back-EMF and battery keep over `dt`
    seconds."""
    return decay(dt * p.filter_rate_left), decay(dt * p.filter_rate_right), decay(dt * p.battery_rate)


def battery_word(reading: float, voltage: float, keep: float, held: float) -> float:
    """The battery's filtered reading one cycle later, V. reading, voltage: reading before, and the true
    voltage, V.

    keep: share of the reading that the filter keeps. held: V by which the voltage may exceed the reading
    before that rises: 14 counts for a filter that mixes in a share of 0.05 and truncates fractions of a
    count. Truncation loses half a count per cycle on average, so the reading falls as if the voltage were 10
    counts lower, though not below the true one.
    """
    rising = reading * keep + (1.0 - keep) * max(reading, voltage - held)
    falling = max(voltage, reading * keep + (1.0 - keep) * (voltage - 0.7 * held))
    return rising if voltage > reading else falling


def dipped(speed: float, dip: float) -> float:
    """Speed of a wheel at the end of a coasting pause, rad/s: reduced by `dip`; a wheel not faster than this
    is unchanged."""
    return speed - dip if abs(speed) > abs(dip) else speed


def sensed(
    s: State, p: Plant, dt: float, keeps: tuple[float, float, float], noise_left: float, noise_right: float
) -> State:
    """The state after a controller cycle: back-EMF words, counters and battery word from the samples.

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
