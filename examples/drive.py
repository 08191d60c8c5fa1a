"""Drive until something happens: a line, a distance, a stall."""

from raccoon import after_distance, calibrate_tophats, drive, on_black, open_robot, stalled, straight, wait


def main() -> None:
    """Run it on the robot that robot.toml names."""
    with open_robot("robot.toml") as robot:
        robot.run(wait(1.0))
        calibrate_tophats(robot, distance=1.0)  # over floor and lines
        robot.run(straight(-0.40))
        robot.run(drive(0.15).until(on_black("front") | after_distance(0.60) | stalled()))
        print(f"black at x {robot.pose.x:.3f} m")


if __name__ == "__main__":
    main()
