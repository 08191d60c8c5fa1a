"""How true the motions are: every figure asked of them, over batteries, motor pairings and seeds.

    python benchmarks/motions.py [--seeds 50] [--processes 2] [--json OUT]

Each robot has two of the paper's three motors, a battery of 6.1 to 7.0 V, back-EMF offsets as measured on
real controllers (30 counts, one standard deviation), the firmware's sensor chain (median of three, slots,
coasting windows), noise and an IMU at 50 Hz. It is calibrated as a team would: a taped straight drive of 1 m
whose tape is read to 1 mm (one standard deviation). Errors are of the true pose, 95th percentiles over every
pairing and seed, the batteries in turn (`--all` crosses them as well).
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np

from raccoon.control.feedforward import WheelModel
from raccoon.control.tuning import margins, speed_loop_gains
from raccoon.core.config import RobotConfig
from raccoon.core.readings import Truth
from raccoon.estimate.drive.wheel_track import SPEED_SMOOTHING
from raccoon.model.paper import MOTORS, PaperMotor
from raccoon.robot.actions import Action, Steps, repeat, seq, wait
from raccoon.robot.calibration import calibrate_drive
from raccoon.robot.drive import DEAD_TIME
from raccoon.robot.motions import straight, turn
from raccoon.robot.robot import Robot
from raccoon.sim.chain import Chain
from raccoon.sim.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.sim.world import World

BATTERIES = (6.1, 6.6, 7.0)
TAPE_STD = 0.001
OFFSET_STD = 30.0  # counts
IMU_RATE_HZ = 50.0
DEADBAND = 0.10
# The same 10 % of 6.6 V as a torque: 0.66 V / 1.8 ohm * 1.08 N m/A, less the Coulomb friction that is there.
STICTION = 0.66 / 1.8 * 1.08 - 0.18
DEG = math.pi / 180.0


@dataclass(frozen=True, slots=True)
class Case:
    """One robot: battery V, indices of the paper's motors, seed of everything random."""

    battery: float
    left: int
    right: int
    seed: int


def parameters_of(case: Case, config: RobotConfig) -> Parameters:
    """The simulated robot with the paper's motors in it."""
    parameters = Parameters.from_robot(config).with_chain(Chain.firmware())
    parameters = parameters.with_effect("battery.open_circuit_voltage", voltage=case.battery)
    offsets = OFFSET_STD * np.random.default_rng((case.seed, 11)).standard_normal(2)
    for side, index, offset in (("left", case.left, offsets[0]), ("right", case.right, offsets[1])):
        parameters = with_motor(parameters, side, MOTORS[index])
        parameters = parameters.with_effect("bemf.offset", side, counts=float(offset))
    return parameters


def simulated(parameters: Parameters, config: RobotConfig, seed: int) -> SimPort:
    """The robot on an endless white floor."""
    return SimPort(parameters, World.empty(), robot=config, seed=seed, imu_rate_hz=IMU_RATE_HZ)


def with_motor(parameters: Parameters, side: str, motor: PaperMotor) -> Parameters:
    """One of the paper's motors: resistance, constant and what its free current says of friction."""
    model = parameters.robot.model
    nominal = getattr(model, side)
    coulomb = motor.friction_torque - model.friction.viscous.value * motor.speed
    return (
        parameters.with_effect(
            "motor.armature_resistance",
            side,
            factor=motor.armature_resistance / nominal.armature_resistance.value,
        )
        .with_effect(
            "motor.back_emf_constant", side, factor=motor.back_emf_constant / nominal.back_emf_constant.value
        )
        .with_effect("friction.coulomb", side, torque=coulomb)
    )


def calibrated(case: Case, config: RobotConfig) -> RobotConfig:
    """The configuration after a taped drive of this robot."""
    draw = np.random.default_rng((case.seed, 7)).standard_normal()
    port = simulated(parameters_of(case, config), config, case.seed + 1_000_000)
    with Robot(port, config) as robot:

        def taped() -> float:
            end = robot.inputs.truth if robot.inputs else None
            assert end is not None
            return end.x + TAPE_STD * float(draw)

        return calibrate_drive(robot, taped, distance=1.0, tape_std=TAPE_STD)


@dataclass(frozen=True, slots=True)
class Error:
    """Ends of a motion against its goal: m, m, deg; s it took."""

    along: float
    across: float
    heading_deg: float
    seconds: float


def run(
    action: Action[object],
    goal: tuple[float, float, float],
    parameters: Parameters,
    config: RobotConfig,
    seed: int,
) -> Error:
    """Stand a second, do it, stand 0.3 s; the true end against the goal (x, y m, heading rad)."""
    port = simulated(parameters, config, seed)
    with Robot(port, config) as robot:
        robot.run(wait(1.0))
        begin = robot.time
        robot.run(action)
        seconds = robot.time - begin
        robot.run(wait(0.3))
        assert robot.inputs is not None
        end = robot.inputs.truth
    assert end is not None
    return error_of(end, goal, seconds)


def error_of(end: Truth, goal: tuple[float, float, float], seconds: float) -> Error:
    """Along and across the goal's heading."""
    dx, dy = end.x - goal[0], end.y - goal[1]
    cos, sin = math.cos(goal[2]), math.sin(goal[2])
    return Error(
        abs(dx * cos + dy * sin),
        abs(dy * cos - dx * sin),
        abs(end.heading - goal[2]) / DEG,
        seconds,
    )


QUARTER = math.pi / 2.0
MOTIONS: dict[str, tuple[Action[object], tuple[float, float, float]]] = {
    "straight": (straight(1.0), (1.0, 0.0, 0.0)),
    "turn": (turn(QUARTER), (0.0, 0.0, QUARTER)),
    "square": (repeat(seq(straight(0.5), turn(QUARTER)), 4), (0.0, 0.0, 4.0 * QUARTER)),
    "small": (straight(0.03), (0.03, 0.0, 0.0)),
    "small back": (straight(-0.03), (-0.03, 0.0, 0.0)),
    "small sticky": (straight(0.03), (0.03, 0.0, 0.0)),
}
EFFECTS: dict[str, tuple[str, dict[str, float]]] = {
    "small": ("actuation.deadband", {"duty": DEADBAND}),
    "small back": ("actuation.deadband", {"duty": DEADBAND}),
    "small sticky": ("friction.stiction", {"torque": STICTION, "speed": 0.5}),
}


def measure(case: Case) -> tuple[Case, dict[str, Error]]:
    """All motions of one robot."""
    bare = RobotConfig()
    config = calibrated(case, bare)
    parameters = parameters_of(case, bare)
    errors = {}
    for number, (name, (action, goal)) in enumerate(MOTIONS.items()):
        plant = parameters
        if name in EFFECTS:
            effect, values = EFFECTS[name]
            plant = plant.with_effect(effect, None, **values)
        errors[name] = run(action, goal, plant, config, case.seed * 10 + number)
    return case, errors


@dataclass(frozen=True, slots=True)
class Figure:
    """One line of the result: what is asked (at most) and what was measured."""

    name: str
    unit: str
    asked: float
    measured: float

    @property
    def met(self) -> bool:
        """Whether it is."""
        return self.measured <= self.asked


STEP_SPEED = 4.0  # rad/s; needs 4.7 V of a nominal wheel, so the weakest battery has something left
STEP_BATTERIES = (5.8, 6.4, 7.2)
BAND = 0.05


def step_response(
    battery: float, left: int, right: int, config: RobotConfig, seed: int
) -> tuple[float, float]:
    """(s until both wheels stay within 5 % of a step of speed, overshoot as a share), from the true pose."""
    case = Case(battery, left, right, seed)
    port = simulated(parameters_of(case, RobotConfig()), config, seed)
    radius, half = config.model.drive.wheel_radius.value, 0.5 * config.model.drive.track_width.value
    speeds: list[tuple[float, float]] = []
    with Robot(port, config) as robot:
        robot.run(wait(1.0))
        before = _truth(robot)

        def steps(robot: Robot) -> Steps[None]:
            nonlocal before
            for _ in range(121):
                robot.drive.velocity(STEP_SPEED * radius)
                yield
                here = _truth(robot)
                way = math.copysign(math.hypot(here.x - before.x, here.y - before.y), here.x - before.x)
                turned = half * (here.heading - before.heading)
                speeds.append(((way - turned) / radius / 0.005, (way + turned) / radius / 0.005))
                before = here

        robot.run(Action("step", steps))
    return _settled(speeds)


def _truth(robot: Robot) -> Truth:
    assert robot.inputs is not None
    assert robot.inputs.truth is not None
    return robot.inputs.truth


def _settled(speeds: list[tuple[float, float]]) -> tuple[float, float]:
    late, most = 0, 0.0
    for number, pair in enumerate(speeds):
        if any(abs(speed - STEP_SPEED) > BAND * STEP_SPEED for speed in pair):
            late = number + 1
        most = max(most, *pair)
    return late * 0.005, most / STEP_SPEED - 1.0


def step_figures(seeds: int) -> list[Figure]:
    """Speed loop: nominal wheels and every pairing, from 5.8 to 7.2 V; and the margins of every pairing."""
    bare = RobotConfig()
    found = []
    for seed, left, right in product(range(max(1, seeds // 5)), range(3), range(3)):
        config = calibrated(Case(6.6, left, right, seed), bare)
        found += [step_response(battery, left, right, config, seed) for battery in STEP_BATTERIES]
    constant = WheelModel(1.8, 1.08, 0.18, 0.004, 0.02).time_constant
    phase, gain = worst_margins()
    return [
        Figure("speed step: settles within 5 %", "s", 3.0 * constant + 0.010, _high([a for a, _ in found])),
        Figure("speed step: overshoot", "%", 5.0, 100.0 * _high([b for _, b in found])),
        Figure("missing phase margin below 45 deg", "deg", 0.0, max(0.0, 45.0 - phase)),
        Figure("missing gain margin below 6 dB", "dB", 0.0, max(0.0, 6.0 - gain)),
    ]


def worst_margins() -> tuple[float, float]:
    """(deg, dB) of the nominal gains on each of the paper's motors, and on a motor of half the K_E."""
    nominal = WheelModel(1.8, 1.08, 0.18, 0.004, 0.02)
    gains = speed_loop_gains(nominal, SPEED_SMOOTHING, DEAD_TIME)
    found = [
        margins(
            gains,
            WheelModel(motor.armature_resistance, motor.back_emf_constant, 0.18, 0.004, inertia),
            SPEED_SMOOTHING,
            DEAD_TIME,
        )
        for motor in MOTORS
        for inertia in (0.020, 0.014)
    ]
    return min(each.phase for each in found) / DEG, min(each.gain_db for each in found)


def _high(values: list[float]) -> float:
    return float(np.percentile(values, 95.0))


def cases(seeds: int, every: bool = False, thin: bool = False) -> Iterator[Case]:
    """Every pairing and seed with the batteries in turn, or every battery too; thin: one robot a seed."""
    if thin:
        for seed in range(seeds):
            pairing, battery = seed % 9, BATTERIES[(seed + seed // 9) % len(BATTERIES)]
            yield Case(battery, pairing // 3, pairing % 3, seed)
        return
    for seed, (number, (left, right)) in product(range(seeds), enumerate(product(range(3), range(3)))):
        turn_of = (number + number // 3 + seed) % len(BATTERIES)
        for index, battery in enumerate(BATTERIES):
            if every or index == turn_of:
                yield Case(battery, left, right, seed)


SMALL = {
    "small": "3 cm, 10 % dead band",
    "small back": "-3 cm, 10 % dead band",
    "small sticky": "3 cm, stiction of 10 %",
}


def turn_time_optimal(config: RobotConfig) -> float:
    """S of a quarter turn by the trapezoid at the same limits."""
    rate, gain = config.motion.turn_rate, config.motion.turn_acceleration
    return QUARTER / rate + rate / gain


def figures(errors: dict[str, list[Error]]) -> list[Figure]:
    """The 95th percentiles."""

    def high(name: str, field: str, scale: float = 1.0) -> float:
        return float(np.percentile([getattr(each, field) for each in errors[name]], 95.0)) * scale

    optimal = turn_time_optimal(RobotConfig())
    closing = [math.hypot(each.along, each.across) for each in errors["square"]]
    return [
        Figure("straight 1 m: distance", "mm", 3.0, high("straight", "along", 1e3)),
        Figure("straight 1 m: lateral", "mm", 5.0, high("straight", "across", 1e3)),
        Figure("straight 1 m: heading", "deg", 0.3, high("straight", "heading_deg")),
        Figure("turn 90: heading", "deg", 0.5, high("turn", "heading_deg")),
        Figure("turn 90: time over optimal", "", 1.3, high("turn", "seconds") / optimal),
        Figure("square 4 x 0.5 m: closing", "mm", 10.0, float(np.percentile(closing, 95.0)) * 1e3),
        Figure("square 4 x 0.5 m: heading", "deg", 1.0, high("square", "heading_deg")),
        *(
            line
            for name, words in SMALL.items()
            for line in (
                Figure(f"{words}: distance", "mm", 1.5, high(name, "along", 1e3)),
                Figure(f"{words}: time", "s", 1.0, high(name, "seconds")),
            )
        ),
    ]


def draw(lines: list[Figure], path: Path) -> None:
    """Each figure as a share of what is asked."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    shown = [line for line in lines if line.asked > 0.0][::-1]
    figure, axes = plt.subplots(figsize=(8.0, 4.2), layout="constrained")
    bars = axes.barh([line.name for line in shown], [line.measured / line.asked for line in shown])
    axes.bar_label(bars, [f"{line.measured:.3g} {line.unit}" for line in shown], padding=3, fontsize=8)
    axes.axvline(1.0, color="black", linewidth=1.0)
    axes.set_xlabel("95th percentile over what is asked")
    axes.set_xlim(0.0, 1.25)
    figure.savefig(path, format=path.suffix.lstrip(".") or "svg")
    plt.close(figure)


def main() -> int:
    """Measure and print; exit status 1 where a figure is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--all", action="store_true", help="every battery with every pairing and seed")
    parser.add_argument(
        "--thin", action="store_true", help="one robot a seed, pairings and batteries in turn"
    )
    parser.add_argument("--json")
    parser.add_argument("--plot", type=Path, help="draw the figures (needs matplotlib)")
    args = parser.parse_args()
    begin = time.perf_counter()
    errors: dict[str, list[Error]] = {name: [] for name in MOTIONS}
    worst: dict[str, tuple[float, Case]] = {}
    with ProcessPoolExecutor(args.processes) as pool:
        for case, found in pool.map(measure, cases(args.seeds, args.all, args.thin), chunksize=4):
            for name, error in found.items():
                errors[name].append(error)
                bad = max(error.along * 1e3, error.across * 1e3, error.heading_deg * 5.0)
                if bad > worst.get(name, (-1.0, case))[0]:
                    worst[name] = bad, case
    lines = figures(errors) + step_figures(args.seeds)
    print(f"{len(errors['turn'])} robots, {time.perf_counter() - begin:.0f} s")
    for line in lines:
        print(
            f"{'ok  ' if line.met else 'MISS'} {line.name:36} asked {line.asked:6g} {line.unit:4} "
            f"measured {line.measured:.3g}"
        )
    for name, (_, case) in worst.items():
        median = np.median([each.along for each in errors[name]]) * 1e3
        slow = max(each.seconds for each in errors[name])
        print(f"{name}: median distance error {median:.2f} mm, slowest {slow:.2f} s, worst {case}")
    if args.plot is not None:
        draw(lines, args.plot)
    if args.json:
        with open(args.json, "w", encoding="utf-8") as file:
            json.dump([{**{k: getattr(f, k) for k in Figure.__slots__}, "met": f.met} for f in lines], file)
    return 0 if all(line.met for line in lines) else 1


if __name__ == "__main__":
    sys.exit(main())
