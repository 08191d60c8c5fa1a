"""The names of sets of calibrations: one that is no text would stand in a file that nobody can read again."""

from pathlib import Path
from typing import Any

import pytest

from raccoon import calibrate_tophats, load_tophats, open_robot
from robots import CONFIG, simulated_port

NUMBER: Any = 5


def test_a_set_that_is_no_text_is_refused_before_the_drive(tmp_path: Path) -> None:
    store = tmp_path / "tophats.json"
    with open_robot(CONFIG, port=simulated_port()) as robot:
        with pytest.raises(TypeError, match="set_name is 5: it must be a text"):
            calibrate_tophats(robot, 0.3, store=store, set_name=NUMBER)
        with pytest.raises(TypeError, match="set_name is 5: it must be a text"):
            load_tophats(robot, store, NUMBER)
        assert robot.ticks == 0
    assert not list(tmp_path.iterdir())
