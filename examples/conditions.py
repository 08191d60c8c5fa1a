"""Everything that can end an action, alone and put together."""

from raccoon import (
    Condition,
    after_angle,
    after_distance,
    after_time,
    analog_above,
    analog_below,
    bumped,
    button_pressed,
    calibrate_tophats,
    drive,
    on_black,
    on_white,
    open_robot,
    over_line,
    pressed,
    stalled,
    straight,
    wait_for,
    when,
)


def hit(button: int) -> Condition:
    """The robot ran into something: its bumper, its motors or its accelerometer say so."""
    return pressed(button) | bumped() | stalled()


def main() -> None:
    """Run it on the robot that robot.toml names."""
    with open_robot("robot.toml") as robot:
        robot.run(wait_for(after_time(1.0) & ~pressed(0)))
        calibrate_tophats(robot, distance=1.0)
        robot.run(straight(-0.60))

        begin = robot.pose.x
        robot.run(drive(0.15).until(over_line("left") | after_distance(0.70) | hit(button=0)))
        print(f"over a line after {robot.pose.x - begin:.3f} m")
        robot.run(drive(-0.10).until(on_black("left") | button_pressed() | after_time(3.0)))
        robot.run(drive(-0.10).until(on_white("left") & when(lambda robot: robot.pose.x < 0.9)))
        robot.run(drive(0.0, 1.0).until(after_angle(0.5) | analog_above(4, 3000) | analog_below(4, 10)))
        print(f"turned to {robot.pose.heading:.2f} rad")


if __name__ == "__main__":
    main()
