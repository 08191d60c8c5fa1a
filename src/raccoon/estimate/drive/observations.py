"""Observations as measurements of the pose: a known pose, a heading along a wall, the crossing of a line.

Each consists of the values expected at a pose (x, y, heading) and their Jacobian, (m, 3).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from raccoon.estimate.ekf.model import Array
from raccoon.estimate.ekf.state import SIZE, State

PoseFunction = Callable[[Array], Array]
# 99.9 % of a chi-squared distribution with 1, 2, 3 degrees of freedom: square roots.
GATES = {1: 3.291, 2: 3.717, 3: 4.033}


@dataclass(frozen=True, slots=True)
class PoseMeasurement:
    """A measurement of the pose, of m values.

    values: (m,). expected, jacobian: functions of the pose. std: (m,). angle: index of the value that is an
    angle, or None.
    """

    values: Array
    expected: PoseFunction
    jacobian: PoseFunction
    std: Array
    angle: int | None = None

    @property
    def gate(self) -> float:
        """Mahalanobis distance above which the measurement is rejected: one true observation in 1000 is
        beyond it."""
        return GATES[len(self.values)]

    def residual(self, measured: Array, expected: Array) -> Array:
        """measured - expected, an angle wrapped to [-pi, pi]."""
        result: Array = measured - expected
        if self.angle is not None:
            result[self.angle] = math.remainder(result[self.angle], math.tau)
        return result

    def functions_of_state(self, shift: Array) -> tuple[PoseFunction, PoseFunction]:
        """Expected values and Jacobian as functions of the filter's state (13,), whose pose is `shift` (3,)
        behind the robot's."""

        def expected(state: Array) -> Array:
            return self.expected(state[: State.VELOCITY] + shift)

        def jacobian(state: Array) -> Array:
            H = np.zeros((len(self.values), SIZE))
            H[:, : State.VELOCITY] = self.jacobian(state[: State.VELOCITY] + shift)
            return H

        return expected, jacobian


def check_observation(std: float, *values: float) -> None:
    """Raise ValueError for a value that is not finite or a standard deviation that is not above 0."""
    if not (math.isfinite(std) and std > 0.0):
        raise ValueError(f"std is {std}: it must be above 0")
    if not all(math.isfinite(value) for value in values):
        raise ValueError(f"observed values {values}: every one must be finite")


def pose_measurement(
    x: float, y: float, heading: float, position_std: float, heading_std: float
) -> PoseMeasurement:
    """Measurement of the whole pose: m, m, rad."""
    check_observation(position_std, x, y, heading)
    check_observation(heading_std)
    return PoseMeasurement(
        np.array([x, y, heading]),
        lambda pose: pose.copy(),
        lambda _: np.eye(3),
        np.array([position_std, position_std, heading_std]),
        angle=2,
    )


def heading_measurement(heading: float, std: float) -> PoseMeasurement:
    """Measurement of the heading, rad: the robot stands along a wall."""
    check_observation(std, heading)
    return PoseMeasurement(
        np.array([heading]),
        lambda pose: pose[2:3].copy(),
        lambda _: np.array([[0.0, 0.0, 1.0]]),
        np.array([std]),
        angle=0,
    )


def line_measurement(
    point: tuple[float, float], direction: float, sensor: tuple[float, float], std: float
) -> PoseMeasurement:
    """Measurement by a sensor (m ahead, m to the left of the robot's origin) that is on the line through
    `point` along `direction` rad.

    The measured value is the sensor's distance from the line, positive to the left of its direction: 0.
    """
    check_observation(std, *point, direction, *sensor)
    normal = np.array([-math.sin(direction), math.cos(direction)])
    ahead, left = sensor

    def expected(pose: Array) -> Array:
        c, s = math.cos(pose[2]), math.sin(pose[2])
        place = np.array([pose[0] + ahead * c - left * s, pose[1] + ahead * s + left * c])
        return np.array([normal @ (place - np.array(point))])

    def jacobian(pose: Array) -> Array:
        c, s = math.cos(pose[2]), math.sin(pose[2])
        turned = np.array([-ahead * s - left * c, ahead * c - left * s])
        return np.array([[normal[0], normal[1], normal @ turned]])

    return PoseMeasurement(np.zeros(1), expected, jacobian, np.array([std]))


@dataclass(slots=True)
class WheelTravel:
    """Turns of the wheels since a mark: rad at nominal scale, and s."""

    left: float = 0.0
    right: float = 0.0
    seconds: float = 0.0

    def add(self, left: float, right: float, span: float) -> None:
        """Add `span` s at these speeds, rad/s at nominal scale."""
        self.left += left * span
        self.right += right * span
        self.seconds += span

    def expected(self, state: Array, radius: float) -> Array:
        """Distance of the robot's origin, m, (1,)."""
        return np.array([state[State.WAY] * sum(self._half_ways(state, radius))])

    def _half_ways(self, state: Array, radius: float) -> tuple[float, float]:
        """Half the distance of either wheel, m, without the common scale WAY."""
        balance = state[State.BALANCE]
        left = 0.5 * radius * (self.left - state[State.LEFT_OFFSET] * self.seconds) / (1.0 - balance)
        right = 0.5 * radius * (self.right - state[State.RIGHT_OFFSET] * self.seconds) / (1.0 + balance)
        return left, right

    def jacobian(self, state: Array, radius: float) -> Array:
        """Derivative of `expected` by the state, (1, 13)."""
        H = np.zeros((1, SIZE))
        way, balance = state[State.WAY], state[State.BALANCE]
        left, right = self._half_ways(state, radius)
        H[0, State.WAY] = left + right
        H[0, State.BALANCE] = way * (left / (1.0 - balance) - right / (1.0 + balance))
        H[0, State.LEFT_OFFSET] = -0.5 * radius * self.seconds * way / (1.0 - balance)
        H[0, State.RIGHT_OFFSET] = -0.5 * radius * self.seconds * way / (1.0 + balance)
        return H
