"""Drive a square and end where it began."""

from raccoon import deg, open_robot, repeat, seq, straight, turn, wait

mission = seq(wait(1.0), repeat(seq(straight(0.30), turn(deg(90))), 4))


def main() -> None:
    """Run it on the robot that robot.toml names."""
    with open_robot("robot.toml") as robot:
        robot.run(mission)
        here, sure = robot.pose, robot.estimate
        print(f"x {here.x * 1000:.0f} +- {sure.x_std * 1000:.0f} mm")
        print(f"y {here.y * 1000:.0f} +- {sure.y_std * 1000:.0f} mm")


if __name__ == "__main__":
    main()
