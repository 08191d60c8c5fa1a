"""Held-out errors with another factor on the simulated gyro."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from raccoon.diagnose.drives.features import bins_per_event
from raccoon.diagnose.findings.held_out import size_of
from raccoon.diagnose.result import ChannelResult, Curve, Diagnosis
from raccoon.trace.recording import median_step

GYRO_COLUMN = "imu.gyro.z"


@dataclass(frozen=True, slots=True)
class GyroRescaling:
    """Held-out readings, with functions of a factor on the simulated gyro."""

    results: tuple[ChannelResult, ...]
    curves: tuple[Curve, ...]

    @classmethod
    def of_diagnosis(cls, found: Diagnosis) -> GyroRescaling:
        """The held-out readings of a diagnosis."""
        names = {each.name for each in found.channels}
        return cls(found.channels, tuple(each for each in found.curves if each.name in names))

    def _gyro_index(self) -> int:
        return next(index for index, each in enumerate(self.results) if each.name == GYRO_COLUMN)

    def residual_size(self, factor: float, before: bool = False) -> float:
        """`size_of` the residual with a factor on the simulated gyro; without causes if `before`."""
        parts = [each.measured - (each.before if before else each.after) for each in self.curves]
        gyro = self.curves[self._gyro_index()]
        parts[self._gyro_index()] = gyro.measured - factor * (gyro.before if before else gyro.after)
        floor = np.array([each.noise_floor for each in self.results])
        event = bins_per_event(median_step(gyro.time))
        return size_of(np.nan_to_num(np.column_stack(parts)), floor, event)

    def reading_change(self, factor: float) -> float:
        """RMS change of the simulated gyro reading by a factor, in units of its noise."""
        index = self._gyro_index()
        moved = (1.0 - factor) * np.nan_to_num(self.curves[index].after)
        return float(np.sqrt((moved**2).mean())) / self.results[index].noise_floor

    def rescaled_channels(self, factor: float) -> tuple[ChannelResult, ...]:
        """The channels, with a factor on the simulated gyro in the error before any cause."""
        index = self._gyro_index()
        curve = self.curves[index]
        wrong = np.nan_to_num(curve.measured - factor * curve.before)
        changed = replace(self.results[index], rmse_before=float(np.sqrt((wrong**2).mean())))
        return (*self.results[:index], changed, *self.results[index + 1 :])

    def rescaled_curves(self, factor: float) -> tuple[Curve, ...]:
        """The curves, with a factor on the simulated gyro before any cause."""
        index = self._gyro_index()
        changed = replace(self.curves[index], before=factor * self.curves[index].before)
        return (*self.curves[:index], changed, *self.curves[index + 1 :])
