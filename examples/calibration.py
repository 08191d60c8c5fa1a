"""Calibrate the wheels by a tape before the match, and drive with what was found."""

from raccoon import calibrate_drive, open_robot, straight, wait


def main() -> None:
    """Run it on the robot that robot.toml names."""
    with open_robot("robot.toml") as robot:

        def taped() -> float:
            """On the table: return float(input("metres by tape? "))."""
            return 0.601

        calibrated = calibrate_drive(robot, taped, distance=0.60, tape_std=0.001)
    with open_robot(calibrated) as robot:
        robot.run(wait(1.0))
        result = robot.run(straight(0.30))
        print(f"0.30 m, known to {1000 * result.std:.1f} mm")


if __name__ == "__main__":
    main()
