"""Does one mission end at one place, whatever firmware the Wombat has?

    python benchmarks/same_place.py [RUNS]

The whole library on the emulator with the simulated robot, uncalibrated, one robot.toml for all three
firmwares. Each run has a fresh seed of all noise (printed); asked are at most 2 mm between any two true end
poses. "from goal": the furthest of the three from where the mission meant to end.
"""

from __future__ import annotations

import argparse
import math
import secrets
import sys
from itertools import combinations
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))

from contract.test_same_place import FIRMWARES, Mission, end_of
from raccoon.robot.motions.goals import straight, turn
from raccoon.robot.robot import Robot

LIMIT_MM = 2.0
RUNS = 5


def short_mission(robot: Robot) -> None:
    """Without a rest before it: the gyro's bias is not known."""
    robot.run(straight(0.5))
    robot.run(turn(math.pi / 2))


def long_mission(robot: Robot) -> None:
    """Two sides of a rectangle, after a rest that tells the gyro's bias."""
    for _ in range(400):
        robot.tick()
    for length in (0.4, 0.3):
        robot.run(straight(length))
        robot.run(turn(math.pi / 2))


def square(robot: Robot) -> None:
    """Half a metre to a side, there and round."""
    for _ in range(400):
        robot.tick()
    for _ in range(4):
        robot.run(straight(0.5))
        robot.run(turn(math.pi / 2))


MISSIONS: dict[str, tuple[Mission, tuple[float, float]]] = {
    "straight, turn": (short_mission, (0.5, 0.0)),
    "two straights, two turns": (long_mission, (0.4, 0.3)),
    "square": (square, (0.0, 0.0)),
}


def main() -> int:
    """Print the table; exit status 1 where a mission's median run is further apart than asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("runs", nargs="?", type=int, default=RUNS, help="runs of each mission")
    runs = parser.parse_args().runs
    print(f"{'mission':26}{'seed':>8}{'apart mm':>10}{'asked':>7}{'from goal mm':>14}")
    failed = False
    for name, (mission, goal) in MISSIONS.items():
        found = sorted(_run(name, mission, goal) for _ in range(runs))
        print(f"{name:26}{'median':>8}{found[runs // 2]:10.2f}{LIMIT_MM:7.1f}")
        failed = failed or found[runs // 2] > LIMIT_MM
    return 1 if failed else 0


def _run(name: str, mission: Mission, goal: tuple[float, float]) -> float:
    seed = secrets.randbelow(1_000_000)
    places = [end_of(mission, firmware, seed)[:2] for firmware in FIRMWARES]
    apart = 1e3 * max(math.dist(one, other) for one, other in combinations(places, 2))
    off = 1e3 * max(math.dist(place, goal) for place in places)
    print(f"{name:26}{seed:8}{apart:10.2f}{LIMIT_MM:7.1f}{off:14.2f}")
    return apart


if __name__ == "__main__":
    sys.exit(main())
