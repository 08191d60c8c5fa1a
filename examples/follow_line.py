"""Follow the left edge of the line that leads from one crossing line to the next."""

from raccoon import after_distance, calibrate_tophats, follow_line, open_robot, wait


def main() -> None:
    """Run it on the robot that robot.toml names."""
    with open_robot("robot.toml") as robot:
        robot.run(wait(1.0))
        calibrate_tophats(robot, distance=1.0)
        robot.run(follow_line("front", "left", speed=0.10).until(after_distance(0.30)))
        print(
            f"x {robot.pose.x:.3f} m, y {robot.pose.y:+.3f} m, on black {robot.tophat('front').coverage:.2f}"
        )


if __name__ == "__main__":
    main()
