"""How often `bumped()` sees that a robot drives into something, and how often it is wrong about that.

    python benchmarks/bumps.py [--impacts 8] [--drives 6] [--on stock 21 sim]

Impacts: with the front square, with a corner (a wall 25 degrees askew), at an object off the middle, at
several speeds and distances. Drives: straights, turns, arcs, hard starts and stops and spins at full power,
over a ramp of 10 degrees and down again, by the robot of robot.toml, with a tenth of all frames lost, and by
robots and on floors that robot.toml does not know. What the accelerometer felt is counted apart from what the
wheels carry and what else makes `bumped()` true.
"""

from __future__ import annotations

import argparse
import math
import random
from dataclasses import replace

from raccoon import (
    Action,
    Inputs,
    Outputs,
    Port,
    Robot,
    bumped,
    deg,
    drive,
    motors,
    open_robot,
    race,
    seq,
    straight,
    turn,
    wait,
    wait_for,
    when,
)
from raccoon.core.config import RobotConfig
from raccoon.hal.wombat.emulator import Firmware
from raccoon.robot.emulated import open_emulated
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.sim.world.table import Box, Ramp, Thing, Wall, World

CONFIG = RobotConfig()
SPEEDS = 0.05, 0.10, 0.15, 0.20, 0.30
FIRMWARES: dict[str, Firmware] = {"stock": "stock", "17": 17, "21": 21}
UP, DOWN = Box((0.3, -5.0), (0.7, 5.0)), Box((0.7, -5.0), (1.1, 5.0))
HILLY = World(ramps=(Ramp(UP, -0.088, 0.0), Ramp(DOWN, 0.088, 0.0)))
PLAIN = Parameters.from_robot(CONFIG)
CARPET = PLAIN.with_effect("friction.coulomb", torque=2.0 * CONFIG.model.friction.coulomb.value)
ROBOTS = {
    "carpet": CARPET,
    "battery 5.9 V": PLAIN.with_effect("battery.open_circuit_voltage", voltage=5.9),
    "battery 7.0 V": PLAIN.with_effect("battery.open_circuit_voltage", voltage=7.0),
    "motors 4 % apart": PLAIN.with_effect("motor.back_emf_constant", "left", factor=1.02).with_effect(
        "motor.back_emf_constant", "right", factor=0.98
    ),
    "resistance + 20 %": PLAIN.with_effect("motor.armature_resistance", factor=1.2),
    "inertia + 40 %": PLAIN.with_effect("drive.inertia", factor=1.4),
    "stiction": PLAIN.with_effect("friction.stiction", torque=0.12, speed=0.3),
    "pushing 0.3 kg": PLAIN.with_effect("drive.slope", along_x=-0.026, along_y=0.0),
    "scrub": PLAIN.with_effect("drive.turn_scrub", torque=0.06),
}


class Lossy:
    """A port of which a share of the frames is lost."""

    def __init__(self, port: Port, share: float, seed: int) -> None:
        self._port, self._share, self._random = port, share, random.Random(seed)

    def read(self) -> Inputs:
        inputs = self._port.read()
        if self._random.random() >= self._share:
            return inputs
        nothing = (None,) * 4
        return replace(inputs, bemf=nothing, position=nothing, gyro=None, accel=None)

    def write(self, outputs: Outputs) -> None:
        self._port.write(outputs)

    def close(self) -> None:
        self._port.close()


def port_of(kind: str, world: World, seed: int, robot: Parameters = PLAIN) -> Port:
    """The simulated robot as `kind` reads it."""
    if kind == "sim":
        return SimPort(robot, world, seed=seed)
    return open_emulated(CONFIG, FIRMWARES[kind], world=world, seed=seed, robot=robot)


def obstacle(what: str, distance: float) -> World:
    """Something that far ahead of the robot's origin."""
    if what == "object":
        return World(objects=(Thing((distance + 0.03, 0.04), 0.03),))
    askew = deg(25.0) if what == "corner" else 0.0
    x, y = distance * math.cos(askew), distance * math.sin(askew)
    along_x, along_y = -math.sin(askew), math.cos(askew)
    return World(walls=(Wall((x - along_x, y - along_y), (x + along_x, y + along_y)),))


def _felt(robot: Robot) -> bool:
    return any(why.startswith("bumped") for why in robot.estimate.reasons)


def is_bump_detected(kind: str, what: str, speed: float, seed: int) -> tuple[bool, bool]:
    """Whether the accelerometer felt it, and whether `bumped()` held within 1.5 s of it."""
    distance = (0.25 if what == "corner" else 0.2) + random.Random(seed).uniform(0.0, 0.02)
    with open_robot(CONFIG, port=port_of(kind, obstacle(what, distance), seed)) as robot:
        robot.run(wait(0.6))
        way = distance - CONFIG.body.front
        first, _ = robot.run(race(drive(speed), wait_for(bumped()), wait(way / speed + 1.5)))
        return _felt(robot), first == 1


def ordinary_drive(seed: int) -> Action[object]:
    """A drive of half a minute or so."""
    chance = random.Random(seed)
    hard = [
        seq(
            *(race(motors(a * power, b * power), wait(0.4)) for a, b in ((1, 1), (-1, 1), (-1, -1))),
            wait(0.3),
        )
        for power in (0.5, 1.0)
    ]
    parts: list[Action[object]] = []
    for _ in range(9):
        choice = [
            straight(chance.choice((-0.3, 0.3, 0.5)), speed=chance.choice((0.1, 0.2, 0.3))),
            turn(deg(chance.choice((-90.0, 90.0, 180.0)))),
            race(drive(chance.choice((-0.25, 0.15, 0.3))), wait(0.8)),
            race(drive(0.2, chance.choice((-1.5, 1.5))), wait(1.0)),
            *hard,
        ]
        parts.append(chance.choice(choice))
    return seq(wait(0.6), *parts)


def count_false_alarms(kind: str, seed: int, lost: float, plant: Parameters = PLAIN) -> tuple[int, float]:
    """How often bumped() came true on an ordinary drive, and how long it was."""
    with open_robot(CONFIG, port=Lossy(port_of(kind, HILLY, seed, plant), lost, seed)) as robot:
        held, count = False, 0
        holds = bumped().start(robot)

        def count_it(_: Robot) -> bool:
            nonlocal held, count
            now = holds()
            count += now and not held
            held = now
            return False

        robot.run(race(ordinary_drive(seed), wait_for(when(count_it))))
        return count, robot.time


def main() -> None:
    """Print both."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--impacts", type=int, default=8)
    parser.add_argument("--drives", type=int, default=6)
    parser.add_argument("--on", nargs="+", default=["stock", "21", "sim"], choices=[*FIRMWARES, "sim"])
    asked = parser.parse_args()
    print("seen of", asked.impacts, "impacts (of these by the accelerometer), at", *SPEEDS, "m/s")
    for kind in asked.on:
        for what in ("front", "corner", "object"):
            row = []
            for speed in SPEEDS:
                found = [is_bump_detected(kind, what, speed, seed) for seed in range(asked.impacts)]
                row.append(f"{sum(seen for _, seen in found)} ({sum(felt for felt, _ in found)})")
            print(f"{kind:6}{what:8}", "  ".join(f"{each:8}" for each in row), flush=True)
        said = {"plain": (PLAIN, 0.0), "a tenth lost": (PLAIN, 0.1)}
        for name, (plant, lost) in {**said, **{name: (plant, 0.0) for name, plant in ROBOTS.items()}}.items():
            each = [count_false_alarms(kind, seed, lost, plant) for seed in range(asked.drives)]
            false, seconds = sum(count for count, _ in each), sum(time for _, time in each)
            print(f"{kind:6}{false} false alarms in {seconds:.0f} s, {name}", flush=True)


if __name__ == "__main__":
    main()
