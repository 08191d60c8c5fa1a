"""What was meant by an attribute that a robot does not have."""

from __future__ import annotations

import inspect
from importlib import import_module

ACTIONS = (
    "actions.actions",
    "actions.functions",
    "motions.driving",
    "motions.following",
    "motions.goals",
    "motions.lines",
    "motions.paths",
    "parts.mechanisms",
    "parts.servos",
)
"""Modules whose public functions make actions."""
ELSEWHERE = {
    **{name: f"robot.pose.{name}" for name in ("x", "y", "heading")},
    "distance": "robot.estimate.distance",
    "velocity": "robot.estimate.velocity",
    "gyro": "robot.estimate.turn_rate",
    "motor": "robot.run(motors(left, right).until(...))",
    "sleep": "robot.run(wait(seconds))",
}
"""What other libraries, and habit, call something that has another place here."""


def instead(name: str) -> str:
    """What to write instead of an attribute that a robot does not have; "" where nothing is like it."""
    for module in ACTIONS:
        found = getattr(import_module(f"{__package__}.{module}"), name, None)
        if inspect.isfunction(found) and found.__module__.endswith(module):
            return f": write robot.run({name}(...))"
    return f": write {ELSEWHERE[name]}" if name in ELSEWHERE else ""
