"""Stand square to a line, however askew one came."""

from raccoon import align_on_line, calibrate_tophats, deg, open_robot, seq, straight, turn, wait


def main() -> None:
    """Run it on the robot that robot.toml names."""
    with open_robot("robot.toml") as robot:
        robot.run(wait(1.0))
        calibrate_tophats(robot, distance=1.0)
        robot.run(seq(straight(-0.40), turn(deg(12))))
        robot.run(align_on_line("left", "right"))
        print(f"heading {robot.pose.heading:+.3f} rad")


if __name__ == "__main__":
    main()
