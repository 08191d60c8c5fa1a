"""The Wombat as a port: sends one complete command and receives one checked frame in every cycle."""

from __future__ import annotations

import atexit
from collections.abc import Collection, Sequence
from contextlib import suppress
from types import TracebackType
from typing import Protocol, Self

from raccoon.core.clock import Clock, RealClock, Ticker
from raccoon.core.errors import ConfigError, HardwareError
from raccoon.core.fork_ownership import leave_in_forks
from raccoon.core.port import Bystander
from raccoon.core.readings import MOTOR_PORTS, STOP, Fault, Inputs, Outputs
from raccoon.core.sections import CYCLE_RATE
from raccoon.hal.wombat.checks.monitor import Monitor, Rates
from raccoon.hal.wombat.checks.receiver import Receiver
from raccoon.hal.wombat.firmware.dialect import Dialect
from raccoon.hal.wombat.link.link import Link, ResetLine
from raccoon.hal.wombat.link.spi import SPI_DEVICE, SpiLink
from raccoon.hal.wombat.probe import probe

KINDS = ("wombat", "wombat-raccoon")
STOP_ATTEMPTS = 10
STOP_PAUSE_SECONDS = 0.01
"""s between a stop and its check: longer than a control pass of either firmware."""
LOOKS_AFTER_PAUSE = 3
"""Extra readings after a pause, more than fit between two counter updates: the first shows the distance
moved, the next update the present speed."""


class Guard(Protocol):
    """Stops the motors when this program no longer can (`raccoon.hal.supervise.supervisor.Supervisor`)."""

    def beat(self) -> None:
        """Signal that the program is alive."""
        ...

    def hold(self, frame: bytes) -> None:
        """Set the frame that is sent if the program is alive but silent."""
        ...

    def close(self, *, stopped: bool = True) -> None:
        """End the guard. stopped: whether the program has stopped the motors itself."""
        ...


class WombatPort:
    """A KIPR Wombat with the stock firmware or RaccoonOS 17 or 21, whichever answers.

    link: the bus, or an emulator. rate_hz: cycles a second, 20 to 500. dialect: the firmware, probed if not
    given. guard: stops the motors if this program dies. reset_line: restarts a controller that no longer
    obeys. watch_analog: ports whose saturation is a fault. resting_bemf: known back-EMF of each motor at
    standstill, counts, which is no fault.

    Every frame carries the complete command, so a lost one costs a cycle. Every frame is checked:
    `Inputs.faults` names what is wrong with a cycle, and unusable words are None there. Raises HardwareError
    if the controller is lost or does not obey, after trying to stop the motors.
    """

    def __init__(
        self,
        link: Link,
        *,
        clock: Clock | None = None,
        rate_hz: float = 200.0,
        dialect: Dialect | None = None,
        guard: Guard | None = None,
        reset_line: ResetLine | None = None,
        watch_analog: Collection[int] = (),
        resting_bemf: Sequence[float] = (0.0,) * MOTOR_PORTS,
    ) -> None:
        _check_rate(rate_hz)
        self.bystander: Bystander | None = None
        """The simulated person beside an emulated Wombat."""
        self._clock = clock or RealClock()
        self._link = link
        self._guard = guard
        self._reset_line = reset_line
        self._closed = self._let_go = False
        self._failure: str | None = None
        self._outputs = STOP
        self.dialect = dialect or probe(link, self._clock)
        self._receiver = Receiver(self.dialect, link, self._clock)
        self._monitor = Monitor(self.dialect, 1.0 / rate_hz, watch_analog, resting_bemf)
        self._polls = self.dialect.polls_per_cycle(1.0 / rate_hz)
        self._ticker = Ticker(1.0 / (rate_hz * self._polls), self._clock)
        self._receiver.exchange(self.dialect.command(STOP))
        self._hold(self.dialect.hold(STOP))
        atexit.register(self.close)
        leave_in_forks(self)

    @property
    def real_time(self) -> bool:
        """Whether cycles follow real time; an emulator's clock may be stepped."""
        return isinstance(self._clock, RealClock)

    @property
    def rates(self) -> Rates:
        """Measured rates of cycle, counters and IMU."""
        return self._monitor.rates

    @property
    def fault_counts(self) -> dict[Fault, int]:
        """Number of cycles with each fault."""
        return dict(self._monitor.fault_counts)

    @property
    def standstill_bemf(self) -> tuple[float, ...]:
        """Mean back-EMF of each motor at rest, counts: the offset of its conversion."""
        return self._monitor.standstill_bemf

    def read(self) -> Inputs:
        """Wait for the next cycle and return it.

        Raises HardwareError if the controller is lost, with the motors stopped if that was possible.
        """
        self._require_open()
        receiver, reading = self._receiver, None
        receiver.begin_cycle()
        try:
            for look in range(self._polls + LOOKS_AFTER_PAUSE):
                if look >= self._polls and (reading is None or not self.dialect.is_averaged):
                    break
                self._ticker.wait()
                reading = receiver.poll(self.dialect.command(self._outputs))
                self._beat()
            words, time = (receiver.position, receiver.bemf), receiver.time
            return self._monitor.inputs(reading, time, *words, receiver.faults, self._outputs.duty)
        except HardwareError as error:
            self._fail(error)
            raise

    def write(self, outputs: Outputs) -> None:
        """Command motors and servos until the next write; the command is repeated in every cycle."""
        self._require_open()
        moved = outputs.servo_us != self._outputs.servo_us
        self._outputs = outputs
        try:
            if moved:
                self._hold(self.dialect.hold(outputs))
            self._receiver.exchange(self.dialect.command(outputs))
            self._beat()
        except HardwareError as error:
            self._fail(error)
            raise

    def close(self) -> None:
        """Stop the motors, switch the servos off and release the bus. May be called twice.

        Raises HardwareError if the motors could not be stopped and no earlier error has said so.
        """
        if self._let_go:
            return
        self._closed = True
        stopped = False
        try:
            try:
                stopped = self._stop(trust_registers=not self._monitor.frozen)
            except BaseException:  # a second Ctrl-C: first stop the motors
                stopped = self._stop(trust_registers=not self._monitor.frozen)
                raise
        finally:
            self._let_go = True
            atexit.unregister(self.close)
            if self._guard is not None:
                self._guard.close(stopped=stopped)
            self._link.close()
        if not stopped and self._failure is None:
            raise HardwareError(
                "the motors may still run: the controller did not confirm the stop; switch it off"
            )

    def leave(self) -> None:
        """See `raccoon.core.fork_ownership`: a forked process must not stop its parent's motors."""
        self._closed = self._let_go = True

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _beat(self) -> None:
        if self._guard is not None:
            self._guard.beat()

    def _hold(self, frame: bytes) -> None:
        if self._guard is not None:
            self._guard.hold(frame)

    def _require_open(self) -> None:
        if self._closed:
            raise HardwareError("the port is closed")
        if self._failure is not None:
            raise HardwareError(self._failure)

    def _fail(self, error: HardwareError) -> None:
        """Stop what can be stopped; the port is unusable from then on."""
        self._outputs = STOP
        self._failure = str(error)
        with suppress(HardwareError):
            self._hold(self.dialect.stop())
        if not self._stop(trust_registers=not self._monitor.frozen):
            self._failure += "; the motors may still run: switch the Wombat off"
        error.args = (self._failure,)

    def _stop(self, *, trust_registers: bool) -> bool:
        """Send the stop until it is confirmed, or restart the controller. True if either worked.

        A controller whose main loop hangs accepts the stop in its registers and drives on: then only the
        reset line helps.
        """
        if trust_registers and self._stop_by_frames():
            return True
        if self._reset_line is None:
            return False
        try:
            self._reset_line.pulse()
        except HardwareError:
            return False
        return True

    def _stop_by_frames(self) -> bool:
        frame = self.dialect.stop()
        for _ in range(STOP_ATTEMPTS):
            try:
                self._link.transfer(frame)
                self._clock.sleep_until(self._clock.now() + STOP_PAUSE_SECONDS)
                reply = self._link.transfer(frame)
                if self.dialect.is_aligned(reply):
                    if self.dialect.shows_stopped(reply):
                        return True
                else:
                    self.dialect.realign(self._link, reply)
            except HardwareError:
                continue
        return False


def _check_rate(rate_hz: float) -> None:
    if not CYCLE_RATE.allows(rate_hz):
        raise ConfigError(f"rate_hz is {rate_hz}: allowed are {CYCLE_RATE}")


def open_wombat(
    kind: str = "wombat",
    *,
    rate_hz: float = 200.0,
    device: str = SPI_DEVICE,
    bemf_rate_hz: float | None = None,
    watch_analog: Collection[int] = (),
    resting_bemf: Sequence[float] = (0.0,) * MOTOR_PORTS,
) -> WombatPort:
    """The Wombat on which this program runs, with its supervisor.

    kind: "wombat" for the stock firmware, "wombat-raccoon" for RaccoonOS, as in robot.toml. Calibrated ticks
    differ between the two, so the other one is refused. bemf_rate_hz: measured updates of the counters a
    second (`WombatPort.rates`), if not the usual one. watch_analog, resting_bemf: see `WombatPort`. Raises
    HardwareError if the bus is missing, owned by another program, or answers otherwise.
    """
    from raccoon.hal.supervise.supervisor import Supervisor
    from raccoon.hal.wombat.link.reset_line import GpioResetLine

    if kind not in KINDS:
        raise ConfigError(f"kind is {kind!r}: allowed are {', '.join(KINDS)}")
    _check_rate(rate_hz)
    link = SpiLink(device)
    try:
        clock = RealClock()
        dialect = probe(link, clock)
        found = "wombat" if dialect.name == "stock" else "wombat-raccoon"
        if found != kind:
            raise HardwareError(
                f"robot.toml says controller.port = {kind!r}, but {dialect.name} answers: write {found!r} and"
                " calibrate again, because its position ticks differ"
            )
        if bemf_rate_hz is not None:
            dialect = dialect.with_rate(bemf_rate_hz)
        guard = Supervisor(link.target, [dialect.stop()], keep=[link.lock.descriptor])
        try:
            return WombatPort(
                link,
                clock=clock,
                rate_hz=rate_hz,
                dialect=dialect,
                guard=guard,
                reset_line=GpioResetLine(),
                watch_analog=watch_analog,
                resting_bemf=resting_bemf,
            )
        except BaseException:
            guard.close(stopped=False)
            raise
    except BaseException:
        link.close()
        raise
