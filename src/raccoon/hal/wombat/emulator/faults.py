"""Switches that break an emulated Wombat, one for each known failure of a real one."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(slots=True)
class Faults:
    """Switches, all off by default; they may be set while the robot drives.

    silent: the link returns only this byte (0x00 or 0xFF) and receives nothing. frozen: the main loop hangs,
    interrupts continue. wrong_version: commands of this library's version are not understood. overrun:
    RaccoonOS's transfer engine has stopped; only a reset starts it. torn_reads: number of frames with a
    position half old, half new. lost_writes: number of frames that do not reach the registers. latency:
    additional duration of every transfer, s. imu_frozen: the IMU repeats itself; imu_missing: it reads this
    on every axis; gyro_sweep: an old board's wandering gyro. floating, saturated: analog ports, saturated
    with the word that they read. stalled: motors held still by force, blown_fuse: motors without current.
    stopped_converters: motors whose back-EMF keeps its last conversion. bemf_offset: back-EMF of each motor
    at standstill, counts, with the sign of the wire. brown_out_voltage: V of the battery below which the
    controller restarts.
    """

    silent: int | None = None
    frozen: bool = False
    wrong_version: bool = False
    overrun: bool = False
    torn_reads: int = 0
    lost_writes: int = 0
    latency: float = 0.0
    imu_frozen: bool = False
    imu_missing: int | None = None
    gyro_sweep: bool = False
    floating: set[int] = field(default_factory=set)
    saturated: dict[int, int] = field(default_factory=dict)
    stalled: set[int] = field(default_factory=set)
    blown_fuse: set[int] = field(default_factory=set)
    stopped_converters: set[int] = field(default_factory=set)
    bemf_offset: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)
    brown_out_voltage: float = 0.0
