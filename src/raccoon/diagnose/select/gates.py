"""Gates: the log evidence that a cause must add to be named."""

from __future__ import annotations

import math
from collections.abc import Collection
from functools import cache

from raccoon.diagnose.hypotheses.coordinates import lookup_by_prefix

EVIDENCE_GATE = 8.0
"""For most causes."""
LONE_GATE = 6.0
"""For a cause alone, beside which no form could be wrong and which chance does not imitate: on 445 clean
robots a motor or the IMU got 5.4 at most."""
LONE_WHEEL_GATE = 7.5
"""For a wheel's radius alone. It got 6.7 and 7.0 there: what robot.toml leaves open of both wheels, of the
motors, the track and the gyro adds up in the turn rate."""
FLOOR_GATE = 15.0
"""For what a real floor imitates in ways that no noise model holds: it differs by direction, and pushes tell
most where a robot creeps. On 105 clean robots stiction got 13.7 and the scale of both readings 11.7; a
deadband got 10.1 on one of 200, and 13.2 beside another cause."""
WHEEL_GATE = 20.0
"""For what holds back one wheel only, which a floor imitates best: by a patch under one side."""
SLOPE_GATE = 11.0
"""For a slope, which a floor imitates less well than the others: the robot turns on it."""
SCALE_GATE = 11.0
"""For the scale of one reading, which differs from the other's like wheels and motors that are far out in
robot.toml."""
MANY_CAUSES = 4
"""Active causes from which others may have been missed, and one more is no surprise."""
CROWDED_CAUSES = 10
"""Active causes beside which every further trial takes as long as the whole search of another recording: only
trials that may well change the outcome are made."""
_IMITATED_BY_NOISE = ("friction.", "drive.turn_scrub", "bemf.")
"""Other causes for which the noise of floor and readings gets 6 and more."""
_ONE_WHEEL = ("friction.", "actuation.deadband")
_GATES = {
    "friction.direction_dependent": FLOOR_GATE,
    "friction.stiction": FLOOR_GATE,
    "actuation.deadband": FLOOR_GATE,
    "bemf.scale@": SCALE_GATE,
    "bemf.scale": FLOOR_GATE,
    "drive.slope": SLOPE_GATE,
}


@cache
def gate(name: str, alone: bool = False) -> float:
    """Log evidence from which a cause is named. alone: with no other beside it."""
    if "@" in name and name.startswith(_ONE_WHEEL):
        return WHEEL_GATE
    needed = lookup_by_prefix(_GATES, name, EVIDENCE_GATE)
    if not alone or needed > EVIDENCE_GATE or name.startswith(_IMITATED_BY_NOISE):
        return needed
    return LONE_WHEEL_GATE if name.startswith("drive.wheel_radius") else LONE_GATE


def total_gate(names: Collection[str]) -> float:
    """Log evidence that a set of causes must have."""
    return sum(gate(each, alone=len(names) == 1) for each in names)


def log_odds_against_another(named: int, candidates: int) -> float:
    """Log odds against a further cause, where `named` of `candidates` are named: Laplace's rule of
    succession."""
    return math.log((candidates - named + 1) / (named + 1))
