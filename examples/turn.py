"""Turn by an angle, then to a heading of the field."""

from raccoon import deg, open_robot, turn, turn_to, wait


def main() -> None:
    """Run it on the robot that robot.toml names."""
    with open_robot("robot.toml") as robot:
        robot.run(wait(1.0))
        robot.run(turn(deg(120)))
        end = robot.run(turn_to(deg(-90), tolerance=deg(0.2)))
        print(f"heading {robot.pose.heading:.3f} rad, off by {end.heading:+.4f} +- {end.heading_std:.4f} rad")


if __name__ == "__main__":
    main()
