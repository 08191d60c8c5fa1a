"""Follow the left edge of the line that leads from one crossing line to the next, then the line itself."""

from raccoon import after_distance, at_crossing, calibrate_tophats, follow_line, open_robot, wait


def main() -> None:
    """Run it on the robot that robot.toml names."""
    with open_robot("robot.toml") as robot:
        robot.run(wait(1.0))
        calibrate_tophats(robot, distance=1.0)
        robot.run(follow_line("front", "left", speed=0.10).until(after_distance(0.15)))
        print(
            f"x {robot.pose.x:.3f} m, y {robot.pose.y:+.3f} m, on black {robot.tophat('front').coverage:.2f}"
        )
        both = follow_line(left="left", right="right", speed=0.10)
        robot.run(both.until(at_crossing("left", "right") | after_distance(0.50)))
        print(f"x {robot.pose.x:.3f} m, y {robot.pose.y:+.3f} m, at the crossing line")


if __name__ == "__main__":
    main()
