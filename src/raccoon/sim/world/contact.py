"""Contact with walls and objects: the loads it puts on the wheels, and the slip of the tyres.

Each touch is a spring and a damper along its normal, with Coulomb friction along the surface. The no-slip
relation of the wheels turns its force into a load on both of them, which the plant applies in its next step
like that of a ramp. No tyre carries more than its grip: beyond it the robot is moved back out of the wall
while its wheels turn, until the springs require no more than the grip (the return map of elastic-plastic
solids, with slip for plastic flow). docs/simulator.md derives it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from raccoon.core.readings import GRAVITY
from raccoon.core.sections import BodyConfig
from raccoon.sim.plant.quantities import Plant, State
from raccoon.sim.world.collision import Obstacles, Pose, Touch
from raccoon.sim.world.table import World

STIFFNESS, DAMPING = 0.08, 0.25
"""Stiffness and damping of one touch, relative to m / period^2 and m / period, with m the mass that the touch
feels. The plant applies a force one period late; with these values that is stable with up to five
simultaneous touches (0.2 and 0.6 would be for two only), and nothing oscillates."""
WALL_FRICTION = 0.2
"""Coefficient of Coulomb friction of plastic or metal along a plastic pipe."""
MIN_SLIDING_SPEED = 1e-4
"""Sliding speed, m/s, at which wall friction has 0.7 of its full force. Below it friction fades to 0 at
rest."""
MAX_ITERATIONS, STIFFNESS_MARGIN = 20, 0.02
"""Most iterations of the search for the slip, and the share by which the stiffness is raised in it."""
GRIP_TOLERANCE_N = 1e-3
"""Tolerance of that search: force, N, by which a tyre may exceed its grip."""
Pair = tuple[float, float]
"""Values of the left and the right wheel, or x and y."""


class Slip(NamedTuple):
    """Motion of the robot beyond the rolling of its wheels: forward, m/s, and turning, rad/s."""

    forward: float
    turning: float


NO_SLIP, NO_LOADS, NO_TILT = Slip(0.0, 0.0), (0.0, 0.0), (0.0, 0.0)


def with_pose(state: State, x: float, y: float, heading: float) -> State:
    """The state with another pose, in the frame of the plant's start pose: m, m, rad."""
    return state._replace(
        x=x, y=y, heading=heading, heading_cos=math.cos(heading), heading_sin=math.sin(heading)
    )


class _WheelPush(NamedTuple):
    """A touch in terms of the wheels, before any slip.

    way: displacement of the touching point along the normal per m of travel of the left and the right wheel;
    equally the force on each tyre per N of normal force. across: the same along the wall. force: normal
    force, N. stiffness: decrease of this force per m by which the robot is moved out of the wall, N/m.
    sliding: speed along the wall, m/s. gradual: sliding speed at which friction has 0.7 of its full force,
    m/s.
    """

    way: Pair
    across: Pair
    force: float
    stiffness: float
    sliding: float
    gradual: float


class Contact:
    """A robot in contact with the ramps and obstacles of its table. Call `resolve` and `with_loads` after
    every step.

    plant: the robot on level ground. period: s, no step is longer. pose: at the start, in the world.
    """

    def __init__(self, world: World, body: BodyConfig, plant: Plant, period: float, pose: Pose) -> None:
        self._world, self._obstacles = world, Obstacles(world, body)
        self._cosine, self._sine = math.cos(pose[2]), math.sin(pose[2])
        self._touching = False
        self._length, self._mass, self._felt = body.front, body.mass, NO_LOADS
        self._grip = 0.5 * body.grip * body.mass * GRAVITY
        self._period = period
        self._before = pose
        self.loads: Pair = NO_LOADS
        """Loads on the left and the right wheel in the plant's next step, N m, forward positive."""
        self.slip = NO_SLIP
        """The slip in the last step."""
        self.set_robot(plant)
        self.tilt(pose, 0.0)

    def set_robot(self, plant: Plant) -> None:
        """Replace the robot, e.g. by one with other inertias, radii or track. plant: the robot on level
        ground."""
        self._level = plant
        self._radii = plant.radius_left, plant.radius_right
        self._per_track = plant.per_track
        spare = plant.inertia_own**2 - plant.inertia_other**2
        own, other = plant.inertia_own / spare, -plant.inertia_other / spare
        left, right = self._radii
        # 1/kg, acceleration of the rims per force: left by left, each by the other, right by right tyre.
        self._mobility = own * left * left, other * left * right, own * right * right
        # A force that turns no wheel (of a wall beside the axis) feels at most the mass of the robot.
        self._least = 0.25 * (self._mobility[0] + 2.0 * self._mobility[1] + self._mobility[2])

    def resolve(self, pose: Pose, seconds: float) -> Pose:
        """Resolve the contacts of a robot that has rolled to `pose` in a step of `seconds`. Returns its pose
        after any slip; sets `loads` and `slip`."""
        before, self._before = self._before, pose
        self.slip, self.loads = NO_SLIP, NO_LOADS
        if self._obstacles.is_far(pose[0], pose[1]) or seconds <= 0.0:
            return pose
        touches = self._obstacles.touches(pose)
        if not touches:
            return pose
        x, y, heading = pose
        cosine, sine = math.cos(heading), math.sin(heading)
        dx, dy = x - before[0], y - before[1]
        moved = cosine * dx + sine * dy, cosine * dy - sine * dx, heading - before[2]
        tyres, (left, right) = self._limit_to_grip(
            [self._push(each, moved, seconds) for each in touches], seconds
        )
        self.loads = tyres[0] * self._radii[0], tyres[1] * self._radii[1]
        if left == right == 0.0:
            return pose
        way, angle = 0.5 * (left + right), (right - left) * self._per_track
        self.slip = Slip(way / seconds, angle / seconds)
        self._before = x + way * cosine, y + way * sine, heading + angle
        return self._before

    def with_loads(self, plant: Plant, x: float, y: float) -> Plant:
        """The plant of the last step with the slope at (x, y), m, and the present loads on its wheels."""
        touching = self.loads != NO_LOADS
        if touching or self._touching or self._world.ramps:
            along_x, along_y = self._world.slope(x, y)
            level = self._level
            # A plant's slopes are in the frame of its start pose.
            pulls = (
                level.slope_x + (self._cosine * along_x + self._sine * along_y),
                level.slope_y + (self._cosine * along_y - self._sine * along_x),
                *self.loads,
            )
            if pulls != (plant.slope_x, plant.slope_y, plant.pushed_left, plant.pushed_right):
                slope_x, slope_y, left, right = pulls
                plant = level._replace(slope_x=slope_x, slope_y=slope_y, pushed_left=left, pushed_right=right)
        self._touching = touching
        return plant

    def tilt(self, pose: Pose, seconds: float) -> tuple[float, float]:
        """Tilt of the chassis at a pose: the share of gravity that an accelerometer measures ahead, m/s2,
        positive if the nose is up, and the rate, rad/s, at which the nose has come down in the last
        `seconds`. The chassis leans by the mean slope of the floor from its axis to its front."""
        level = self._level
        if not self._world.ramps and level.slope_x == level.slope_y == 0.0:
            return NO_TILT
        x, y, heading = pose
        cosine, sine = math.cos(heading), math.sin(heading)
        along_x, along_y = self._world.slope_along(x, y, self._length * cosine, self._length * sine)
        along_x += self._cosine * level.slope_x - self._sine * level.slope_y
        along_y += self._sine * level.slope_x + self._cosine * level.slope_y
        # A slope is given as the torque at each wheel, which carries half of the robot's weight.
        per_torque = -4.0 / (self._mass * sum(self._radii))
        before, self._felt = self._felt, (along_x * per_torque, along_y * per_torque)
        felt = cosine * self._felt[0] + sine * self._felt[1]
        change = felt - (cosine * before[0] + sine * before[1])
        return felt, -change / (GRAVITY * seconds) if seconds > 0.0 else 0.0

    def _push(self, touch: Touch, moved: tuple[float, float, float], seconds: float) -> _WheelPush:
        x, y, normal_x, normal_y, depth = touch
        way = self._tyre_shares(x, y, normal_x, normal_y)
        mass = 1.0 / max(self._inverse_mass(way), self._least)
        spring = STIFFNESS * mass / self._period**2
        damper = DAMPING * mass / (self._period * seconds)
        ahead, aside = moved[0] - moved[2] * y, moved[1] + moved[2] * x
        force = max(0.0, spring * depth - damper * (normal_x * ahead + normal_y * aside))
        # Friction that would reverse the sliding within a period only stops it.
        across = self._tyre_shares(x, y, -normal_y, normal_x)
        ends = WALL_FRICTION * force * self._inverse_mass(across) * self._period
        sliding = (normal_x * aside - normal_y * ahead) / seconds
        return _WheelPush(way, across, force, spring + damper, sliding, ends + MIN_SLIDING_SPEED)

    def _tyre_shares(self, x: float, y: float, force_x: float, force_y: float) -> Pair:
        """Force on the left and the right tyre from a force at the point (x, y); equally, the displacement of
        the point along that force per m of travel of each wheel."""
        moment = (x * force_y - y * force_x) * self._per_track
        return 0.5 * force_x - moment, 0.5 * force_x + moment

    def _inverse_mass(self, shares: Pair) -> float:
        """Inverse of the mass that a force on a point feels if the wheels roll without slip, 1/kg. shares:
        `_tyre_shares` of a unit force."""
        left, right = shares
        own_left, other, own_right = self._mobility
        return own_left * left * left + 2.0 * other * left * right + own_right * right * right

    def _limit_to_grip(self, pushes: list[_WheelPush], seconds: float) -> tuple[Pair, Pair]:
        """The force on each tyre, N, limited to its grip, and the slip of each tyre that this requires, m.

        Newton's method, which is exact for forces that are linear in the slip, as they are here.
        """
        grip = self._grip
        slips = (0.0, 0.0)
        for _ in range(MAX_ITERATIONS):
            felt = _tyre_forces(pushes, slips, seconds)
            beyond = (
                _force_beyond_grip(felt.left, slips[0], grip),
                _force_beyond_grip(felt.right, slips[1], grip),
            )
            if abs(beyond[0]) < GRIP_TOLERANCE_N and abs(beyond[1]) < GRIP_TOLERANCE_N:
                break
            slips = _solve_slips(felt, slips, grip)
        return (_clip_to_grip(felt.left, grip), _clip_to_grip(felt.right, grip)), slips


class _TyreForces(NamedTuple):
    """Forces on the left and the right tyre, N, and their decrease per m of slip, N/m: by a tyre's own slip
    (own), and by that of the other one (from_right: on the left tyre by slip of the right one). soft: a small
    part of these stiffnesses, N/m, their lower bound."""

    left: float
    right: float
    own_left: float
    own_right: float
    from_right: float
    from_left: float
    soft: float


def _tyre_forces(pushes: list[_WheelPush], slips: Pair, seconds: float) -> _TyreForces:
    """The forces of all touches together at these slips (left, right; m)."""
    left, right = slips
    tyre_left = tyre_right = own_left = own_right = from_right = from_left = soft = 0.0
    for way, across, force, stiffness, sliding, gradual in pushes:
        soft += STIFFNESS_MARGIN * stiffness * (way[0] * way[0] + way[1] * way[1])
        force -= stiffness * (way[0] * left + way[1] * right)
        if force <= 0.0:
            continue
        sliding += (across[0] * left + across[1] * right) / seconds
        share = 1.0 / math.hypot(sliding, gradual)
        drag = WALL_FRICTION * sliding * share
        pull_left, pull_right = way[0] - drag * across[0], way[1] - drag * across[1]
        tyre_left += force * pull_left
        tyre_right += force * pull_right
        rubs = WALL_FRICTION * force * share / seconds  # a secant, with which the search never overshoots
        own_left += stiffness * pull_left * way[0] + rubs * across[0] * across[0]
        own_right += stiffness * pull_right * way[1] + rubs * across[1] * across[1]
        from_right += stiffness * pull_left * way[1] + rubs * across[0] * across[1]
        from_left += stiffness * pull_right * way[0] + rubs * across[0] * across[1]
    own_left, own_right = max(own_left, soft), max(own_right, soft)
    return _TyreForces(tyre_left, tyre_right, own_left, own_right, from_right, from_left, soft)


def _solve_slips(felt: _TyreForces, slips: Pair, grip: float) -> Pair:
    """The slips, m, at which no tyre carries more than its grip, and each tyre that slips carries all of it,
    in the direction of its slip.

    Three cases are tried: both tyres slip, only the left one, only the right one; the consistent one is
    taken. The case of both is tried first, with a little added to their stiffness: a push straight ahead
    could be relieved by the slip of either tyre, and left and right must be treated alike.
    """
    left, right = slips
    rolls_left = felt.left + felt.own_left * left + felt.from_right * right  # without any slip
    rolls_right = felt.right + felt.own_right * right + felt.from_left * left
    alone_left = (rolls_left - _clip_to_grip(rolls_left, grip)) / felt.own_left
    alone_right = (rolls_right - _clip_to_grip(rolls_right, grip)) / felt.own_right
    then_left, then_right = (
        rolls_left - felt.from_right * alone_right,
        rolls_right - felt.from_left * alone_left,
    )
    over_left, over_right = (
        felt.left - math.copysign(grip, then_left),
        felt.right - math.copysign(grip, then_right),
    )
    own_left, own_right = felt.own_left + felt.soft, felt.own_right + felt.soft
    spare = own_left * own_right - felt.from_left * felt.from_right
    left += (own_right * over_left - felt.from_right * over_right) / spare
    right += (own_left * over_right - felt.from_left * over_left) / spare
    if left * then_left > 0.0 and right * then_right > 0.0:
        return left, right
    return (alone_left, 0.0) if abs(then_right) <= grip else (0.0, alone_right)


def _force_beyond_grip(tyre: float, slip: float, grip: float) -> float:
    """Force on a tyre beyond what it carries, N; a tyre that slips carries all of its grip."""
    return tyre - math.copysign(grip, slip) if slip != 0.0 else tyre - _clip_to_grip(tyre, grip)


def _clip_to_grip(value: float, most: float) -> float:
    return max(-most, min(most, value))
