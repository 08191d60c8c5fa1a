"""A robot that is lifted during the drive of a calibration: its wheels go on, and the air reads black."""

from dataclasses import replace
from random import Random

import pytest

from raccoon import calibrate_tophats, open_robot, wait
from raccoon.core.readings import Inputs
from raccoon.sim.world.table import Line, World
from robots import CONFIG, InterceptingPort, simulated_port

AIR_COUNTS, SECONDS = 3950.0, 2.0
LINE = World(lines=(Line(((0.2, -1.0), (0.2, 1.0))),))


@pytest.mark.parametrize("lifted_at", [1.5, 3.0, None])
def test_black_that_is_wider_than_any_line_is_said(lifted_at: float | None) -> None:
    """Lifted from the line, or behind it."""
    rng = Random(1)

    def seen(inputs: Inputs) -> Inputs:
        if lifted_at is None or not lifted_at < inputs.time < lifted_at + SECONDS:
            return inputs
        return replace(inputs, analog=tuple(round(rng.gauss(AIR_COUNTS, 25.0)) for _ in inputs.analog))

    port = InterceptingPort(simulated_port(world=LINE), seen=seen)
    with open_robot(CONFIG, port=port) as robot:
        robot.run(wait(0.3))
        calibrate_tophats(robot, 0.6)
    said = [each for each in port.notes if "no line is so wide: if the robot was lifted" in each]
    named = [
        name for name in ("left", "right") for each in said if f"tophat {name} read black for 0." in each
    ]
    assert named == ([] if lifted_at is None else ["left", "right"])
