"""The simulated robot: how fast, how right, beside WPILib's simulation and MuJoCo in the same run.

    python benchmarks/plant.py [--seconds 20] [--recordings FOLDER]

Prints each figure as asked / measured / ratio. Speeds are robot-seconds a second of processor time, which a
busy neighbour on the same core still lowers; the peers drive the same manoeuvre with the same constants.
Needs the extras [sim] and [check]; what is absent is said so.
RACCOON_SHARED_DATA, or --recordings, names the folder that holds fleet-steps.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
import time
from collections.abc import Callable
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from raccoon import RobotConfig, deg, open_robot, repeat, seq, straight, turn, wait
from raccoon.core.readings import Outputs
from raccoon.sim.effects.catalogue import CATALOGUE
from raccoon.sim.effects.chain import FIRMWARE_IMU_HZ, Chain
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.sim.rollout.commands import Commands
from raccoon.sim.rollout.rollout import Lanes, rollout
from raccoon.sim.world.table import World

if TYPE_CHECKING:
    from peer_robots import MujocoRobot, WpilibRobot

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))
CHANNELS = ("motor.0.bemf", "motor.1.bemf", "imu.gyro.z", "battery.voltage")
MODELS = {
    "raccoon": "battery sag and discharge, heating, current limit, 6 friction terms with true sticking,"
    " backlash, slip, scrub, slope, run-out, latency, deadband, the controller's sensor chain",
    "WPILib": "two ideal motors, no friction, battery or slip",
    "MuJoCo": "ideal motors with dry and viscous friction, rigid contacts with friction cones",
}


def main() -> None:
    """Print every figure."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0] if __doc__ else None)
    parser.add_argument("--seconds", type=float, default=20.0, help="simulated seconds of a timed run")
    default = os.environ.get("RACCOON_SHARED_DATA", str(ROOT.parent / "shared" / "data"))
    parser.add_argument("--recordings", type=Path, default=Path(default))
    args = parser.parse_args()
    print(f"{'figure':72} {'asked':>10} {'measured':>12} {'ratio':>7}")
    ours = speeds(args.seconds)
    closed_loop()
    peers(ours)
    agreement()
    ideal()
    recordings(args.recordings / "fleet-steps")
    growth(args.seconds)
    matches()
    for name, what in MODELS.items():
        print(f"{name} models {what}.")


def line(name: str, asked: float | None, measured: float, unit: str = "", smaller: bool = False) -> None:
    """One row of the table."""
    if asked is None:
        print(f"{name:72} {'':>10} {measured:12,.4g} {unit}")
        return
    ratio = measured / asked if not smaller else asked / measured if measured else math.inf
    print(f"{name:72} {asked:10,.4g} {measured:12,.4g} {ratio:6.2f}x {unit}")


def timed(work: Callable[[], object], repeats: int = 3) -> float:
    """s of processor time of the fastest of some runs, after one to compile."""
    work()
    best = math.inf
    for _ in range(repeats):
        begun = time.process_time()
        work()
        best = min(best, time.process_time() - begun)
    return best


def manoeuvre(seconds: float) -> Commands:
    """Steps forward and back, one wheel half as hard as the other."""
    moments = np.arange(round(seconds * 200) + 1) * 0.005
    duty = np.where((moments * 1.25).astype(int) % 2 == 0, 0.8, -0.3)
    return Commands.of_wheels(moments, duty, 0.5 * duty)


def robots(count: int) -> list[Parameters]:
    """Robots that differ in a friction and an eccentricity."""
    plain = Parameters.from_robot(RobotConfig())
    return [
        plain.with_effect("friction.stiction", torque=0.05 * each / count).with_effect(
            "drive.wheel_eccentricity", "left", amplitude=0.05 * each / count
        )
        for each in range(count)
    ]


def speeds(seconds: float) -> dict[str, float]:
    """Rollout speeds, one robot and 256."""
    commands = manoeuvre(seconds)
    found = {}
    every = Parameters.from_robot(RobotConfig())
    for effect in CATALOGUE.values():
        if effect.group != "tophat":
            every = every.with_effect(effect.id)
    for name, step, asked in (("1 kHz physics", 0.001, 3000.0), ("0.4 kHz, the default", 0.0025, None)):
        one = timed(partial(rollout, every, commands, channels=CHANNELS, longest_step=step))
        found[name] = seconds / one
        line(f"one robot, rollout, {name}, all effects compiled in", asked, seconds / one)
    packed = Lanes.of(robots(256))
    for name, step, asked in (("1 kHz physics", 0.001, 50_000.0), ("0.4 kHz, the default", 0.0025, 50_000.0)):
        many = timed(partial(rollout, packed, commands, channels=CHANNELS, longest_step=step))
        line(f"256 robots in lanes, rollout, {name}, float64", asked, 256 * seconds / many)
    return found


def closed_loop() -> None:
    """A port alone, and a whole program on it."""
    port = SimPort(Parameters.from_robot(RobotConfig()), World.default())
    port.write(Outputs(duty=(0.4, 0.3, 0.0, 0.0)))

    def cycles() -> None:
        for _ in range(2000):
            port.read()

    line("closed loop, the simulated port alone", None, 10.0 / timed(cycles))
    line("closed loop, whole library in it: a square", 30.0, square_rate())
    for name, chain, rate in (("plain", Chain(), 200.0), ("firmware's", Chain.firmware(), FIRMWARE_IMU_HZ)):
        worst = max(square_error(chain, rate, seed) for seed in range(3))
        line(f"  end of the square, {name} sensor chain, worst of 3 seeds", None, 1e3 * worst, "mm off")


def square_error(chain: Chain, imu_rate_hz: float, seed: int) -> float:
    """m between start and end of a square that the library drives behind a sensor chain."""
    robot = Parameters.from_robot(RobotConfig()).with_chain(chain)
    port = SimPort(robot, World.default(), seed=seed, imu_rate_hz=imu_rate_hz)
    with open_robot(RobotConfig(), port=port) as library:
        library.run(seq(wait(1.0), repeat(seq(straight(0.30), turn(deg(90))), 4), wait(0.5)))
        end = port.read().truth
    return math.inf if end is None else math.hypot(end.x, end.y)


def square_rate() -> float:
    """Robot-seconds a second of a program that drives a square with everything on."""
    mission = repeat(seq(straight(0.30), turn(deg(90))), 4)
    rates = []
    for _ in range(3):
        port = SimPort(Parameters.from_robot(RobotConfig()), World.default())
        with open_robot(RobotConfig(), port=port) as robot:
            begun = time.process_time()
            robot.run(mission)
            rates.append(robot.time / (time.process_time() - begun))
    return max(rates)


def drive(robot: WpilibRobot | MujocoRobot, cycles: int) -> None:
    """Drive a peer's robot for some controller cycles."""
    for _ in range(cycles):
        robot.drive(0.6, 0.4)


def peers(ours: dict[str, float]) -> None:
    """The same straight drive in the simulators of others."""
    from peer_robots import Body, Motors, MujocoRobot, WpilibRobot

    own = ours["1 kHz physics"]
    if find_spec("wpilib"):
        wpilib = WpilibRobot(Body(), Motors())
        rate = 1.0 / timed(partial(drive, wpilib, 200))
        line(
            "WPILib's DifferentialDrivetrainSim at 5 ms", None, rate, f"raccoon is {own / rate:.0f}x as fast"
        )
    else:
        print("WPILib's simulation is not installed: pip install wpilib")
    if find_spec("mujoco"):
        mujoco = MujocoRobot(Body(), Motors(), step=0.001)
        rate = 1.0 / timed(partial(drive, mujoco, 200))
        line("MuJoCo at 1 ms", None, rate, f"raccoon is {own / rate:.0f}x as fast")
    else:
        print("MuJoCo is not installed: pip install mujoco")


def agreement() -> None:
    """How far MuJoCo's robot ends from ours after each manoeuvre."""
    if not find_spec("mujoco"):
        return
    from peer_manoeuvres import BODY, MANOEUVRES, ROWS, our_end
    from peer_robots import Motors, MujocoRobot

    for name, (left, right, brake, slope) in MANOEUVRES.items():
        peer = MujocoRobot(BODY, Motors(), slope)
        for row in range(ROWS - 1):
            peer.drive(left[row], right[row], closed=brake or left[row] != 0.0)
        pose, way = our_end(Motors(), left, right, brake, slope)
        off = 100.0 * math.dist(pose[:2], peer.pose[:2]) / way
        turned = abs(math.degrees(pose[2] - peer.pose[2]))
        line(f"MuJoCo, {name}: position, % of the way", 1.0, off, smaller=True)
        if turned > 1e-6:
            line(f"MuJoCo, {name}: heading, deg", 1.0, turned, smaller=True)


def ideal() -> None:
    """How far WPILib's robot ends from ours where neither has friction."""
    if not find_spec("wpilib"):
        return
    from peer_manoeuvres import BODY, MANOEUVRES, ROWS, our_end
    from peer_robots import Motors, WpilibRobot

    motors = Motors(coulomb=0.0, viscous=0.0)
    for name in ("straight", "turn", "arc"):
        left, right, brake, _ = MANOEUVRES[name]
        peer = WpilibRobot(BODY, motors)
        for row in range(ROWS - 1):
            peer.drive(left[row], right[row])
        pose, way = our_end(motors, left, right, brake)
        off = 100.0 * math.dist(pose[:2], peer.pose[:2]) / way
        line(f"WPILib, ideal motors, {name}: position, % of the way", 1.0, off, smaller=True)


def recordings(folder: Path) -> None:
    """Motors and batteries that were recorded by others."""
    if not folder.exists():
        print(f"no recordings at {folder}: their figures are left out")
        return
    import step_recordings as steps

    tables = steps.recordings(folder)
    wheels = [wheel for table in tables for wheel in steps.wheels(table)]
    models = {
        "R, K, J, friction": (),
        "... and latency": steps.LATENCY,
        f"... and {len(steps.EFFECTS)} effects at once": tuple(steps.EFFECTS),
    }
    for name, effects in models.items():
        fits = [steps.fitted(wheel, effects) for wheel in wheels]
        scores = [
            steps.held_out(wheel, numbers, effects) for wheel, numbers in zip(wheels, fits, strict=True)
        ]
        line(f"fleet steps held out, {name}: R2", 0.986, float(np.median([each.r2 for each in scores])))
        rmse = float(np.median([each.rmse for each in scores]))
        line(f"fleet steps held out, {name}: RMSE, m/s", 0.061, rmse, smaller=True)
        if effects == steps.LATENCY:
            line("  latency", None, 1e3 * float(np.median([numbers[5] for numbers in fits])), "ms")
    asked = [steps.supported(wheel) for wheel in wheels]
    for effect in steps.EFFECTS:
        count = sum(effect in each for each in asked)
        line(f"  wheels of {len(wheels)} whose fitted steps ask for {effect}", None, count)
    for name, split in (("0 V, fitted on 2, 4, -4 V", 0.503), ("-4 V and 0 V, fitted on 2, 4 V", 0.352)):
        sag = steps.sag(tables, split)
        for kind, value in (("", sag.own), (", fleet's R_i as prior", sag.shared)):
            line(f"battery sag held out ({name}){kind}, mV", 8.5, 1e3 * value, smaller=True)
        line("  without sag", None, 1e3 * sag.plain, "mV")
        line("  fitted to the judged part itself, the floor", None, 1e3 * sag.floor, "mV")


def growth(seconds: float) -> None:
    """Cost of rollouts against simulated time and against the number of robots."""
    single = Parameters.from_robot(RobotConfig())

    def one(part: int) -> float:
        commands = manoeuvre(seconds * part)
        return timed(lambda: rollout(single, commands, channels=CHANNELS), 5)

    def many(count: int) -> float:
        packed, commands = Lanes.of(robots(count)), manoeuvre(seconds / 4)
        return timed(lambda: rollout(packed, commands, channels=CHANNELS))

    line("rollout: cost of four times the time (4 is linear)", 4.0, one(8) / one(2), smaller=True)
    line("rollout: cost of four times the robots (4 is linear)", 4.0, many(512) / many(128), smaller=True)


MATCH = """
from raccoon import deg, repeat, seq, straight, turn
mission = repeat(seq(straight(0.30), turn(deg(90))), 1000)
"""


def matches() -> None:
    """Whole matches as a sweep plays them: what one costs, that many cost as many times it, and 1000 of them.

    A match is a process's business alone, so cores only divide the work; starting a process costs 2 s once.
    """
    from raccoon.sweep.factors import default_factors
    from raccoon.sweep.match import Match, play, seed_of
    from raccoon.sweep.program import Program

    def cost(seconds: float, runs: range) -> float:
        program = Program("squares.py", MATCH, str(ROOT))
        match = Match(program, RobotConfig(), default_factors(RobotConfig()), seconds=seconds)
        begun = time.process_time()
        for run in runs:
            play(match, run, seed_of(0, run))
        return time.process_time() - begun

    cost(5.0, range(1))
    short, one = cost(30.0, range(4)) / 4, cost(120.0, range(1))
    more = cost(120.0, range(1, 5))
    each = (one + more) / 5
    line("closed-loop match of 120 s, other robot each time: robot-s/s", 30.0, 120.0 / each)
    line("cost of a match of four times the time (4 is linear)", 4.0, each / short, smaller=True)
    line("cost of four times the matches (4 is linear)", 4.0, more / one, smaller=True)
    line("1000 matches of 120 s on 2 cores, from 5 of them", None, 1000 * each / 60 / 2, "min")
    line("... on 64 cores", None, 1000 * each / 60 / 64, "min")


if __name__ == "__main__":
    main()
