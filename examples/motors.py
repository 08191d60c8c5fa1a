"""Plain duties for a second: what driving without control looks like."""

from raccoon import after_time, motors, open_robot, wait


def main() -> None:
    """Run it on the robot that robot.toml names."""
    with open_robot("robot.toml") as robot:
        robot.run(wait(1.0))
        robot.run(motors(0.8, 0.8).until(after_time(1.0)))
        print(f"went {robot.estimate.distance:.3f} m and turned {robot.pose.heading:+.3f} rad")


if __name__ == "__main__":
    main()
