"""Conversion of valid frames into `Inputs`: adds the faults of a cycle and leaves out unusable words."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Sequence
from dataclasses import dataclass

from raccoon.core.errors import HardwareError
from raccoon.core.readings import ANALOG_BOTTOM, ANALOG_TOP, MOTOR_PORTS, Fault, Inputs, Words
from raccoon.hal.wombat.checks.battery_watch import BatteryWatch
from raccoon.hal.wombat.checks.health import ImuWatch, LifeWatch, Liveness, MotorWatch, RestWatch
from raccoon.hal.wombat.checks.repeat_watch import RepeatWatch
from raccoon.hal.wombat.firmware.counters import Bemf
from raccoon.hal.wombat.firmware.dialect import Dialect, Reading

NO_WORDS: Words = (None,) * 4
MAX_RESTING_BEMF = 15.0
"""Counts of back-EMF, without its offset, from which a robot is not at rest."""
LATE_CYCLES = 1.5
"""A cycle that takes more periods than this is late."""
MISSING_SECONDS = 0.05
"""s for which words that no IMU sends (all bytes equal) are tolerated: it may still be starting."""
ANALOG_SETTLING = 0.1
"""s after a restart during which analog words still rise from 0: the stock filter moves by a tenth of the
difference at each step."""
IMU_SHORTEST, IMU_LONGEST, IMU_PATIENCE = 0.06, 3.0, 5.0
"""Bounds on the time without new IMU words, s, s, and its usual limit in mean intervals (see `Liveness`)."""


@dataclass(frozen=True, slots=True)
class Rates:
    """Measured rates in Hz; None if there is not enough data.

    cycle: of this port. bemf: updates of the position counters. imu: new IMU words. expected_bemf: the `bemf`
    that the conversion of ticks assumes; None if the ticks do not depend on it.
    """

    cycle: float | None
    bemf: float | None
    imu: float | None
    expected_bemf: float | None = None


class Monitor:
    """Checks the words of every cycle.

    period: s of a cycle. watch_analog: analog ports to check for saturation. resting_bemf: calibrated
    back-EMF of each motor at standstill, counts; 0 if not calibrated.
    """

    def __init__(
        self,
        dialect: Dialect,
        period: float,
        watch_analog: Collection[int] = (),
        resting_bemf: Sequence[float] = (0.0,) * MOTOR_PORTS,
    ) -> None:
        self._dialect = dialect
        self._period = period
        self._watch_analog = tuple(watch_analog)
        self._life = LifeWatch()
        self._imu = Liveness(IMU_SHORTEST, IMU_LONGEST, IMU_PATIENCE)
        self._imu_watch = ImuWatch()
        self._motors, self._repeats = MotorWatch(), RepeatWatch(dialect.device.bemf_range)
        self._rest = RestWatch(resting_bemf)
        self._resting_bemf = tuple(resting_bemf)
        self._battery = BatteryWatch(dialect.battery_held * dialect.device.battery_volts)
        self._bemf: Sequence[float] = (0.0,) * 4
        self._first: float | None = None
        self._time = 0.0
        self._cycles = 0
        self._stuck = (False,) * MOTOR_PORTS
        self._analog_from = -math.inf
        self.frozen = False
        self.fault_counts: Counter[Fault] = Counter()

    @property
    def rates(self) -> Rates:
        """The rates measured so far."""
        elapsed = self._time - (self._first or 0.0)
        cycle = self._cycles / elapsed if self._cycles > 0 and elapsed > 0.0 else None
        return Rates(cycle, self._dialect.bemf_rate_hz, self._imu.rate_hz, self._dialect.expected_rate_hz)

    @property
    def standstill_bemf(self) -> tuple[float, ...]:
        """Smoothed back-EMF of each motor at its latest rest, counts."""
        return tuple(self._rest.offset)

    def inputs(
        self,
        reading: Reading | None,
        time: float,
        position: Words,
        bemf: Bemf | None,
        faults: list[Fault],
        duties: Sequence[float],
    ) -> Inputs:
        """The `Inputs` of the cycle at `time`, s. reading: None if no usable frame came. faults: those found
        so far; extended here. duties: those that drove the motors until now.

        Raises HardwareError if the controller's main loop hangs.
        """
        self._count_cycle(time, faults)
        if Fault.RESET in faults:
            self._analog_from = time + ANALOG_SETTLING
        if reading is None:
            return self._close(Inputs(time, self._dialect.device, faults=self._named(faults)))
        if self._are_stale(reading, time, duties, faults):
            position, bemf = NO_WORDS, None
        else:
            self._check_counters(bemf, time, faults)
        if bemf is not None:
            # A reading of 0 is rest whatever the offset: a dead zone hides it.
            self._bemf = [each and each - rest for each, rest in zip(bemf, self._resting_bemf, strict=True)]
            self._watch_motors(bemf, time, duties, faults)
        self._watch_board(reading, time, faults)
        fresh, analog = self._is_imu_fresh(reading, time, faults), time >= self._analog_from
        position, words = self._counting_motors(position), self._counting_motors(bemf or NO_WORDS)
        inputs = self._dialect.inputs(reading, time, position, words, self._named(faults), fresh, analog)
        if fresh:
            self._judge_imu(inputs)
        if self._imu_watch.is_distrusted(time):
            faults.append(Fault.IMU_IMPLAUSIBLE)
            inputs = self._dialect.inputs(reading, time, position, words, self._named(faults), False, analog)
        return self._close(inputs)

    def _count_cycle(self, time: float, faults: list[Fault]) -> None:
        if self._first is None:
            self._first = time
        else:
            self._cycles += 1
            if time - self._time > LATE_CYCLES * self._period:
                faults.append(Fault.OVERRUN)
        self._time = time

    def _are_stale(self, reading: Reading, time: float, duties: Sequence[float], faults: list[Fault]) -> bool:
        """Whether positions and back-EMF are old although they look new."""
        life = self._life
        life.update(self._dialect.life_words(reading.reply), time, self._bemf, duties)
        if life.is_stale:
            faults.append(Fault.STALE)
        if life.has_hung:
            self.frozen = True
            raise HardwareError(
                f"{Fault.STALE}: the controller has repeated itself for {life.silence:.2f} s: its main loop"
                " hangs or its link has stopped; only a reset or the power switch helps"
            )
        return life.is_stale

    def _counting_motors(self, words: Words) -> Words:
        """The words of each motor; None for one whose counter is stuck."""
        stuck = self._stuck
        if not any(stuck):
            return words
        return tuple(None if still else word for still, word in zip(stuck, words, strict=True))

    def _check_counters(self, bemf: Bemf | None, time: float, faults: list[Fault]) -> None:
        """Find the counters that do not count, or whose back-EMF is frozen. When one counts again, the
        distance in between is missing, so that is a position jump."""
        before, self._stuck = self._stuck, self._dialect.stuck_counters
        if any(self._stuck):
            faults.append(Fault.BEMF_INVALID)
        if bemf is not None:
            self._repeats.update(bemf, time)
        frozen = self._repeats.frozen
        if any(frozen):
            faults.append(Fault.BEMF_FROZEN)
            self._stuck = tuple(a or b for a, b in zip(self._stuck, frozen, strict=True))
        if any(was and not still for was, still in zip(before, self._stuck, strict=True)):
            faults.append(Fault.POSITION_JUMP)

    def _watch_motors(self, bemf: Bemf, time: float, duties: Sequence[float], faults: list[Fault]) -> None:
        words: Sequence[float] = bemf
        frozen = self._repeats.frozen
        if any(frozen):  # such a motor must look neither stalled nor moving at rest: its state is unknown
            duties = [0.0 if dead else duty for dead, duty in zip(frozen, duties, strict=True)]
            resting = self._resting_bemf
            words = [r if dead else each for dead, each, r in zip(frozen, bemf, resting, strict=True)]
        if self._motors.update(duties, words, time):
            faults.append(Fault.MOTOR_FAULT)
        if self._rest.update(duties, words, time):
            faults.append(Fault.BEMF_INVALID)

    def _watch_board(self, reading: Reading, time: float, faults: list[Fault]) -> None:
        if self._battery.update(reading.battery * self._dialect.device.battery_volts, time):
            faults.append(Fault.BROWN_OUT)
        first = self._dialect.first_analog
        for port in self._watch_analog if time >= self._analog_from else ():
            if not ANALOG_BOTTOM < reading.words[first + port] < ANALOG_TOP:
                faults.append(Fault.ANALOG_SATURATED)

    def _is_imu_fresh(self, reading: Reading, time: float, faults: list[Fault]) -> bool:
        words = self._dialect.imu_words(reading.reply)
        frozen = self._imu.update(words, time)
        missing = words == words[:1] * len(words)
        if frozen or (missing and self._imu.age > MISSING_SECONDS):
            faults.append(Fault.IMU_FROZEN)
        return self._imu.fresh and not (frozen or missing)

    def _judge_imu(self, inputs: Inputs) -> None:
        if inputs.gyro is None or inputs.accel is None:
            return
        scale, force = inputs.device.gyro_rad_s, inputs.device.accel_m_s2
        x, y, z = inputs.gyro
        a, b, c = inputs.accel
        at_rest = self._rest.is_resting(inputs.time) and max(map(abs, self._bemf)) < MAX_RESTING_BEMF
        self._imu_watch.update(
            (scale * x, scale * y, scale * z), (force * a, force * b, force * c), at_rest, inputs.time
        )

    @staticmethod
    def _named(faults: list[Fault]) -> tuple[Fault, ...]:
        return tuple(dict.fromkeys(faults)) if faults else ()

    def _close(self, inputs: Inputs) -> Inputs:
        for fault in inputs.faults:
            self.fault_counts[fault] += 1
        return inputs
