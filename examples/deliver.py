"""Drive to the black line, turn along it, rest 30 cm further: a mission for `raccoon sweep`."""

from raccoon import deg, drive, on_black, open_robot, seq, straight, turn

mission = seq(drive(0.2).until(on_black("front")), turn(deg(90)), straight(0.30))


def main() -> None:
    """Run it on the robot that robot.toml names."""
    with open_robot("robot.toml") as robot:
        robot.run(mission)
        print(f"x {robot.pose.x:.3f} m, y {robot.pose.y:.3f} m")


if __name__ == "__main__":
    main()
