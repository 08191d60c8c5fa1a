"""Drive around a bend, and backwards out of it again."""

from raccoon import arc, deg, open_robot, seq, wait


def main() -> None:
    """Run it on the robot that robot.toml names."""
    with open_robot("robot.toml") as robot:
        robot.run(wait(1.0))
        _, end = robot.run(seq(arc(0.25, deg(90)), arc(0.25, deg(-90), backwards=True)))
        print(f"ended {1000 * end.along:+.1f} mm along and {1000 * end.across:+.1f} mm beside the mark")


if __name__ == "__main__":
    main()
