"""A Create 2 as a port: motor 0 is its left wheel, motor 1 its right one."""

from __future__ import annotations

import atexit
import math
from typing import Protocol

from raccoon.core.clock import Clock, RealClock
from raccoon.core.config import MotorModel
from raccoon.core.errors import ConfigError, HardwareError
from raccoon.core.fork_ownership import leave_in_forks
from raccoon.core.readings import (
    ANALOG_PORTS,
    BEMF_VOLTS_PER_COUNT,
    DIGITAL_PORTS,
    MOTOR_PORTS,
    Device,
    Fault,
    Inputs,
    Outputs,
)
from raccoon.hal.create import protocol
from raccoon.hal.create.counters import WheelCounter
from raccoon.hal.create.protocol import BAUD, Mode, Sensors, StreamDecoder
from raccoon.hal.serial_line import CHUNK_LIMIT, SerialLine

RADIANS_PER_TICK = 2.0 * math.pi / 508.8
"""Turn of a wheel in one encoder tick, rad (OI specification, packet 43)."""

CREATE_2 = Device(
    name="create-2",
    bemf_volts=BEMF_VOLTS_PER_COUNT,  # there is no back-EMF; the word is always None
    # An encoder does not measure volts. This value gives RADIANS_PER_TICK with the default K_E; with another
    # K_E robot.toml must set radians_per_tick = 0.012349.
    position_counts_seconds=RADIANS_PER_TICK * MotorModel().back_emf_constant.value / BEMF_VOLTS_PER_COUNT,
    gyro_rad_s=1.0,  # no IMU
    accel_m_s2=1.0,
    battery_volts=0.001,
    bemf_lag=0.0,  # encoders are not filtered
)
SERIAL_PORT = "/dev/ttyUSB0"
"""Device file of the first USB cable of a Create 2."""
CYCLE_TIMEOUT_S = 0.05
"""s without a frame after which a cycle without words is returned: a little more than three stream
periods."""
SILENCE_S = 0.5
"""s without a frame after which the interface is started again."""
PATIENCE_S = 5.0
"""s of reading without a frame after which the base is given up: time to plug the cable in again."""
MAX_READS_PER_CYCLE = 20
"""Reads in one cycle: more than enough for the 64 KiB that a cable's driver buffers."""
_ANALOG_REST = (None,) * (ANALOG_PORTS - 4)
_MOTOR_REST = (None,) * (MOTOR_PORTS - 2)


class Guard(Protocol):
    """Stops the wheels when this program no longer can (`raccoon.hal.supervise.supervisor.Supervisor`)."""

    def beat(self) -> None:
        """Signal that the program is alive."""
        ...

    def close(self, *, stopped: bool = True) -> None:
        """End the guard. stopped: whether the program has stopped the wheels itself."""
        ...


class CreatePort:
    """The base on a serial line; one cycle is one stream frame (15 ms).

    mode: FULL always obeys; SAFE stops by itself at a cliff, and a black line may look like one. speed: duty
    commands a share of 500 mm/s to the base's own speed controller instead of a share of the battery voltage.
    guard: stops the wheels if this program dies; the base has no watchdog.

    Words: `position` encoder ticks (0 left, 1 right); `analog` 0..3 the cliff signals from left to right,
    inverted (4095 - signal) so that black reads higher, as with a tophat; `digital` 0 bump left, 1 bump
    right, 2 wheel drop left, 3 wheel drop right, 4..7 cliffs from left to right, 8 clean button, 9 spot
    button; `battery` mV; `extra` battery.current (A, positive out of the battery), motor.0.current and
    motor.1.current (A).
    """

    def __init__(
        self,
        line: SerialLine,
        clock: Clock | None = None,
        *,
        mode: Mode = Mode.FULL,
        speed: bool = False,
        guard: Guard | None = None,
    ) -> None:
        self._line = line
        self._clock = clock or RealClock()
        self._mode = mode
        self._speed = speed
        self._guard = guard
        self._decoder = StreamDecoder()
        self._wheels = (WheelCounter(), WheelCounter())
        self._last_frame = self._clock.now()
        self._listened = 0.0  # s of reading since then, without pauses of the program
        self._closed = False
        self._start()

    @property
    def real_time(self) -> bool:
        """Whether cycles follow real time."""
        return isinstance(self._clock, RealClock)

    def read(self) -> Inputs:
        """The cycle of the next stream frame; after 50 ms of silence a cycle without words and with the fault
        LINK_DEAD.

        Raises HardwareError after 5 s of silence; pauses in which the program did not read do not count.
        """
        begin = self._clock.now()
        frames = self._next_frames()
        self._beat()
        now = self._clock.now()
        if not frames:
            self._listened += now - begin
            return self._silent_cycle(now)
        return self._cycle(frames, now)

    def write(self, outputs: Outputs) -> None:
        """Command the two wheels. Raises ConfigError for a duty on a motor port the base does not have."""
        for port, duty in enumerate(outputs.duty[2:], start=2):
            if duty != 0.0:
                raise ConfigError(f"duty of motor {port} is {duty}: a Create has the motors 0 and 1")
        self._line.write(self._command(outputs))
        self._beat()

    def leave(self) -> None:
        """See `raccoon.core.fork_ownership`: a forked process must not stop the wheels of its parent when it
        ends."""
        self._closed = True

    def close(self) -> None:
        """Stop the wheels and release the base. May be called twice."""
        if self._closed:
            return
        self._closed = True
        stopped = False
        try:
            stopped = self._line.write(protocol.release())
        finally:  # after Ctrl-C during the write, the guard stops the wheels
            self._line.close()
            if self._guard is not None:
                self._guard.close(stopped=stopped)

    def _beat(self) -> None:
        if self._guard is not None and not self._closed:
            self._guard.beat()

    def _command(self, outputs: Outputs) -> bytes:
        left, right = outputs.duty[:2]
        if self._speed:
            limit = protocol.SPEED_LIMIT_MM_S
            return protocol.drive_direct(round(left * limit), round(right * limit))
        if left == right == 0.0 and any(outputs.brake[:2]):
            return protocol.drive_direct(0, 0)  # the base's speed controller holds the wheels
        return protocol.drive_pwm(round(left * protocol.PWM_LIMIT), round(right * protocol.PWM_LIMIT))

    def _start(self) -> None:
        self._openings = self._line.openings
        self._mode_asked_at = self._last_start = self._clock.now()
        self._obeyed_at = False
        self._line.write(protocol.start(self._mode))

    def _next_frames(self) -> list[Sensors]:
        # The line's `select` waits in real time, so the number of waits is bounded as well: with a stepped
        # clock a trickle of garbage must not hold up the cycle.
        deadline = self._clock.now() + CYCLE_TIMEOUT_S
        frames: list[Sensors] = []
        for _ in range(MAX_READS_PER_CYCLE):
            data = self._line.read(max(deadline - self._clock.now(), 0.0))
            if self._line.openings != self._openings:
                self._start()
            frames += self._decoder.feed(data)
            # A full chunk comes from a pause in which nothing was read: the newest frame follows it.
            done = frames and len(data) < CHUNK_LIMIT
            if done or not data or self._clock.now() >= deadline:
                break
        return frames

    def _silent_cycle(self, now: float) -> Inputs:
        if self._listened > PATIENCE_S:
            raise HardwareError(
                f"Create on {self._line.path}: no sensor frame for {self._listened:.1f} s; check the cable, "
                "and press the clean button once to wake the base"
            )
        if now - self._last_frame > SILENCE_S and now - self._last_start > SILENCE_S:
            self._start()
        return Inputs(time=now, device=CREATE_2, faults=(Fault.LINK_DEAD,))

    def _cycle(self, frames: list[Sensors], now: float) -> Inputs:
        sensors = frames[-1]
        elapsed = now - self._last_frame
        self._last_frame, self._listened = now, 0.0
        faults = []
        if len(frames) > 1:
            faults.append(Fault.OVERRUN)
        jumps = [
            wheel.update(word, elapsed)
            for wheel, word in zip(self._wheels, (sensors.left_encoder, sensors.right_encoder), strict=True)
        ]
        faults += [fault for fault in jumps if fault is not None]
        if not self._check_obeying(sensors, now):
            faults.append(Fault.COMMAND_LOST)
        return _inputs(sensors, now, self._wheels, tuple(dict.fromkeys(faults)))

    def _check_obeying(self, sensors: Sensors, now: float) -> bool:
        """Whether the base is in the commanded mode; if not, the mode is commanded again.

        The base leaves SAFE by itself if a wheel drops or a cliff appears: the mode is not commanded while a
        wheel hangs, and never more often than every half second.
        """
        if sensors.mode == self._mode:
            self._obeyed_at = True
            return True
        if now - self._last_start > SILENCE_S and not sensors.wheel_dropped:
            self._last_start = now
            self._line.write(protocol.start(self._mode))
        return (
            not self._obeyed_at and now - self._mode_asked_at < SILENCE_S
        )  # the first frames may be older than the command


def _inputs(
    sensors: Sensors, now: float, wheels: tuple[WheelCounter, WheelCounter], faults: tuple[Fault, ...]
) -> Inputs:
    bits = sensors.bumps_and_wheel_drops
    return Inputs(
        time=now,
        device=CREATE_2,
        position=(wheels[0].position, wheels[1].position, *_MOTOR_REST),
        analog=(
            4095 - sensors.cliff_left_signal,
            4095 - sensors.cliff_front_left_signal,
            4095 - sensors.cliff_front_right_signal,
            4095 - sensors.cliff_right_signal,
            *_ANALOG_REST,
        ),
        digital=_digital(sensors, bits),
        battery=sensors.voltage_mv,
        faults=faults,
        extra={
            "battery.current": -sensors.current_ma / 1000.0,
            "motor.0.current": sensors.left_motor_ma / 1000.0,
            "motor.1.current": sensors.right_motor_ma / 1000.0,
        },
    )


def _digital(sensors: Sensors, bits: int) -> tuple[bool, ...]:
    flags = (
        bool(bits & 2),
        bool(bits & 1),
        bool(bits & 8),
        bool(bits & 4),
        bool(sensors.cliff_left),
        bool(sensors.cliff_front_left),
        bool(sensors.cliff_front_right),
        bool(sensors.cliff_right),
        bool(sensors.buttons & 1),
        bool(sensors.buttons & 2),
    )
    assert len(flags) == DIGITAL_PORTS
    return flags


def open_create(path: str = SERIAL_PORT, *, mode: Mode = Mode.FULL, speed: bool = False) -> CreatePort:
    """Open the Create 2 on a serial port; its wheels stop when the program ends, is killed or hangs.

    mode: FULL always obeys, SAFE stops at a cliff. speed: whether a duty of 1 is 500 mm/s, which the base
    controls, instead of full power. Raises HardwareError if the port is missing, forbidden or in use,
    ValueError for a mode in which no wheel obeys.
    """
    from raccoon.hal.supervise.supervisor import Supervisor

    clock = RealClock()
    line = SerialLine(path, BAUD, clock)
    try:
        guard = Supervisor(f"tty:{path}:{BAUD}", [protocol.stop()])
        try:
            port = CreatePort(line, clock, mode=mode, speed=speed, guard=guard)
        except BaseException:
            guard.close(stopped=False)
            raise
    except BaseException:
        line.close()
        raise
    atexit.register(port.close)
    leave_in_forks(port)
    return port
