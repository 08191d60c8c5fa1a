"""Tophats as a program sees them: black or white, darkness, and what is odd about them."""

from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING

from raccoon.core.errors import CalibrationError
from raccoon.core.readings import ANALOG_BOTTOM, ANALOG_TOP, Inputs, Status
from raccoon.robot.name_hints import Part

if TYPE_CHECKING:
    from raccoon.core.config import TophatConfig
    from raccoon.estimate.tophat import Tophat, TophatCalibration, TophatReading
    from raccoon.estimate.tophat.calibration_watch import CalibrationWatch, Fit
    from raccoon.estimate.tophat.classifier import Edge
    from raccoon.estimate.tophat.tracker import LightTracker

PROVING_S = 5.0  # s of driving that prove a calibration; what changes after that is light, and followed
BLIND_AFTER_S = 0.1  # s without a floor; a flash of the sun takes less
SILENT_AFTER_S = 0.5  # s without a word; a controller that restarts gives none for 0.1 s
MOVING_WAY_M = 2e-4  # m a tick: 0.04 m/s at 200 Hz
STANDING_WAY_M = 2e-5  # m a tick, below which it stands
STANDING_READINGS, MIN_WANDERED = 80, 3
"""Number of readings at rest that are judged together; number of such judgements, wandering or not, that
decide."""


class TophatSensor(Part):
    """One named tophat of robot.toml."""

    called = "robot.tophat(name).black, or on_black(name) as a condition"
    offers = "black, coverage, counts and status"

    def __init__(self, name: str, config: TophatConfig) -> None:
        self.name = name
        self.config = config
        self.counts: float | None = None
        """The last ADC reading, None before the first."""
        self.calibration: TophatCalibration | None = None
        self.is_borrowed = False
        """Whether its calibration is another robot's: it says nothing about this sensor."""
        self.fit: Fit | None = None
        """Whether the calibration fits the readings of the last second; None while that is unknown."""
        self._classifier: Tophat | None = None
        self._watch: CalibrationWatch | None = None
        self._has_driven = False  # under power, with its calibration
        self._is_put_down = False  # and has been judged there, if it has not driven yet
        self._reading: TophatReading | None = None
        self._edge: Edge | None = None
        self._driven_s = 0.0  # s, for which it has read floors by this calibration
        self.is_judged = True
        """Whether its readings tell about its calibration: along a line, half on it, they do not."""
        self._heard: float | None = None  # s, of its last word, or since when there was none
        self._is_heard = False  # whether the last cycle had a word
        self._dt = 0.0  # s since the word before
        self.silent = False
        """Whether it has not been read for a while."""
        self.sees = False
        """Whether it has just read a floor, rather than an end of its range."""
        self._seen = -math.inf  # s, when it did so last
        self._standing: deque[float] = deque(maxlen=STANDING_READINGS)
        self._wandered = 0
        self.floating = False
        """Whether its reading wandered when the robot last stood, as that of an open port does, which may
        read like black."""

    def __repr__(self) -> str:
        seen = {True: "black", False: "white", None: "not calibrated or not known"}[self.black]
        return f"<tophat {self.name}: {self.counts} counts, {seen}, {self.status}>"

    def calibrate(self, calibration: TophatCalibration, *, borrowed: bool = False) -> None:
        """Use a calibration from now on. borrowed: it is another robot's. Raises CalibrationError without a
        threshold."""
        from raccoon.estimate.tophat import Tophat
        from raccoon.estimate.tophat.calibration_watch import CalibrationWatch

        if calibration.threshold is None:
            raise CalibrationError(
                f"tophat {self.name}: verdict {calibration.verdict}: the calibration has no threshold"
            )
        self.calibration, self.is_borrowed = calibration, borrowed
        self._classifier, self._watch = Tophat(calibration), CalibrationWatch(calibration)
        self._has_driven = self._is_put_down = False
        self._reading = self.fit = None
        self._driven_s = 0.0

    def take(
        self,
        inputs: Inputs,
        way: float | None = None,
        others_lost: bool | None = None,
        *,
        shaken: bool = False,
        driven: bool = True,
    ) -> LightTracker | None:
        """Take the reading of this cycle. Returns the tracker if it is in doubt and has a bank to run.

        way, others_lost: see `raccoon.estimate.tophat.Tophat.update`. shaken: whether something moves on the
        robot: a sensor half on a line may wander then although the robot stands. driven: whether the drive
        has power.
        """
        self._has_driven = self._has_driven or driven
        counts, classifier = inputs.analog[self.config.analog], self._classifier
        if classifier is not None:  # it goes on without a reading, too
            classifier.take(inputs.time, counts, others_lost, way)
        if counts is None:
            self._heard = inputs.time if self._heard is None else self._heard
            self._is_heard = False
            return None
        self._dt = inputs.time - self._heard if self._is_heard and self._heard is not None else 0.0
        self.counts, self._heard, self._is_heard = counts, inputs.time, True
        if way is not None and way < STANDING_WAY_M and not shaken:
            self._standing.append(counts)
        elif self._standing:
            self._standing.clear()
            self._is_put_down = False
        return classifier.levels if classifier is not None and classifier.levels.is_bank_due else None

    def _find_put_down(self) -> None:
        """Judge anew a sensor that has come to rest after it was moved by hand."""
        from raccoon.estimate.tophat.quality import was_moved

        was_put_down = self._is_put_down
        self._is_put_down = not was_moved(self._standing)
        if self._is_put_down and not was_put_down:
            self._judge_anew()

    def _judge_anew(self) -> None:
        """Judge by its calibration what it stands on, unless that is surely white: the robot was carried
        there, and what the sensor read in the air says nothing."""
        from raccoon.estimate.tophat import Tophat
        from raccoon.estimate.tophat.calibration_watch import CalibrationWatch

        if self.calibration is None or self._classifier is None:
            return
        if self.black is not False or self.status is not Status.OK:
            adapt = self._classifier.adapt
            self._classifier = Tophat(self.calibration, adapt=adapt)
        self._watch, self.fit, self._driven_s = CalibrationWatch(self.calibration), None, 0.0

    def classify(self, inputs: Inputs, way: float | None = None) -> None:
        """Classify the reading that was taken, once the banks of all sensors have run."""
        classifier, watch, counts = self._classifier, self._watch, inputs.analog[self.config.analog]
        if classifier is None or watch is None or counts is None:
            self.sees = counts is None and inputs.time - self._seen < BLIND_AFTER_S
            return
        reading = self._reading = classifier.classify()
        self._seen = self._seen if classifier.missed or self.floating else inputs.time
        self.sees = inputs.time - self._seen < BLIND_AFTER_S
        if reading.edge is not None and not self.floating:
            self._edge = reading.edge
        # Half on a line neither surface explains what it reads, so only a drive across the floor proves it.
        proves = self.is_judged and (way is None or way > MOVING_WAY_M)
        if proves:
            self._driven_s += self._dt
        if proves or not ANALOG_BOTTOM < counts < ANALOG_TOP:
            watch.update(counts if classifier.missed else classifier.counts, 0.0 if way is None else way)

    def check(self, time: float) -> Fit | None:
        """Judge `fit` anew; a few times a second is enough. time: s, now."""
        from raccoon.estimate.tophat.calibration_watch import Fit

        self.silent = self._heard is not None and time - self._heard > SILENT_AFTER_S
        wanders = self._wanders
        if wanders is not None:
            self._wandered = min(max(self._wandered + (1 if wanders else -1), 0), MIN_WANDERED)
            if self._wandered in (0, MIN_WANDERED):
                self.floating = self._wandered == MIN_WANDERED
        if wanders is False and not self._has_driven:
            self._find_put_down()
        if self._watch is not None:
            fit = self._watch.fit
            began_well = self._driven_s > PROVING_S and self.fit is not Fit.CHANGED
            self.fit = Fit.FITS if fit is Fit.CHANGED and began_well else fit
        return self.fit

    @property
    def _wanders(self) -> bool | None:
        """Whether its last readings wandered while the robot stood; None if it has hardly stood."""
        if len(self._standing) < STANDING_READINGS:
            return None
        from raccoon.estimate.tophat.quality import is_restless

        return is_restless(self._standing)

    def is_steady_at_rest(self) -> bool:
        """Whether its last readings, at rest, were steady. Sets `floating` at once."""
        wanders = self._wanders
        if wanders is not None:
            self.floating = wanders
            self._wandered = MIN_WANDERED if wanders else 0
        return wanders is False

    @property
    def complaint(self) -> str:
        """What is wrong with its readings, "" if nothing."""
        if self.silent:
            return f"tophat {self.name} {UNREAD_REMARK}"
        if self.floating:
            port = self.config.analog
            return (
                f"tophat {self.name}: its reading wanders while the robot stands: is it plugged into "
                f"analog {port}?"
            )
        return f"tophat {self.name} {FIT_REMARKS[self.fit]}" if self.fit in FIT_REMARKS else ""

    @property
    def blind(self) -> bool:
        """Whether it gives no sensible readings."""
        return self.silent or self.floating or self.fit in ("unplugged", "saturated")

    @property
    def recent(self) -> tuple[float, ...]:
        """Counts of the last second of driving."""
        return () if self._watch is None else self._watch.readings

    @property
    def lost(self) -> bool:
        """Whether its reading is neither of its surfaces."""
        return self._classifier is not None and self._classifier.lost

    def require(self) -> None:
        """Raise CalibrationError unless there is a calibration."""
        if self.calibration is None:
            raise CalibrationError(
                f"tophat {self.name} is not calibrated: run calibrate_tophats() or load_tophats() first"
            )

    @property
    def black(self) -> bool | None:
        """True over black, False over white, None while it is not known."""
        return None if self._reading is None or self.floating else self._reading.black

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
        """The last edge between white and black that it crossed since `forget_edge`, None before one."""
        return self._edge

    def forget_edge(self) -> None:
        """Wait for a new edge."""
        self._edge = None

    def follow_light(self, on: bool) -> None:
        """Whether the calibration follows the light; off while the sensor is kept on an edge."""
        if self._classifier is not None:
            self._classifier.adapt = on

    def relearn(self, white: float, black: float) -> bool:
        """See `raccoon.estimate.tophat.Tophat.relearn`."""
        return self._classifier is not None and self._classifier.relearn(white, black)

    @property
    def other_light(self) -> bool:
        """Whether it reads what neither of its surfaces does while the light is not followed."""
        return self._classifier is not None and self._classifier.other_light

    @property
    def status(self) -> Status:
        """How far `black` and `darkness` can be trusted; invalid if it gives no sensible readings."""
        if self._reading is None or self.blind:
            return Status.INVALID
        if self.fit == "changed":
            return Status.UNCERTAIN
        return self._reading.status


UNREAD_REMARK = "is not read: its port gives no readings"
FIT_REMARKS = {
    "changed": (
        "does not read what its calibration says: the light, the floor or its height has changed. The "
        "change of light is followed; calibrate again to be sure"
    ),
    "unplugged": "reads the top of the scale or jumps about: is it plugged in?",
    "saturated": "reads the bottom of the scale: there is more light than it can measure",
}
"""Remarks by `Fit`."""
