"""Gates: the lead (log evidence) that a cause needs to be named."""

from __future__ import annotations

import math
from collections.abc import Collection
from functools import cache

from raccoon.diagnose.hypotheses.coordinates import lookup_by_prefix

EVIDENCE_GATE = 8.0
"""Gate of most causes."""
LONE_GATE = 6.0
"""Gate of a single cause that chance does not imitate and beside which no other cause's form can be wrong: on
445 clean robots a motor or the IMU got 5.4 at most."""
LONE_WHEEL_GATE = 7.5
"""Gate of a single cause that is a wheel's radius. It got 6.7 and 7.0 on those robots: the uncertainties in
robot.toml of both wheels, the motors, the track width and the gyro add up in the turn rate."""
FLOOR_GATE = 15.0
"""Gate of effects that a real floor imitates in ways that no noise model contains: friction differs by
direction, and the floor's pushes have the largest effect while a robot creeps. On 105 clean robots stiction
got 13.7 and the scale of both readings 11.7; a deadband got 10.1 on one of 200, and 13.2 beside another
cause."""
WHEEL_GATE = 20.0
"""Gate of effects that hold back one wheel only, which a floor imitates best: a patch under one side."""
SLOPE_GATE = 11.0
"""Gate of a slope, which a floor imitates less well than the others, since the robot turns on it."""
SCALE_GATE = 11.0
"""Gate of the scale of one reading. Such a scale acts like wheels and motors that are far from robot.toml's
values."""
MANY_CAUSES = 4
"""Number of active causes from which others may have been missed, and a further one is not unexpected."""
CROWDED_CAUSES = 10
"""Number of active causes from which every further trial takes as long as the whole search of another
recording: only trials that are likely to change the outcome are made."""
_IMITATED_BY_NOISE = ("friction.", "drive.turn_scrub", "bemf.")
"""Prefixes of other causes that reach a lead of 6 and more by the noise of floor and readings."""
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
    """Gate of a cause, in log evidence. alone: whether no other cause is active."""
    if "@" in name and name.startswith(_ONE_WHEEL):
        return WHEEL_GATE
    needed = lookup_by_prefix(_GATES, name, EVIDENCE_GATE)
    if not alone or needed > EVIDENCE_GATE or name.startswith(_IMITATED_BY_NOISE):
        return needed
    return LONE_WHEEL_GATE if name.startswith("drive.wheel_radius") else LONE_GATE


def total_gate(names: Collection[str]) -> float:
    """Sum of the gates of a set of causes, in log evidence."""
    return sum(gate(each, alone=len(names) == 1) for each in names)


def log_odds_against_another(named: int, candidates: int) -> float:
    """Log odds against a further cause if `named` of `candidates` causes are named, by Laplace's rule of
    succession."""
    return math.log((candidates - named + 1) / (named + 1))
