"""All tophats of a robot at once: their readings of a cycle, and remarks on what is wrong with one."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

from raccoon.robot.parts.tophats import FIT_REMARKS, TophatSensor
from raccoon.robot.remarks import add_remark

if TYPE_CHECKING:
    from raccoon.core.readings import Inputs
    from raccoon.robot.robot import Robot

CHECK_PERIOD_TICKS = 40  # ticks


class TophatArray:
    """All tophats of a robot at once: they move with it and share its light."""

    def __init__(self, sensors: Mapping[str, TophatSensor]) -> None:
        self._sensors = tuple(sensors.values())
        self._ticks = 0

    def sense(self, robot: Robot, inputs: Inputs, dt: float) -> None:
        """Update every sensor with the distance that it moved, and check one of them for what may be wrong
        with it. dt: s since the previous reading."""
        sensors = self._sensors
        if not sensors:
            return
        estimate = robot.odometry.estimate
        speed, turn = estimate.velocity, estimate.turn_rate
        lost = sum(each.lost for each in sensors)
        alone = len(sensors) == 1
        duty, drive = robot.outputs.duty, robot.config.drive
        driven = duty[drive.left] != 0.0 or duty[drive.right] != 0.0
        shaken = any(duty) or robot.attachments.servo_moves
        ways, doubtful = [], []
        for each in sensors:
            at = each.config
            way = math.hypot(speed - turn * at.left, turn * at.forward) * dt
            found = each.take(inputs, way, None if alone else lost > each.lost, shaken=shaken, driven=driven)
            ways.append(way)
            if found is not None:
                doubtful.append(found)
        if doubtful:
            doubtful[0].run_banks(doubtful)
        for each, way in zip(sensors, ways, strict=True):
            each.classify(inputs, way)
        self._ticks += 1
        index = self._ticks % CHECK_PERIOD_TICKS
        if index < len(sensors):
            self._check(robot, sensors[index])

    def _check(self, robot: Robot, sensor: TophatSensor) -> None:
        now = sensor.check(robot.time)
        if sensor.silent or sensor.floating:
            add_remark(robot, sensor.complaint)
        elif now is not None and now in FIT_REMARKS:
            add_remark(robot, f"tophat {sensor.name} {self._describe_swapped(sensor) or FIT_REMARKS[now]}")

    def _describe_swapped(self, sensor: TophatSensor) -> str | None:
        """The remark if it reads the floor as another sensor should."""
        from raccoon.estimate.tophat.calibration_watch import find_swapped

        stored = {each.name: each.calibration for each in self._sensors if each.calibration is not None}
        pair = find_swapped(stored, {each.name: each.recent for each in self._sensors})
        if pair is None or sensor.name not in pair:
            return None
        other = pair[pair[0] == sensor.name]
        return f"reads what {other} should, and the other way round: are their plugs swapped?"
