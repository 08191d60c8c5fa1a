"""The Wombat as a port: one complete command up and one checked frame down, every cycle."""

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
"""Longer than a control pass of either firmware."""
LOOKS_AFTER_PAUSE = 3
"""More of them than lie between two updates of the counters: the first look after a pause shows the way, the
next update how fast the motors are now."""


class Guard(Protocol):
    """Somebody who stops the motors when this program no longer can (`supervisor.Supervisor`)."""

    def beat(self) -> None:
        """The program is alive."""
        ...

    def hold(self, frame: bytes) -> None:
        """What is sent from now on where the program is alive and says nothing."""
        ...

    def close(self, *, stopped: bool = True) -> None:
        """The program ends; it has stopped the motors itself, or not."""
        ...


class WombatPort:
    """A KIPR Wombat with the stock firmware or RaccoonOS 17 or 21, whichever answers.

    link: the bus, or an emulator. rate_hz: cycles a second, 20 to 500. dialect: the firmware, probed where
    not given. guard: stops the motors if this program dies. reset_line: restarts a controller that no longer
    obeys. watch_analog: ports whose saturation is a fault. resting_bemf: counts of each motor at standstill
    that are known, and so no fault.

    Every frame carries the complete command, so a lost one costs a cycle; every frame is checked, and what is
    wrong with a cycle stands in `Inputs.faults`. What cannot be used is None there. Raises HardwareError
    where the controller is lost or does not obey, after having done what it could to stop the motors.
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
        """Who stands beside an emulated one."""
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
        """Whether cycles come by the wall's clock; an emulator's may be stepped."""
        return isinstance(self._clock, RealClock)

    @property
    def rates(self) -> Rates:
        """Measured rates of cycle, counters and IMU."""
        return self._monitor.rates

    @property
    def fault_counts(self) -> dict[Fault, int]:
        """Cycles in which each fault was seen."""
        return dict(self._monitor.fault_counts)

    @property
    def standstill_bemf(self) -> tuple[float, ...]:
        """Mean back-EMF counts of each motor while nothing drove it: the offset of its conversion."""
        return self._monitor.standstill_bemf

    def read(self) -> Inputs:
        """Wait for the next cycle and return it.

        Raises HardwareError where the controller is lost, with the motors stopped where that was possible.
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
        """Command motors and servos; in force until the next write, and sent again with every cycle."""
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
        """Stop the motors, switch the servos off, let go of the bus. May be called twice.

        Raises HardwareError where the motors could not be stopped and nothing else has told so before.
        """
        if self._let_go:
            return
        self._closed = True
        stopped = False
        try:
            try:
                stopped = self._stop(trust_registers=not self._monitor.frozen)
            except BaseException:  # Ctrl-C once more: not before the motors stand
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
        """See `raccoon.core.fork_ownership`: a forked process that ends stops no motors of its parent."""
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
        """Stop what can be stopped; the port is of no use from here on."""
        self._outputs = STOP
        self._failure = str(error)
        with suppress(HardwareError):
            self._hold(self.dialect.stop())
        if not self._stop(trust_registers=not self._monitor.frozen):
            self._failure += "; the motors may still run: switch the Wombat off"
        error.args = (self._failure,)

    def _stop(self, *, trust_registers: bool) -> bool:
        """Send the stop until the controller shows it, or restart the controller. True where either worked.

        A controller whose main loop hangs takes the stop into its registers and drives on: then only the
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
    """The Wombat this program runs on, with its supervisor.

    kind: "wombat" for the stock firmware, "wombat-raccoon" for RaccoonOS, as in robot.toml. Calibrated ticks
    differ between the two, so the other one is refused. bemf_rate_hz: measured updates of the counters a
    second (`WombatPort.rates`), where it is not the usual one. watch_analog, resting_bemf: see `WombatPort`.
    Raises HardwareError where the bus is missing, owned by another program, or answers otherwise.
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
                " calibrate again, for its position ticks are others"
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
