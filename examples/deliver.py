"""Find the black line, turn along it, rest 20 cm further: a mission for `raccoon sweep`."""

from raccoon import Robot, calibrate_tophats, deg, drive, on_black, open_robot, seq, straight, turn


def mission(robot: Robot) -> None:
    """Calibrate over the line, back up, and deliver."""
    calibrate_tophats(robot, distance=1.0)
    robot.run(seq(straight(-0.40), drive(0.15).until(on_black("front")), turn(deg(90)), straight(0.20)))


def main() -> None:
    """Run it on the robot that robot.toml names."""
    with open_robot("robot.toml") as robot:
        mission(robot)
        print(f"x {robot.pose.x:.3f} m, y {robot.pose.y:.3f} m")


if __name__ == "__main__":
    main()
