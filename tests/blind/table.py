"""A robot on a table that can be driven cycle by cycle, written apart from the package: a port of its own.

It shares no line with `raccoon.sim`. Different on purpose: the robot is a rigid body whose tyres creep and
slide (force along the slip of each contact, a friction circle, any place of the mass), walls and objects are
stiff and damped, wheels run out, tophats see a disc of the floor, and the controller's loop runs at its own
183 Hz.

x ahead and y left of the start pose in m, torques in N m at the wheel shaft, SI throughout.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from blind.plant import COUNTS_PER_VOLT, compiled
from raccoon.core.readings import BEMF_VOLTS_PER_COUNT, Device, Inputs, Outputs, Truth

Array = NDArray[np.float64]

STEP = 0.0001
CYCLE = 0.005
GRAVITY = 9.81
OWN_CYCLE, COASTS = 1.0 / 183.0, 0.0005
"""s of the controller's own loop, and in which it lets a motor coast to read its back-EMF."""
SMOOTHS, DEAD_ZONE, RANGE = 0.2, 25.0, 2000.0
CREEP = 0.004
"""m/s of slip at which a tyre gives three quarters of its grip."""
STIFF, DAMPED, WALL_GRIP = 2.0e4, 120.0, 0.25
"""N/m and N s/m of a wall, and its friction."""
CHIP = 0.004
"""s by which the gyro's chip smooths."""
BODY_FRONT, BODY_BACK, BODY_HALF = 0.09, 0.09, 0.09
ROWS = 4096
GYRO_WORD = math.radians(1.0) / 16.4
ACCEL_WORD = GRAVITY / 8192
BATTERY_WORD = 3.3 * 11 / 4096

DEVICE = Device(
    name="blind",
    bemf_volts=BEMF_VOLTS_PER_COUNT,
    position_counts_seconds=1.0,
    gyro_rad_s=GYRO_WORD,
    accel_m_s2=ACCEL_WORD,
    battery_volts=BATTERY_WORD,
    bemf_lag=5.0 * OWN_CYCLE,
    bemf_dead_zone=DEAD_ZONE,
    driven_share=1.0 - COASTS / OWN_CYCLE,
    bemf_range=RANGE,
)


class Numbers(NamedTuple):
    """What a robot is. cg, caster: m that its mass and its caster are ahead of the axle; runout: share of a
    wheel's radius; tilt: m/s2 of gravity along the table."""

    voc: float = 6.8
    rint: float = 0.05
    discharge: float = 0.0
    resistance_l: float = 1.8
    resistance_r: float = 1.8
    ke_l: float = 1.08
    ke_r: float = 1.08
    coulomb_l: float = 0.18
    coulomb_r: float = 0.18
    viscous: float = 0.004
    stiction: float = 0.0
    wheel_inertia: float = 0.0165
    mass: float = 2.5
    yaw_inertia: float = 0.014
    cg: float = -0.01
    caster: float = -0.06
    caster_grip: float = 0.15
    caster_share: float = 0.2
    radius_l: float = 0.0345
    radius_r: float = 0.0345
    runout: float = 0.0
    track: float = 0.16
    grip: float = 0.9
    tilt_x: float = 0.0
    tilt_y: float = 0.0
    offset_l: float = 0.0
    offset_r: float = 0.0
    bemf_noise: float = 4.0
    gyro_bias: float = 0.0
    gyro_scale: float = 1.0
    gyro_drift: float = 0.0
    block_mass: float = 0.3


# What of the state is where.
X, Y, HEADING, AHEAD, ASIDE, YAW, LEFT, RIGHT, ANGLE_L, ANGLE_R, BUS, CHARGE = range(12)
TIME, NEXT, CHIP_1, CHIP_2, FELT_X, FELT_Y, FILTER_L, FILTER_R, COUNT_L, COUNT_R = range(12, 22)
BLOCK_X, BLOCK_Y, BLOCK_VX, BLOCK_VY, HIT, MEDIAN = range(22, 28)
STATES = MEDIAN + 6
BLOCK_RADIUS = 0.03


@compiled
def _wall(px: float, py: float, vx: float, vy: float, walls: Array) -> tuple[float, float]:
    """Force of all walls on a point of the robot."""
    fx, fy = 0.0, 0.0
    for k in range(walls.shape[0]):  # each: a point of it and its normal into the table
        nx, ny = walls[k, 2], walls[k, 3]
        deep = -((px - walls[k, 0]) * nx + (py - walls[k, 1]) * ny)
        if deep <= 0.0:
            continue
        push = max(STIFF * deep - DAMPED * (vx * nx + vy * ny), 0.0)
        along = np.tanh((-vx * ny + vy * nx) / CREEP) * WALL_GRIP * push
        fx += push * nx + along * ny
        fy += push * ny - along * nx
    return fx, fy


@compiled
def advance(
    p: Any, s: Array, seconds: float, duty: Array, brake: Array, walls: Array, patches: Array, noise: Array
) -> None:
    """Let the robot go on. duty: share of the battery, of the left and the right motor; brake: whether one
    without a duty is shorted (1) or open (0); patches: boxes of the floor (x, y, x, y) and their grip as a
    share; noise: of two readings of the back-EMF."""
    steps = max(int(seconds / STEP + 0.5), 1)
    dt = seconds / steps
    begin_x, begin_y = s[AHEAD], s[ASIDE]
    turned = 0.0
    for _ in range(steps):
        cosine, sine = np.cos(s[HEADING]), np.sin(s[HEADING])
        coasts = s[TIME] >= s[NEXT]
        force_x, force_y, moment, load = 0.0, 0.0, 0.0, 0.0
        pulls = p.mass * (p.tilt_x * cosine + p.tilt_y * sine), p.mass * (p.tilt_y * cosine - p.tilt_x * sine)
        new_l, new_r = 0.0, 0.0
        for side in range(2):
            left = side == 0
            ke = p.ke_l if left else p.ke_r
            resistance = p.resistance_l if left else p.resistance_r
            w = s[LEFT + side]
            current = 0.0
            if not coasts and (abs(duty[side]) > 1e-9 or brake[side] > 0.5):
                current = (duty[side] * s[BUS] - ke * w) / resistance
                load += abs(duty[side]) * max(current * np.sign(duty[side]), 0.0)
            radius = p.radius_l if left else p.radius_r
            radius *= 1.0 + p.runout * np.sin(s[ANGLE_L + side] + 2.0 * side)
            at = 0.5 * p.track if left else -0.5 * p.track
            slip_x = w * radius - (s[AHEAD] - s[YAW] * at)
            slip_y = -(s[ASIDE] - s[YAW] * p.cg)
            slip = np.hypot(slip_x, slip_y)
            grip = 0.5 * p.grip * p.mass * GRAVITY * (1.0 - p.caster_share)
            wx, wy = s[X] - at * sine, s[Y] + at * cosine
            for k in range(patches.shape[0]):
                if patches[k, 0] < wx < patches[k, 2] and patches[k, 1] < wy < patches[k, 3]:
                    grip *= patches[k, 4]
            held = grip * np.tanh(slip / CREEP) / slip if slip > 1e-9 else grip / CREEP
            fx, fy = held * slip_x, held * slip_y
            force_x += fx
            force_y += fy
            moment += -p.cg * fy - at * fx
            torque = ke * current - fx * radius - p.viscous * w
            friction = (p.coulomb_l if left else p.coulomb_r) + p.stiction * np.exp(-((w / 0.5) ** 2))
            free = w + dt * torque / p.wheel_inertia
            held_back = dt * friction / p.wheel_inertia
            new = np.sign(free) * max(abs(free) - held_back, 0.0)
            if left:
                new_l = new
            else:
                new_r = new
        # The caster drags on the floor.
        arm = p.caster - p.cg
        cx, cy = s[AHEAD], s[ASIDE] + s[YAW] * arm
        slides = np.hypot(cx, cy)
        drag = p.caster_grip * p.caster_share * p.mass * GRAVITY
        drag *= np.tanh(slides / CREEP) / slides if slides > 1e-9 else 1.0 / CREEP
        force_x -= drag * cx
        force_y -= drag * cy
        moment -= drag * cy * arm
        # Walls, at eight points of the body; bodies are rounded by nothing.
        hit = 0.0
        for k in range(8):
            bx = BODY_FRONT if k < 3 else (-BODY_BACK if k < 6 else 0.0)
            by = BODY_HALF * (k % 3 - 1.0) if k < 6 else (BODY_HALF if k == 6 else -BODY_HALF)
            px, py = s[X] + bx * cosine - by * sine, s[Y] + bx * sine + by * cosine
            ux, uy = s[AHEAD] - s[YAW] * by, s[ASIDE] + s[YAW] * (bx - p.cg)
            gx, gy = _wall(px, py, ux * cosine - uy * sine, ux * sine + uy * cosine, walls)
            fx, fy = gx * cosine + gy * sine, gy * cosine - gx * sine
            force_x += fx
            force_y += fy
            moment += (bx - p.cg) * fy - by * fx
            hit += abs(fx) + abs(fy)
        # The object that can be pushed: a disc.
        dx, dy = s[BLOCK_X] - s[X], s[BLOCK_Y] - s[Y]
        ox, oy = dx * cosine + dy * sine, dy * cosine - dx * sine
        nearest_x = min(max(ox, -BODY_BACK), BODY_FRONT)
        nearest_y = min(max(oy, -BODY_HALF), BODY_HALF)
        gap = np.hypot(ox - nearest_x, oy - nearest_y)
        on_x, on_y = 0.0, 0.0
        if 1e-9 < gap < BLOCK_RADIUS:
            nx, ny = (ox - nearest_x) / gap, (oy - nearest_y) / gap
            bvx = s[BLOCK_VX] * cosine + s[BLOCK_VY] * sine - (s[AHEAD] - s[YAW] * nearest_y)
            bvy = s[BLOCK_VY] * cosine - s[BLOCK_VX] * sine - (s[ASIDE] + s[YAW] * (nearest_x - p.cg))
            push = max(0.25 * STIFF * (BLOCK_RADIUS - gap) - 0.2 * DAMPED * (bvx * nx + bvy * ny), 0.0)
            force_x -= push * nx
            force_y -= push * ny
            moment += -(nearest_x - p.cg) * push * ny + nearest_y * push * nx
            on_x, on_y = push * (nx * cosine - ny * sine), push * (nx * sine + ny * cosine)
        vx, vy = s[BLOCK_VX] + dt * on_x / p.block_mass, s[BLOCK_VY] + dt * on_y / p.block_mass
        fast = np.hypot(vx, vy)
        kept = max(1.0 - dt * 0.35 * GRAVITY / fast, 0.0) if fast > 0.0 else 0.0
        s[BLOCK_VX], s[BLOCK_VY] = kept * vx, kept * vy
        s[BLOCK_X] += dt * s[BLOCK_VX]
        s[BLOCK_Y] += dt * s[BLOCK_VY]
        # All of it moves: AHEAD and ASIDE are those of the middle of its mass.
        gain_x = (force_x + pulls[0]) / p.mass + s[YAW] * s[ASIDE]
        gain_y = (force_y + pulls[1]) / p.mass - s[YAW] * s[AHEAD]
        s[AHEAD] += dt * gain_x
        s[ASIDE] += dt * gain_y
        s[YAW] += dt * moment / p.yaw_inertia
        s[LEFT], s[RIGHT] = new_l, new_r
        s[ANGLE_L] += dt * new_l
        s[ANGLE_R] += dt * new_r
        axle_y = s[ASIDE] - s[YAW] * p.cg
        s[X] += dt * (s[AHEAD] * cosine - axle_y * sine)
        s[Y] += dt * (s[AHEAD] * sine + axle_y * cosine)
        s[HEADING] += dt * s[YAW]
        turned += dt * s[YAW]
        s[HIT] += dt * hit
        s[CHARGE] += dt * load
        s[BUS] = p.voc - p.discharge * s[CHARGE] - p.rint * load
        s[CHIP_1] += dt / (0.5 * CHIP) * (s[YAW] - s[CHIP_1])
        s[CHIP_2] += dt / (0.5 * CHIP) * (s[CHIP_1] - s[CHIP_2])
        s[TIME] += dt
        if s[TIME] >= s[NEXT] + COASTS:
            s[NEXT] += OWN_CYCLE
            for side in range(2):
                ke, offset = (p.ke_l, p.offset_l) if side == 0 else (p.ke_r, p.offset_r)
                raw = ke * s[LEFT + side] * COUNTS_PER_VOLT + offset + p.bemf_noise * noise[side]
                first, second = s[MEDIAN + 3 * side], s[MEDIAN + 3 * side + 1]
                s[MEDIAN + 3 * side], s[MEDIAN + 3 * side + 1] = second, raw
                middle = max(min(first, second), min(max(first, second), raw))
                smooth = s[FILTER_L + side] + SMOOTHS * (middle - s[FILTER_L + side])
                if abs(smooth) <= RANGE:
                    s[FILTER_L + side] = smooth
                if abs(smooth) >= DEAD_ZONE:
                    s[COUNT_L + side] += OWN_CYCLE * s[FILTER_L + side]
    # What an accelerometer on the axle feels, the mean of this time.
    rate = turned / seconds
    s[FELT_X] = (s[AHEAD] - begin_x) / seconds - rate * s[ASIDE] - pulls[0] / p.mass
    s[FELT_Y] = (s[ASIDE] - begin_y) / seconds + rate * s[AHEAD] - pulls[1] / p.mass


@compiled
def darkness(x: float, y: float, strips: Array, spot: Array) -> float:
    """Share of a disc of the floor that is black. strips: start, end, half a width."""
    count = 0
    for k in range(spot.shape[0]):
        px, py = x + spot[k, 0], y + spot[k, 1]
        for j in range(strips.shape[0]):
            ax, ay = strips[j, 2] - strips[j, 0], strips[j, 3] - strips[j, 1]
            bx, by = px - strips[j, 0], py - strips[j, 1]
            along = min(max((ax * bx + ay * by) / (ax * ax + ay * ay), 0.0), 1.0)
            if (bx - along * ax) ** 2 + (by - along * ay) ** 2 < strips[j, 4] ** 2:
                count += 1
                break
    share: float = count / spot.shape[0]
    return share


def _disc(radius: float, points: int = 97) -> Array:
    """Points of a disc, evenly, by the golden angle."""
    k = np.arange(points)
    r, angle = radius * np.sqrt((k + 0.5) / points), k * math.pi * (3.0 - math.sqrt(5.0))
    return np.column_stack([r * np.cos(angle), r * np.sin(angle)])


SPOT = _disc(0.005)


@dataclass(frozen=True, slots=True)
class Eye:
    """A tophat as it truly sits. wander: counts that its light changes by, slowly."""

    port: int
    forward: float
    left: float
    white: float
    black: float
    noise: float = 3.0
    wander: float = 0.0


@dataclass(frozen=True, slots=True)
class Floor:
    """A table. strips: black lines (x, y, x, y, half a width). walls: a point and the normal into the table.
    patches: boxes (x, y, x, y) and their share of the grip. lamp: s at which the start light goes on."""

    strips: Sequence[Sequence[float]] = ()
    walls: Sequence[Sequence[float]] = ()
    patches: Sequence[Sequence[float]] = ()
    block: tuple[float, float] = (50.0, 50.0)
    lamp: float = math.inf


class TableRobot:
    """The robot as a port. imu_rate: Hz. lamp_port: analog port under the start light. losses: share of lost
    cycles."""

    def __init__(
        self,
        numbers: Numbers,
        floor: Floor,
        eyes: Sequence[Eye] = (),
        seed: int = 0,
        imu_rate: float = 50.0,
        gyro_noise: float = 0.002,
        lamp_port: int = 5,
        losses: float = 0.0,
    ) -> None:
        self.numbers, self.floor, self.eyes = numbers, floor, eyes
        self.written = Outputs()
        self.state = np.zeros(STATES)
        self.state[BUS] = self._bus = numbers.voc
        self.state[BLOCK_X], self.state[BLOCK_Y] = floor.block
        self._imu_rate, self._gyro_noise, self._losses = imu_rate, gyro_noise, losses
        self._lamp_port, self._imu_next = lamp_port, 0.0
        self._random = np.random.default_rng(seed)
        self._noise, self._row = np.empty((0, 16)), 0
        self._duty, self._brake = np.zeros(2), np.zeros(2)
        self._walls = np.array(floor.walls, float).reshape(-1, 4)
        self._patches = np.array(floor.patches, float).reshape(-1, 5)
        self._strips = np.array(floor.strips, float).reshape(-1, 5)
        self._phases = self._random.uniform(0.0, 2.0 * math.pi, 8)
        for _ in range(100):  # a controller runs long before its program
            self.read()

    def place(self, x: float, y: float, heading: float) -> None:
        """Somebody puts it there, at rest."""
        self.state[[X, Y, HEADING]] = x, y, heading
        self.state[[AHEAD, ASIDE, YAW, LEFT, RIGHT]] = 0.0

    def eye_at(self, eye: Eye) -> tuple[float, float]:
        """Where on the table a tophat is."""
        s = self.state
        cosine, sine = math.cos(s[HEADING]), math.sin(s[HEADING])
        return s[X] + eye.forward * cosine - eye.left * sine, s[Y] + eye.forward * sine + eye.left * cosine

    def write(self, outputs: Outputs) -> None:
        """The command holds from the next cycle on."""
        self.written = outputs

    def close(self) -> None:
        """Motors off."""
        self.written = Outputs()

    def read(self) -> Inputs:
        """Let a cycle pass."""
        if self._row >= len(self._noise):
            self._noise, self._row = self._random.standard_normal((ROWS, 16)), 0
        noise = self._noise[self._row]
        self._row += 1
        seconds = CYCLE + min(max(1e-4 * noise[0], -4e-4), 4e-4)
        s = self.state
        advance(self.numbers, s, seconds, self._duty, self._brake, self._walls, self._patches, noise[1:3])
        for side in range(2):  # RaccoonOS has 400 steps of duty
            self._duty[side] = round(400.0 * self.written.duty[side]) / 400.0
            self._brake[side] = self.written.brake[side]
        return self._inputs(noise)

    def _inputs(self, noise: Array) -> Inputs:
        s, p = self.state, self.numbers
        time = float(s[TIME])
        truth = Truth(float(s[X]), float(s[Y]), float(s[HEADING]))
        if self._losses and self._random.random() < self._losses:
            return Inputs(time, DEVICE, truth=truth)
        gyro = accel = None
        if time >= self._imu_next:
            self._imu_next += 1.0 / self._imu_rate
            rate = p.gyro_scale * s[CHIP_2] + p.gyro_bias + p.gyro_drift * time + self._gyro_noise * noise[3]
            gyro = (0.0, 0.0, float(round(rate / GYRO_WORD)))
            felt = (s[FELT_X] + 0.05 * noise[4], s[FELT_Y] + 0.05 * noise[5], GRAVITY + 0.05 * noise[6])
            accel = (round(felt[0] / ACCEL_WORD), round(felt[1] / ACCEL_WORD), round(felt[2] / ACCEL_WORD))
        filters = [float(each) if abs(each) >= DEAD_ZONE else 0.0 for each in s[FILTER_L : FILTER_R + 1]]
        self._bus += 0.22 * (s[BUS] - self._bus)
        return Inputs(
            time,
            DEVICE,
            bemf=(float(int(filters[0])), float(int(filters[1])), 0.0, 0.0),
            position=(float(int(s[COUNT_L])), float(int(s[COUNT_R])), 0.0, 0.0),
            gyro=gyro,
            accel=accel,
            analog=self._analog(time, noise),
            digital=(False,) * 10,
            battery=float(round((self._bus + 0.02 * noise[7]) / BATTERY_WORD)),
            truth=truth,
        )

    def _analog(self, time: float, noise: Array) -> tuple[float, ...]:
        counts = [2000.0 + 3.0 * noise[8]] * 6
        for k, eye in enumerate(self.eyes):
            share = darkness(*self.eye_at(eye), self._strips, SPOT)
            # Light adds up over the spot, and pulls the reading down against a resistor.
            light = (1.0 - share) * (4095.0 / eye.white - 1.0) + share * (4095.0 / eye.black - 1.0)
            level = 4095.0 / (1.0 + light) + eye.noise * noise[9 + k]
            level += eye.wander * math.sin(0.05 * time + self._phases[k])
            counts[eye.port] = float(min(max(round(level), 0), 4095))
        counts[self._lamp_port] = float(
            round((600.0 if time >= self.floor.lamp else 3000.0) + 4.0 * noise[15])
        )
        return tuple(counts)


def curve(x: float, y: float, radius: float, begin: float, end: float, half: float) -> list[list[float]]:
    """Strips along an arc about (x, y), from one angle to another."""
    angles = np.linspace(begin, end, max(round(abs(end - begin) / 0.1), 1) + 1)
    points = [(x + radius * math.cos(a), y + radius * math.sin(a)) for a in angles]
    return [[*a, *b, half] for a, b in pairwise(points)]


def drawn(rng: np.random.Generator, **fixed: float) -> Numbers:
    """A team's robot: two of the motors that the paper measured, 4 % apart at most, on any battery."""
    motors = ((1.7, 1.107, 0.166), (2.0, 1.080, 0.173), (1.7, 1.034, 0.258))
    (r_l, ke_l, c_l), (r_r, ke_r, c_r) = (motors[int(each)] for each in rng.integers(3, size=2))
    values: Mapping[str, float] = {
        "voc": rng.uniform(6.2, 7.0), "rint": rng.uniform(0.05, 0.12), "discharge": 0.0008,
        "resistance_l": r_l * rng.normal(1.0, 0.03), "resistance_r": r_r * rng.normal(1.0, 0.03),
        "ke_l": ke_l * rng.normal(1.0, 0.01), "ke_r": ke_r * rng.normal(1.0, 0.01),
        "coulomb_l": c_l, "coulomb_r": c_r, "stiction": rng.uniform(0.0, 0.06),
        "mass": rng.uniform(1.8, 3.2), "cg": rng.uniform(-0.025, 0.01), "grip": rng.uniform(0.7, 1.0),
        "runout": rng.uniform(0.0, 0.008), "track": 0.16 * rng.normal(1.0, 0.01),
        "radius_l": 0.0345 * rng.normal(1.0, 0.005), "radius_r": 0.0345 * rng.normal(1.0, 0.005),
        "tilt_x": rng.normal(0.0, 0.03), "tilt_y": rng.normal(0.0, 0.03),
        "offset_l": rng.normal(0.0, 30.0), "offset_r": rng.normal(0.0, 30.0),
        "gyro_bias": rng.normal(0.0, 0.005), "gyro_scale": rng.normal(1.0, 0.005),
        "gyro_drift": rng.normal(0.0, 1.0e-5),
    }  # fmt: skip
    return Numbers(**{**{name: float(each) for name, each in values.items()}, **fixed})
