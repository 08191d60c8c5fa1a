"""Switches that break an emulated Wombat, one for each way a real one breaks."""

from __future__ import annotations

from dataclasses import dataclass, field


@dataclass(slots=True)
class Faults:
    """All off unless set. Switches may be thrown while the robot drives.

    silent: the link answers this byte alone (0x00 or 0xFF) and hears nothing. frozen: the main loop hangs,
    interrupts go on. wrong_version: commands of our version are not understood. overrun: RaccoonOS's transfer
    engine has stopped; only a reset starts it. torn_reads: so many frames come with a position half old,
    half new. lost_writes: so many frames do not get through to the registers. latency: seconds that every
    transfer takes longer. imu_frozen: repeats itself; imu_missing: reads this on every axis; gyro_sweep: an
    old board's wandering gyro. floating, saturated: analog ports. stalled: motors held still by force,
    blown_fuse: without current. stopped_converters: those whose back-EMF stays as it was converted last.
    bemf_offset: counts that the back-EMF of each motor reads at standstill, in the wire's own sign.
    brown_out_voltage: the controller restarts while the battery is below it.
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
