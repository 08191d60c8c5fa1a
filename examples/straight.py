"""Drive half a metre and back, and say how true it was."""

from raccoon import open_robot, seq, straight, wait


def main() -> None:
    """Run it on the robot that robot.toml names."""
    with open_robot("robot.toml") as robot:
        robot.run(wait(1.0))  # standing still, the estimators learn the sensors' offsets
        _, end = robot.run(seq(straight(0.50), straight(-0.50, speed=0.10)))
        print(f"ended {1000 * end.along:+.1f} mm along and {1000 * end.across:+.1f} mm beside the mark")


if __name__ == "__main__":
    main()
