"""Drive to places of the field, forwards and with the back first."""

from raccoon import deg, drive_to, open_robot, seq, wait


def main() -> None:
    """Run it on the robot that robot.toml names."""
    with open_robot("robot.toml") as robot:
        robot.run(wait(1.0))
        _, end = robot.run(seq(drive_to(0.40, -0.20, deg(90)), drive_to(0.0, 0.0, 0.0, backwards=True)))
        print(f"ended {1000 * end.along:+.1f} mm along and {1000 * end.across:+.1f} mm beside the mark")


if __name__ == "__main__":
    main()
