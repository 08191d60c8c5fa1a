"""Walls that a robot can push against: what it draws, turns and feels there, against what can be worked out.

A wall carries what the motors push, up to the tyres' grip; beyond, the wheels spin. The numbers are those of
the default robot: tyres that hold 0.9 of 3 kg, so 0.457 N m at each wheel.
"""

import math
from dataclasses import replace

import numpy as np
import pytest

from raccoon.core.config import BodyConfig, FrictionModel, RobotConfig
from raccoon.core.readings import GRAVITY, Inputs, Outputs, Truth
from raccoon.core.schema import Measured
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.effects.physical import plant_numbers
from raccoon.sim.plant.quantities import Plant, State
from raccoon.sim.port import SimPort
from raccoon.sim.world.contact import DAMPING, STIFFNESS, WALL_FRICTION, Contact
from raccoon.sim.world.table import Box, Ramp, Thing, Wall, World, walls_around

ROBOT = RobotConfig()
MODEL = ROBOT.model
R, K = MODEL.left.armature_resistance.value, MODEL.left.back_emf_constant.value
COULOMB, VISCOUS = MODEL.friction.coulomb.value, MODEL.friction.viscous.value
FULL, INSIDE = MODEL.battery.open_circuit_voltage.value, MODEL.battery.internal_resistance.value
RADIUS, TRACK = MODEL.drive.wheel_radius.value, MODEL.drive.track_width.value
FRONT = ROBOT.body.front
GRIP = 0.5 * ROBOT.body.grip * ROBOT.body.mass * GRAVITY * RADIUS
"""N m that a tyre carries."""
AHEAD = 0.2
WALL = World(walls=(Wall((AHEAD, -2.0), (AHEAD, 2.0)),))
LOOSE = (
    ("friction.presliding", {"compliance": 0.05, "damping": 0.1}),
    ("drive.backlash", {"angle": 0.05}),
    ("drive.wheel_slip", {"time": 0.02}),
    ("drive.wheel_eccentricity", {"amplitude": 0.02}),
)
WEAK, STRONG = 0.12, 0.6
"""Duties: 0.24 N m beyond friction against the grip's 0.46, and 2.3 N m."""


class Run:
    """A robot without noise, driven by duties."""

    def __init__(
        self,
        world: World = WALL,
        start: tuple[float, float, float] = (0.0, 0.0, 0.0),
        robot: Parameters | None = None,
        rate_hz: float = 200.0,
    ) -> None:
        plain = Parameters.from_robot(ROBOT)
        self.port = SimPort(robot or plain, world, noise=False, start=start, rate_hz=rate_hz)
        self.rate_hz = rate_hz
        self.inputs: Inputs = self.port.read()

    def drive(self, left: float, right: float, seconds: float) -> Truth:
        """Where it ends; both motors are connected, also at duty 0."""
        self.port.write(Outputs(duty=(left, right, 0.0, 0.0), brake=(True, True, False, False)))
        for _ in range(round(seconds * self.rate_hz)):
            self.inputs = self.port.read()
        return self.truth

    @property
    def truth(self) -> Truth:
        assert self.inputs.truth is not None
        return self.inputs.truth

    @property
    def state(self) -> State:
        return self.port._robot.state

    @property
    def loads(self) -> tuple[float, float]:
        """N m that the wall puts on the wheels."""
        return self.port._robot._contact.loads


def current(duty: float, speed: float) -> float:
    """A in each of two motors at duty (0..1) and speed, from one battery."""
    volts = FULL
    for _ in range(100):
        volts = FULL - INSIDE * 2.0 * duty * (duty * volts - K * speed) / R
    return (duty * volts - K * speed) / R


def spinning(duty: float) -> float:
    """rad/s at which the motor's torque is what friction and the grip take."""
    low, high = 0.0, 10.0
    for _ in range(100):
        speed = 0.5 * (low + high)
        more = K * current(duty, speed) > COULOMB + VISCOUS * speed + GRIP
        low, high = (speed, high) if more else (low, speed)
    return speed


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_weak_motors_stall_at_a_wall_and_draw_the_stall_current(sign: float) -> None:
    run = Run(start=(0.07, 0.0, 0.0 if sign > 0.0 else math.pi))
    run.drive(sign * WEAK, sign * WEAK, 4.0)
    assert (run.state.speed_left, run.state.speed_right) == (0.0, 0.0)
    assert run.inputs.bemf[:2] == (0, 0)
    assert sign * run.state.current_left == pytest.approx(current(WEAK, 0.0), rel=1e-9)
    # Dry friction may carry any share up to its size; the wall has the rest.
    push = K * current(WEAK, 0.0)
    assert push - COULOMB - 1e-6 <= -sign * run.loads[0] <= push + COULOMB
    assert run.truth.x == pytest.approx(AHEAD - FRONT, abs=5e-4)


@pytest.mark.parametrize("duty", [0.25, STRONG, 1.0])
def test_strong_motors_spin_their_wheels_at_the_limit_of_the_grip(duty: float) -> None:
    run = Run()
    reached = run.drive(duty, duty, 4.0)
    assert run.loads == pytest.approx((-GRIP, -GRIP), rel=1e-9)
    assert run.state.speed_left == pytest.approx(spinning(duty), rel=1e-4)
    ticks = run.inputs.position[0] or 0
    later = run.drive(duty, duty, 1.0)
    assert later.x == pytest.approx(reached.x, abs=1e-9)  # held ...
    turned = ((run.inputs.position[0] or 0) - ticks) / (K * 303.4)
    assert turned == pytest.approx(spinning(duty), rel=1e-2)  # ... while its counters go on
    assert run.state.forward_speed == pytest.approx(0.0, abs=1e-9)


def test_the_grip_decides_which_it_is() -> None:
    heavy = Parameters.from_robot(replace(ROBOT, body=BodyConfig(mass=20.0)))
    run = Run(robot=heavy)
    run.drive(0.4, 0.4, 4.0)
    assert run.state.speed_left == 0.0
    assert spinning(0.4) > 1.0


@pytest.mark.parametrize(
    ("duty", "heading_deg", "backwards"),
    [
        (WEAK, 10.0, False),
        (STRONG, 10.0, True),
        (WEAK, -10.0, True),
        (STRONG, -10.0, False),
        (WEAK, 25.0, False),
    ],
)
def test_a_robot_that_meets_a_wall_askew_ends_square_to_it_and_stands(
    duty: float, heading_deg: float, backwards: bool
) -> None:
    sign, square = (-1.0, math.pi) if backwards else (1.0, 0.0)
    run = Run(start=(0.07, 0.0, square + math.radians(heading_deg)))
    reached = run.drive(sign * duty, sign * duty, 9.0 if duty == WEAK else 5.0)
    assert math.degrees(reached.heading - square) == pytest.approx(0.0, abs=0.1)
    assert reached.x == pytest.approx(AHEAD - FRONT, abs=5e-4)
    later = run.drive(sign * duty, sign * duty, 1.0)
    assert (later.x, later.y, later.heading) == pytest.approx(
        (reached.x, reached.y, reached.heading), abs=1e-6
    )


@pytest.mark.parametrize(
    ("effect", "values", "duty"),
    [(*LOOSE[0], STRONG), *((*each, (WEAK, STRONG)[number % 2]) for number, each in enumerate(LOOSE))],
)
def test_loose_gears_and_soft_tyres_stand_at_a_wall_as_well(
    effect: str, values: dict[str, float], duty: float
) -> None:
    run = Run(start=(0.07, 0.0, 0.15), robot=Parameters.from_robot(ROBOT).with_effect(effect, None, **values))
    reached = run.drive(duty, duty, 7.0)
    assert reached.heading == pytest.approx(0.0, abs=math.radians(0.1))
    later = run.drive(duty, duty, 0.5)
    assert (later.x, later.y, later.heading) == pytest.approx(
        (reached.x, reached.y, reached.heading), abs=1e-5
    )


@pytest.mark.parametrize("duty", [WEAK, STRONG])
def test_what_is_mirrored_goes_the_mirrored_way(duty: float) -> None:
    left, right = Run(start=(0.0, 0.0, 0.2)), Run(start=(0.0, 0.0, -0.2))
    for _ in range(8):
        one, other = left.drive(duty, duty, 0.5), right.drive(duty, duty, 0.5)
        assert (one.x, one.y, one.heading) == pytest.approx((other.x, -other.y, -other.heading), abs=1e-9)


def test_while_it_squares_up_the_forces_are_those_of_one_corner_that_slides() -> None:
    """F at the right corner, square to the wall, and a fifth of it along: against the way the corner goes."""
    run = Run(start=(0.07, 0.0, math.radians(25.0)))
    run.drive(STRONG, STRONG, 0.4)
    heading, (left, right) = run.truth.heading, run.loads
    assert right == pytest.approx(-GRIP, rel=1e-9)  # spins; the left wheel rolls
    assert math.radians(5.0) < heading < math.radians(24.0)
    cosine, sine = math.cos(heading), math.sin(heading)
    ahead = -cosine + WALL_FRICTION * sine
    moment = 0.09 * (sine + WALL_FRICTION * cosine) + 0.09 * ahead
    shares = 0.5 * ahead - moment / TRACK, 0.5 * ahead + moment / TRACK
    assert left / right == pytest.approx(shares[0] / shares[1], abs=0.01)


def test_the_gyro_feels_the_turn_that_counters_of_a_spinning_wheel_miss() -> None:
    run = Run(start=(0.08, 0.0, math.radians(10.0)))
    begin, turned = run.inputs, 0.0
    for _ in range(600):
        run.drive(STRONG, STRONG, 0.005)
        assert run.inputs.gyro is not None
        turned += (run.inputs.gyro[2] or 0.0) * run.inputs.device.gyro_rad_s * 0.005
    assert math.degrees(turned) == pytest.approx(-10.0, abs=0.1)
    ticks = [(run.inputs.position[side] or 0) - (begin.position[side] or 0) for side in (0, 1)]
    counted = (ticks[1] - ticks[0]) / (K * 303.4) * RADIUS / TRACK
    assert abs(math.degrees(counted) + 10.0) > 2.0


def test_counters_see_the_turn_of_wheels_that_only_stall() -> None:
    heavy = Parameters.from_robot(replace(ROBOT, body=BodyConfig(mass=30.0)))
    run = Run(start=(0.09, 0.0, math.radians(10.0)), robot=heavy)
    run.drive(WEAK, WEAK, 8.0)
    ticks = [run.inputs.position[side] or 0 for side in (0, 1)]
    counted = (ticks[1] - ticks[0]) / (K * 303.4) * RADIUS / TRACK
    assert math.degrees(counted) == pytest.approx(-10.0, abs=0.3)
    assert math.degrees(run.truth.heading) == pytest.approx(0.0, abs=0.1)


def test_a_robot_that_comes_at_a_flat_angle_slides_along_the_wall() -> None:
    run = Run(World(walls=(Wall((-1.0, 0.3), (9.0, 0.3)),)), start=(0.0, 0.1, 0.3))
    run.drive(1.0, 1.0, 6.0)
    begin = run.truth
    end = run.drive(1.0, 1.0, 1.0)
    free = Run(World.empty())
    free.drive(1.0, 1.0, 1.0)
    assert end.y == pytest.approx(0.3 - 0.5 * ROBOT.body.width, abs=1e-3)
    assert math.degrees(end.heading) == pytest.approx(0.0, abs=0.1)
    assert end.x - begin.x == pytest.approx(RADIUS * free.state.speed_left, rel=2e-3)


def test_leaving_a_wall_costs_nothing() -> None:
    pushed, free = Run(start=(0.09, 0.0, 0.0)), Run(World.empty())
    begin = pushed.drive(WEAK, WEAK, 4.0).x
    for _ in range(10):
        one, other = pushed.drive(-0.5, -0.5, 0.1), free.drive(-0.5, -0.5, 0.1)
        assert one.x - begin == pytest.approx(other.x, abs=3e-4)  # the spring's way
        assert one.heading == 0.0


def test_away_from_walls_not_a_bit_changes() -> None:
    walled, free = Run(World(walls=walls_around(Box((-1.0, -1.0), (1.0, 1.0))))), Run(World.empty())
    for left, right in ((0.7, 0.6), (-0.4, 0.9), (0.0, 0.0), (-1.0, -0.8)):
        walled.drive(left, right, 0.5)
        free.drive(left, right, 0.5)
        assert walled.state == free.state
        assert walled.inputs == free.inputs


def test_a_post_in_the_middle_holds_the_robot_as_a_wall_does() -> None:
    run = Run(World(objects=(Thing((AHEAD, 0.0), 0.03),)))
    end = run.drive(STRONG, STRONG, 3.0)
    assert (end.x, end.y, end.heading) == pytest.approx((AHEAD - 0.03 - FRONT, 0.0, 0.0), abs=5e-4)
    assert run.loads == pytest.approx((-GRIP, -GRIP), rel=1e-9)


def test_a_post_beside_the_middle_turns_the_robot_to_its_own_side() -> None:
    run = Run(World(objects=(Thing((AHEAD, 0.06), 0.02),)))
    assert run.drive(STRONG, STRONG, 1.5).heading > math.radians(5.0)


def test_a_ramp_still_pulls_at_a_wall() -> None:
    world = replace(WALL, ramps=(Ramp(Box((-9.0, -9.0), (9.0, 9.0)), along_x=0.4),))
    run = Run(world, start=(0.09, 0.0, 0.0))
    run.drive(0.0, 0.0, 4.0)
    assert run.truth.x == pytest.approx(AHEAD - FRONT, abs=5e-4)
    assert 0.4 - COULOMB - 1e-6 <= -run.loads[0] <= 0.4 + COULOMB


@pytest.mark.parametrize("rate_hz", [50.0, 500.0])
def test_at_every_rate_the_robot_stands_and_nothing_swings(rate_hz: float) -> None:
    run = Run(start=(0.09, 0.0, 0.1), rate_hz=rate_hz)
    reached = run.drive(WEAK, WEAK, 6.0)
    later = run.drive(WEAK, WEAK, 0.5)
    assert (later.x, later.heading) == pytest.approx((reached.x, reached.heading), abs=1e-5)
    assert later.heading == pytest.approx(0.0, abs=math.radians(0.1))
    # What a spring is late by must not push too hard, so a wall gives with the square of the period.
    assert AHEAD - FRONT < later.x < AHEAD - FRONT + 13.0 / rate_hz**2


def test_a_robot_that_is_put_into_a_wall_is_pushed_out_by_its_grip_alone() -> None:
    run = Run(start=(AHEAD - FRONT + 0.03, 0.0, 0.0))
    end = run.drive(0.0, 0.0, 1.0)
    assert end.x == pytest.approx(AHEAD - FRONT, abs=5e-4)
    assert abs(run.state.speed_left) < 1e-6


@pytest.mark.parametrize("touches", [1, 2, 3, 4, 5])
def test_a_force_that_comes_a_period_late_is_stable(touches: int) -> None:
    spring, damper = touches * STIFFNESS, touches * DAMPING
    late = [1.0, -2.0 + 0.5 * (spring + damper), 1.0 + 0.5 * spring, -0.5 * damper]
    assert max(abs(np.roots(late))) < 1.0


@pytest.mark.parametrize("seed", range(8))
def test_contact_adds_no_energy(seed: int) -> None:
    """A robot without any friction of its own that rolls among walls and objects, motors off."""
    random = np.random.default_rng(seed)
    smooth = replace(MODEL, friction=FrictionModel(Measured(0.0), Measured(0.0)))
    body = BodyConfig(
        front=random.uniform(0.0, 0.2),
        back=random.uniform(0.0, 0.2),
        width=random.uniform(0.05, 0.3),
        grip=random.choice([0.1, 0.9, 3.0]),
    )
    objects = (Thing((-0.4, -0.3), 0.05), Thing((0.45, -0.2), 0.02))
    world = World(walls=walls_around(Box((-0.6, -0.6), (0.6, 0.6))), objects=objects)
    robot = Parameters.from_robot(replace(ROBOT, model=smooth, body=body))
    run = Run(world, (0.0, 0.0, random.uniform(-3.0, 3.0)), robot)
    plant, moving = plant_numbers(robot), run.port._robot
    left, right = (random.choice([-6.0, 6.0]) + random.uniform(-1.0, 1.0, size=2)).tolist()
    moving._rolled = moving._rolled._replace(
        speed_left=left, speed_right=right, wheel_left=left, wheel_right=right,
        rolling_left=left, rolling_right=right,
    )  # fmt: skip
    energy = kinetic_energy(plant, run.state)
    met = False
    for _ in range(800):
        run.inputs = run.port.read()
        now = kinetic_energy(plant, run.state)
        assert now <= energy * (1.0 + 1e-9)
        if run.loads == (0.0, 0.0):  # what a spring holds it gives back
            energy = now
        else:
            met = True
    assert met


def kinetic_energy(plant: Plant, state: State) -> float:
    left, right = state.speed_left, state.speed_right
    return 0.5 * plant.inertia_own * (left * left + right * right) + plant.inertia_other * left * right


def test_with_more_room_in_front_it_stands_further_away() -> None:
    long = replace(
        ROBOT,
        body=BodyConfig(front=0.15),
        model=replace(MODEL, friction=replace(MODEL.friction, coulomb=Measured(0.0))),
    )
    run = Run(robot=Parameters.from_robot(long))
    assert run.drive(0.1, 0.1, 6.0).x == pytest.approx(AHEAD - 0.15, abs=5e-4)
    # Without dry friction the wall carries all that the motors push.
    assert -run.loads[0] == pytest.approx(K * run.state.current_left, rel=1e-6)


def test_no_time_no_slip() -> None:
    contact = Contact(WALL, ROBOT.body, plant_numbers(Parameters()), 0.005, (0.0, 0.0, 0.0))
    assert contact.resolve((AHEAD, 0.0, 0.0), 0.0) == (AHEAD, 0.0, 0.0)
    assert contact.loads == (0.0, 0.0)
