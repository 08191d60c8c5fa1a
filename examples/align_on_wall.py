"""Push against a wall to be square to it, and go on without where there is none."""

from raccoon import align_on_wall, deg, do, open_robot, wait


def main() -> None:
    """Run it on the robot that robot.toml names."""
    with open_robot("robot.toml") as robot:
        robot.run(wait(1.0))
        # Simulated walls stop the robot, but its wheels slip on: there the second action is taken.
        no_wall = do(lambda robot: robot.note("no wall"), "no wall")
        robot.run(align_on_wall(0.10, heading=deg(0), timeout=2.0).timeout_or(3.0, no_wall))
        print(f"heading {robot.pose.heading:+.3f} rad")


if __name__ == "__main__":
    main()
