"""The plant as a robot in a world, advanced by one period at a time."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from raccoon.core.readings import Outputs
from raccoon.core.sections import BodyConfig
from raccoon.sim.effects.physical import state_at_rest
from raccoon.sim.plant.compiled import advance_one, given
from raccoon.sim.plant.driver import cycle_count
from raccoon.sim.plant.quantities import Plant, State
from raccoon.sim.world.collision import Pose
from raccoon.sim.world.contact import NO_SLIP, Contact, with_pose
from raccoon.sim.world.table import World

Noise = Sequence[Sequence[float]]
MIN_SLIP_RATE = 1e-6
"""Turn rate of a slip in the gyro's low-pass, rad/s, below which it is set to 0: too small for any gyro to
measure."""


class SimulatedRobot:
    """The plant with its command history, in contact with the walls and ramps of a world. A call of `step`
    advances it by one period.

    period, cycle (of the controller) and longest_step: s. slots: where in a cycle the left and the right
    motor are sampled, 1 is its end. start: pose in the world (m, m, rad). body: the outline that touches
    obstacles.
    """

    def __init__(
        self,
        plant: Plant,
        world: World,
        *,
        period: float,
        cycle: float,
        slots: tuple[float, float],
        longest_step: float,
        start: Pose,
        body: BodyConfig,
    ) -> None:
        self._rolled: State = state_at_rest(plant)
        self._period = period
        self._cycle = cycle
        self._slots = slots
        self._longest_step = longest_step
        self._contact = Contact(world, body, plant, period, start)
        self._plant = self._contact.with_loads(plant, start[0], start[1])
        self.tilt = self._contact.tilt(start, 0.0)
        """Tilt in the last step, as `Contact.tilt` returns it."""
        self._slipped = 0.0  # rad/s, turn rate of the slip after the gyro's low-pass
        low_pass = plant.low_pass
        self._follows = 1.0 if low_pass == 0.0 else -math.expm1(-period / low_pass)
        self._start_x, self._start_y, self._start_heading = start
        self._cos, self._sin = math.cos(start[2]), math.sin(start[2])
        rows = 1 + (math.ceil(plant.latency / period) + 1 if plant.latency > 0.0 else 0)
        self._rows = rows
        self._past = tuple(given([0.0] * rows) for _ in range(4))
        self._noise = tuple(given([0.0] * cycle_count(period, cycle)) for _ in range(2))
        self._times = given([(row + 1 - rows) * period for row in range(rows + 1)])
        self._kept = given(np.zeros(0, dtype=np.int64))
        self._out = np.zeros((0, 1))
        self._advance = advance_one()

    @property
    def state(self) -> State:
        """State of the plant; while tyres slip at a wall, its robot speeds and gyro rate include the slip."""
        slip, seen = self._contact.slip, self._rolled
        if slip is NO_SLIP and self._slipped == 0.0:
            return seen
        return seen._replace(
            forward_speed=seen.forward_speed + slip.forward,
            yaw_rate=seen.yaw_rate + slip.turning,
            gyro_rate=seen.gyro_rate + self._slipped,
        )

    @property
    def pose(self) -> Pose:
        """x, y in m and heading in rad (unwrapped), in the world."""
        s = self._rolled
        return (
            self._start_x + self._cos * s.x - self._sin * s.y,
            self._start_y + self._sin * s.x + self._cos * s.y,
            self._start_heading + s.heading,
        )

    def step(self, duty: tuple[float, float], closed: tuple[bool, bool], noise: Noise) -> None:
        """Advance by one period under a command.

        duty: left and right, forward positive. closed: whether each motor is connected. noise: counts on each
        back-EMF sample of the period, left and right.
        """
        for past, value in zip(self._past, (*duty, *closed), strict=True):
            if self._rows > 1:
                past[:-1] = past[1:]
            past[-1] = value
        for ours, draws in zip(self._noise, noise, strict=True):
            for index, draw in enumerate(draws):
                ours[index] = draw
        self._rolled = self._advance(
            self._rolled, self._plant, self._past, self._times,
            self._rows - 1, self._rows, self._cycle, self._longest_step, self._slots,
            self._noise, self._kept, self._out,
        )  # fmt: skip
        self._apply_contact()

    def _apply_contact(self) -> None:
        pose = self.pose
        contact = self._contact
        x, y, heading = contact.resolve(pose, self._period)
        slip = contact.slip
        if slip is not NO_SLIP:
            dx, dy = x - self._start_x, y - self._start_y
            ahead, aside = self._cos * dx + self._sin * dy, self._cos * dy - self._sin * dx
            self._rolled = with_pose(self._rolled, ahead, aside, heading - self._start_heading)
        if slip is not NO_SLIP or self._slipped != 0.0:
            self._slipped += self._follows * (slip.turning - self._slipped)
            if abs(self._slipped) < MIN_SLIP_RATE:
                self._slipped = 0.0
        self._plant = contact.with_loads(self._plant, x, y)
        self.tilt = contact.tilt((x, y, heading), self._period)


def bridge_commands(
    outputs: Outputs, ports: tuple[int, int], signs: tuple[float, float]
) -> tuple[tuple[float, float], tuple[bool, bool]]:
    """The duties of the wheels, left and right, forward positive, and whether each motor is connected, from
    the board's outputs.

    ports: motor ports, left and right. signs: of the wiring. A motor is connected while its duty is not 0 or
    it brakes (at duty 0 its winding is then shorted); otherwise it coasts.
    """
    left, right = ports
    duty = (signs[0] * outputs.duty[left], signs[1] * outputs.duty[right])
    closed = (
        outputs.duty[left] != 0.0 or outputs.brake[left],
        outputs.duty[right] != 0.0 or outputs.brake[right],
    )
    return duty, closed
