"""Back up against a wall to be square to it, and go on without where there is none."""

from raccoon import align_on_wall, deg, do, open_robot, turn, wait


def main() -> None:
    """Run it on the robot that robot.toml names."""
    with open_robot("robot.toml") as robot:
        robot.run(wait(1.0))
        robot.run(turn(deg(8)))  # as a robot stands that was put down in a hurry
        no_wall = do(lambda robot: robot.note("no wall"), "no wall")
        squared = robot.run(align_on_wall(-0.08, heading=deg(0)).timeout_or(6.0, no_wall))
        print(f"heading {robot.pose.heading:+.3f} rad, {squared}")


if __name__ == "__main__":
    main()
