"""The day of the match in one program: what is needed at the table, one press of the button after the other.

The same file runs in simulation, where somebody beside the robot presses the button, holds black and white
under the tophats and switches the lamp on; `raccoon sweep match_day.py` plays it many times. See
docs/match-day.md.
"""

from raccoon import (
    MatchReport,
    Robot,
    after_distance,
    button_pressed,
    calibrate_light,
    calibrate_tophats_by_hand,
    check_battery,
    deg,
    drive,
    on_black,
    open_robot,
    run_match,
    seq,
    straight,
    timed,
    turn,
    wait_for,
    wait_for_light,
)

LIGHT = 5  # analog port of the sensor for the start light

to_the_line = drive(0.20).until(on_black("front") | after_distance(1.2)).timeout(10.0)
program = seq(timed(to_the_line, "to the line"), timed(seq(turn(deg(90)), straight(0.20)), "along it"))


def ask(robot: Robot, what: str) -> None:
    """Say what to do, and wait for the Wombat's button."""
    print(f"{what}, then press the button", flush=True)
    robot.run(wait_for(button_pressed()))


def mission(robot: Robot) -> MatchReport:
    """From the start of the program to the end of the match."""
    print(robot.run(check_battery()).advice)
    calibrate_tophats_by_hand(robot, store="tophats.json")
    ask(robot, "put the robot where the match begins, lamp off")
    lamp = calibrate_light(robot, LIGHT, lambda: ask(robot, "lamp on"))
    ask(robot, "lamp off, hands off")
    robot.odometry.reset()  # it was carried about: here is x 0, y 0, heading 0
    print(f"ready after {robot.time:.0f} s")
    return run_match(robot, program, start=wait_for_light(LIGHT, lamp))


def main() -> None:
    """Run it on the robot that robot.toml names."""
    with open_robot("robot.toml", record="match") as robot:
        print(mission(robot))


if __name__ == "__main__":
    main()
