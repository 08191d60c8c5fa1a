"""A whole match: check the battery, wait for the light, run for at most 120 s, see what took how long.

It is recorded: `raccoon view match.jsonl.gz` draws it and prints what was said (match-2 of the next one).
"""

from raccoon import check_battery, deg, mission, open_robot, run_match, straight, timed, turn, wait_for_light


def main() -> None:
    """Run it on the robot that robot.toml names."""
    with open_robot("robot.toml", record="match") as robot:
        print(robot.run(check_battery()).advice)
        program = mission(straight(0.30), timed(turn(deg(90)), "face the poms"), straight(0.20))
        report = run_match(robot, program, start=wait_for_light(5))  # its sensor is on analog port 5
        print(report.table())


if __name__ == "__main__":
    main()
