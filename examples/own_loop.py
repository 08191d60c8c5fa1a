"""A loop of your own: in each cycle read, decide, and ask for a speed. Here along y = 0, by the pose."""

from raccoon import open_robot, straight, wait


def main() -> None:
    """Run it on the robot that robot.toml names."""
    with open_robot("robot.toml") as robot:
        robot.run(wait(1.0))
        begin = robot.time
        while robot.pose.x < 0.40 and robot.digital(0) is not True:
            if robot.time - begin > 8.0:
                print("it takes too long: what follows starts from here")
                break
            robot.drive.velocity(0.15, -4.0 * robot.pose.y - 2.0 * robot.pose.heading)  # m/s, rad/s
            robot.tick()
        robot.tick()  # no speed is asked for any more, so it brakes
        robot.run(straight(-0.20))
        print(f"x {robot.pose.x:.3f} m, {robot.estimate.status}")


if __name__ == "__main__":
    main()
