"""Drive through points of the field without stopping at them."""

from raccoon import follow_path, open_robot, wait


def main() -> None:
    """Run it on the robot that robot.toml names."""
    with open_robot("robot.toml") as robot:
        robot.run(wait(1.0))
        end = robot.run(follow_path([(0.30, 0.0), (0.30, -0.30), (0.60, -0.30)], rounding=0.12))
        print(f"ended {1000 * end.along:+.1f} mm along and {1000 * end.across:+.1f} mm beside the mark")


if __name__ == "__main__":
    main()
