"""What a team sees that prints what the robot gives it."""

import re

from raccoon import open_robot, run_match, wait
from robots import CONFIG, simulated_port


def test_what_a_robot_gives_says_itself() -> None:
    opening = open_robot(CONFIG, port=simulated_port())
    assert "with open_robot(...) as robot" in repr(opening)
    with opening as robot:
        robot.run(wait(0.5))
        said = f"{robot.estimate}"
        assert said.startswith(f"{robot.pose} (+- "), said
        assert re.search(r" mm, \d+\.\d\d deg\), 0\.0\d\d m/s, -?0\.0\d\d rad/s, ok$", said)
        pack = f"{robot.pack.estimate}"
        assert re.fullmatch(
            r"charge \d+ % \(\+- \d+\), open-circuit 6\.\d\d V \(\+- .*\), internal 0\.\d{3} ohm \(.*\), \w+",
            pack,
        )
        report = run_match(robot, wait(0.1))
    assert f"{report}" == report.table()
