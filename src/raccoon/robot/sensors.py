"""A tophat as a program sees it: darkness, black or white, from a calibration."""

from __future__ import annotations

from typing import TYPE_CHECKING

from raccoon.core.errors import CalibrationError
from raccoon.core.readings import Inputs, Status

if TYPE_CHECKING:
    from raccoon.core.config import TophatConfig
    from raccoon.estimate.tophat import Tophat, TophatCalibration, TophatReading
    from raccoon.estimate.tophat.classifier import Edge


class TophatSensor:
    """One named tophat of robot.toml."""

    def __init__(self, name: str, config: TophatConfig) -> None:
        self.name = name
        self.config = config
        self.counts: float | None = None
        """The last ADC reading, None before the first."""
        self.calibration: TophatCalibration | None = None
        self._classifier: Tophat | None = None
        self._reading: TophatReading | None = None
        self._edge: Edge | None = None

    def calibrate(self, calibration: TophatCalibration) -> None:
        """Use a calibration from now on. Raises CalibrationError where it has no threshold."""
        from raccoon.estimate.tophat import Tophat

        if calibration.threshold is None:
            raise CalibrationError(f"tophat {self.name}: verdict {calibration.verdict}: no threshold to use")
        self.calibration = calibration
        self._classifier = Tophat(calibration)
        self._reading = None

    def update(self, inputs: Inputs) -> None:
        """Take the reading of this cycle."""
        counts = inputs.analog[self.config.analog]
        if counts is None:
            return
        self.counts = counts
        if self._classifier is not None:
            self._reading = self._classifier.update(inputs.time, counts)
            if self._reading.edge is not None:
                self._edge = self._reading.edge

    def require(self) -> None:
        """Raise CalibrationError unless there is a calibration."""
        if self.calibration is None:
            raise CalibrationError(
                f"tophat {self.name} is not calibrated: run calibrate_tophats() or load a stored set first"
            )

    @property
    def black(self) -> bool | None:
        """True over black, False over white, None while it is not known."""
        return None if self._reading is None else self._reading.black

    @property
    def darkness(self) -> float | None:
        """Probability of black, 0..1; None while it is not known."""
        return None if self._reading is None else self._reading.darkness

    @property
    def coverage(self) -> float | None:
        """Share of the sensor's spot that lies on black, 0..1; linear in the way across an edge."""
        return None if self._reading is None else self._reading.coverage

    @property
    def edge(self) -> Edge | None:
        """The last border between white and black that it crossed since `forget_edge`, None before one."""
        return self._edge

    def forget_edge(self) -> None:
        """Wait for a new edge."""
        self._edge = None

    def follow_light(self, on: bool) -> None:
        """Whether the calibration follows the light; off while the sensor is kept on an edge."""
        if self._classifier is not None:
            self._classifier.adapt = on

    @property
    def status(self) -> Status:
        """How far `black` and `darkness` can be trusted."""
        return Status.INVALID if self._reading is None else self._reading.status
