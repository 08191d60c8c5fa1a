"""Actions side by side, in the background, with time limits, and with results that are passed on."""

from raccoon import (
    Action,
    Robot,
    after_distance,
    arc,
    background,
    deg,
    do,
    drive,
    open_robot,
    parallel,
    race,
    repeat,
    seq,
    straight,
    turn_to,
    wait,
)


def report(robot: Robot) -> None:
    """Print where the robot believes it is."""
    print(f"t {robot.time:5.2f} s  x {robot.pose.x:6.3f} m  battery {robot.battery_voltage:.2f} V")


def half_back(start: float) -> Action[object]:
    """Drive half of the way back that was driven since `start` m."""
    return do(lambda robot: robot.estimate.distance - start).then(lambda way: straight(-0.5 * way))


mission = seq(
    wait(0.5),
    background(repeat(seq(do(report), wait(1.0)))),
    do(lambda robot: robot.estimate.distance).then(
        lambda start: seq(drive(0.15).until(after_distance(0.30)).timeout(5.0), half_back(start))
    ),
    parallel(turn_to(deg(45)), wait(1.0)),
    arc(0.25, deg(-90)),
    race(straight(5.0), wait(1.5)),
)


def main() -> None:
    """Run it on the robot that robot.toml names."""
    with open_robot("robot.toml") as robot:
        robot.run(mission)
        report(robot)


if __name__ == "__main__":
    main()
