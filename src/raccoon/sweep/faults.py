"""Faults that begin at some time in a match, between the simulated robot and the program."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

from raccoon.core.port import Port, bystander_of
from raccoon.core.readings import Fault, Inputs, Outputs, Vector
from raccoon.hal.wombat.checks.repeat_watch import RepeatWatch

FAULT_KINDS: Mapping[str, str] = {
    "fault.imu_silent": "the IMU says nothing any more",
    "fault.imu_frozen": "the IMU repeats its last reading",
    "fault.bemf_frozen": "the motors' back-EMF and counters repeat their last readings",
    "fault.tophats_unplugged": "all tophats read the top of their range",
    "fault.motors_off": "the motors get no commands for half a second",
    "fault.lost_cycles": "every second cycle is lost for two seconds",
}
"""What each fault does from its beginning."""
OUTAGE_S, LOST_CYCLES_S = 0.5, 2.0
"""Duration (s) of an outage of the motors, and of lost cycles."""


@dataclass(frozen=True, slots=True)
class FaultPlan:
    """The faults of a match, and the times (s) at which they begin."""

    kinds: tuple[str, ...]
    begin: float


class FaultyPort:
    """Wraps a port; from `begin` on its faults act on readings and commands."""

    def __init__(self, port: Port, broken: FaultPlan) -> None:
        self._port = port
        self.bystander = bystander_of(port)
        self._broken = broken
        self._time = 0.0
        self._last: Inputs | None = None
        self._repeats = RepeatWatch()

    def read(self) -> Inputs:
        inputs = self._port.read()
        if self._is_active("fault.lost_cycles", LOST_CYCLES_S):
            inputs = self._port.read()
        self._time = inputs.time
        if self._time < self._broken.begin or self._last is None:
            self._last = _with_imu_held(inputs, self._last)
            return inputs
        return self._with_faults(inputs, self._last)

    def write(self, outputs: Outputs) -> None:
        self._port.write(Outputs() if self._is_active("fault.motors_off", OUTAGE_S) else outputs)

    def close(self) -> None:
        self._port.close()

    def _is_active(self, kind: str, lasting: float = float("inf")) -> bool:
        age = self._time - self._broken.begin
        return kind in self._broken.kinds and 0.0 <= age < lasting

    def _with_faults(self, inputs: Inputs, last: Inputs) -> Inputs:
        if self._is_active("fault.imu_frozen"):
            inputs = replace(
                inputs, gyro=_repeated(inputs.gyro, last.gyro), accel=_repeated(inputs.accel, last.accel)
            )
        if self._is_active("fault.imu_silent"):
            inputs = replace(inputs, gyro=None, accel=None)
        if self._is_active("fault.bemf_frozen"):
            inputs = self._with_frozen_bemf(inputs, last)
        if self._is_active("fault.tophats_unplugged"):
            full = inputs.device.analog_full_scale
            inputs = replace(inputs, analog=tuple(None if each is None else full for each in inputs.analog))
        return inputs

    def _with_frozen_bemf(self, inputs: Inputs, last: Inputs) -> Inputs:
        """Repeat the back-EMF of motors, and report it as a Wombat's port does once it is sure."""
        self._repeats.update([each or 0.0 for each in last.bemf], inputs.time)
        dead = self._repeats.frozen
        faults = (*inputs.faults, Fault.BEMF_FROZEN) if any(dead) else inputs.faults
        bemf, position = (
            tuple(None if gone else word for gone, word in zip(dead, words, strict=True))
            for words in (last.bemf, last.position)
        )
        return replace(inputs, bemf=bemf, position=position, faults=faults)


def _with_imu_held(inputs: Inputs, last: Inputs | None) -> Inputs:
    """The inputs with the last IMU reading if they have none: it is slower than most controllers."""
    if last is None:
        return inputs
    gyro = last.gyro if inputs.gyro is None else inputs.gyro
    return replace(inputs, gyro=gyro, accel=last.accel if inputs.accel is None else inputs.accel)


def _repeated(now: Vector | None, before: Vector | None) -> Vector | None:
    return None if now is None else before
