"""The pose of the robot from an optical flow sensor and an attitude.

The sensor is at r = (forward, left) in the robot frame. Its own path is the sum of the flow rotated by the
heading; the middle of the wheel axis is that path minus R(heading) r. A reference that may be wrong is worse
than none: once motion was missed, the pose is invalid until `restart`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from raccoon.core.errors import ConfigError
from raccoon.core.readings import Status, Truth
from raccoon.hal.calibration_board.frames import Accumulator, Flow, FlowCalibration, Frame, Orientation

POOR_SQUAL = 40
"""Surface quality below which the flow sensor does not track the floor."""
FRAME_GAP = 0.05
"""s without flow or without tracking after which the pose is lost; a shorter gap is bridged by the next
frame."""
ACCUMULATOR_GAP = 0.25
"""The same for flow, if the board sums the flow itself."""


@dataclass(frozen=True, slots=True)
class Mounting:
    """Mounting of the board on the robot. The board's own offset is not used.

    forward, left: m from the middle of the wheel axis to the flow sensor. rotation: rad counter-clockwise
    from the robot's forward to the sensor's x axis. x_sign, y_sign, yaw_sign: -1 if the board counts in the
    opposite direction; push the robot forward, to the left and turn it counter-clockwise to find them. Raises
    ConfigError for a sign that is neither 1 nor -1, or a number that is not finite.
    """

    forward: float = 0.0
    left: float = 0.0
    rotation: float = 0.0
    x_sign: int = 1
    y_sign: int = 1
    yaw_sign: int = 1

    def __post_init__(self) -> None:
        for name in ("x_sign", "y_sign", "yaw_sign"):
            if getattr(self, name) not in (1, -1):
                raise ConfigError(f"mounting: {name} is {getattr(self, name)!r}: allowed are 1 and -1")
        for name in ("forward", "left", "rotation"):
            if not math.isfinite(getattr(self, name)):
                raise ConfigError(f"mounting: {name} is {getattr(self, name)!r}: it must be finite")


CENTRED = Mounting()
"""Mounting in the middle of the wheel axis, x forward, y left."""


class FlowTracker:
    """Integrates frames to a pose. `lost` says why the pose is lost; empty if it is not. turn_rate: rad/s.
    squal: surface quality of the last flow."""

    def __init__(self, mounting: Mounting = CENTRED) -> None:
        self._mounting = mounting
        self._counts_per_metre: tuple[float, float] | None = None
        self._yaw: float | None = None  # unwrapped, as the board sees it
        self._flow_yaw: float | None = None
        self._flow_time: int | None = None
        self._good_time: int | None = None
        self._sums: tuple[int, int] | None = None
        self._poor = False
        self.turn_rate: float | None = None
        self.squal: int | None = None
        self.restart()

    def restart(self, x: float = 0.0, y: float = 0.0, heading: float = 0.0) -> None:
        """Set the pose at which the robot stands now (m, m, rad).

        Without a call the pose is 0, 0, 0 where the robot stood when the first `truth` came: let it rest
        until then.
        """
        self.lost = ""
        self._start_yaw = self._yaw
        self._start_heading = heading
        forward, left = _turned(self._mounting.forward, self._mounting.left, heading)
        self._sensor_x, self._sensor_y = x + forward, y + left

    def lose(self, reason: str) -> None:
        """Declare the pose lost; the first reason is kept. The next flow starts a new sum."""
        self.lost = self.lost or reason
        self._flow_time = self._good_time = self._sums = None

    @property
    def status(self) -> Status:
        if self.lost or self._missing():
            return Status.INVALID
        return Status.UNCERTAIN if self._poor else Status.OK

    @property
    def problem(self) -> str:
        """Why there is no pose; empty if there is one."""
        return self.lost or self._missing()

    def truth(self) -> Truth | None:
        """The pose, or None if it cannot be trusted."""
        if self.status is not Status.OK:
            return None
        heading = self._heading()
        forward, left = _turned(self._mounting.forward, self._mounting.left, heading)
        return Truth(self._sensor_x - forward, self._sensor_y - left, heading)

    def take(self, frame: Frame) -> None:
        """Process one frame; frames must come in the order of the board."""
        match frame:
            case FlowCalibration():
                self._take_calibration(frame)
            case Orientation():
                self._take_orientation(frame)
            case Flow():
                self._take_flow(frame)
            case Accumulator():
                self._take_sums(frame)
            case _:
                pass

    def _missing(self) -> str:
        if self._counts_per_metre is None:
            return "the board's flow sensor is not calibrated"
        if self._yaw is None:
            return "the board has not reported its attitude"
        if self._flow_time is None:
            return "the board has not reported any flow"
        return ""

    def _heading(self) -> float:
        assert self._yaw is not None
        start = self._yaw if self._start_yaw is None else self._start_yaw
        return self._start_heading + self._mounting.yaw_sign * (self._yaw - start)

    def _take_calibration(self, frame: FlowCalibration) -> None:
        x, y = frame.counts_per_cm
        usable = frame.valid and all(math.isfinite(each) and abs(each) > 0.0 for each in (x, y))
        if self._counts_per_metre is not None and not usable:
            self.lose("the board lost its flow calibration")
        self._counts_per_metre = (100.0 * x, 100.0 * y) if usable else None

    def _take_orientation(self, frame: Orientation) -> None:
        w, x, y, z = frame.quaternion
        if not abs(math.hypot(w, x, y, z) - 1.0) < 0.1:
            self.lose("the board's attitude is not a rotation")
            return
        yaw = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
        if self._yaw is None:
            self._yaw = self._start_yaw = yaw
        else:
            self._yaw += math.remainder(yaw - self._yaw, math.tau)
        rate = self._mounting.yaw_sign * math.radians(frame.gyro_deg_s[2])
        self.turn_rate = rate if math.isfinite(rate) else None

    def _take_flow(self, frame: Flow) -> None:
        self.squal = frame.squal
        self._check_gap(frame.time_ms)
        first = self._flow_time is None
        self._flow_time = frame.time_ms
        self._judge_quality(frame)
        if first:
            self._flow_yaw = self._yaw  # the first frame counts motion before the program listened
        elif self._sums is None:
            self._move(frame.dx, frame.dy)

    def _check_gap(self, time_ms: int) -> None:
        if self._flow_time is None:
            return
        elapsed = _elapsed(self._flow_time, time_ms)
        if elapsed < 0.0:
            self.lose("the board started again")
        elif elapsed > (FRAME_GAP if self._sums is None else ACCUMULATOR_GAP):
            self.lose(f"{elapsed:.2f} s without flow from the board")

    def _judge_quality(self, frame: Flow) -> None:
        self._poor = frame.squal < POOR_SQUAL
        if not self._poor or self._good_time is None:
            self._good_time = frame.time_ms
        elif _elapsed(self._good_time, frame.time_ms) > FRAME_GAP:
            self.lost = self.lost or (
                f"the floor could not be followed (quality {frame.squal}, below {POOR_SQUAL})"
            )

    def _take_sums(self, frame: Accumulator) -> None:
        last, self._sums = self._sums, (frame.x, frame.y)
        if last is None:
            self._flow_yaw = self._yaw
        else:
            self._move(_difference(last[0], frame.x), _difference(last[1], frame.y))

    def _move(self, dx: int, dy: int) -> None:
        """Add a step of the sensor, dx and dy counts, rotated by the heading half way between this step and
        the last."""
        if self._counts_per_metre is None or self._yaw is None:
            return
        before = self._yaw if self._flow_yaw is None else self._flow_yaw
        self._flow_yaw = self._yaw
        mounting = self._mounting
        heading = self._heading() - 0.5 * mounting.yaw_sign * (self._yaw - before)
        x = mounting.x_sign * dx / self._counts_per_metre[0]
        y = mounting.y_sign * dy / self._counts_per_metre[1]
        east, north = _turned(x, y, heading + mounting.rotation)
        self._sensor_x += east
        self._sensor_y += north


def _turned(x: float, y: float, angle: float) -> tuple[float, float]:
    cosine, sine = math.cos(angle), math.sin(angle)
    return cosine * x - sine * y, sine * x + cosine * y


def _difference(last: int, now: int) -> int:
    """Modular int32 difference."""
    return (now - last + 0x8000_0000) % 0x1_0000_0000 - 0x8000_0000


def _elapsed(last_ms: int, now_ms: int) -> float:
    """s between two time stamps of the board's modular uint32 clock; negative if it went back."""
    return _difference(last_ms, now_ms) / 1000.0
