"""Calibrate the tophats without a drive over the table: the robot is put over white, then over black."""

from raccoon import Robot, after_distance, analog_above, calibrate_tophats_by_hand, drive, open_robot, wait


def put_down(robot: Robot, what: str) -> None:
    """On the table leave `placed=` out: put the robot there and press its button. Here it drives there."""
    print(what)
    if what.endswith("black"):
        robot.run(drive(0.1).until(analog_above(0, 2500) | after_distance(1.0)))


def main() -> None:
    """Run it on the robot that robot.toml names."""
    with open_robot("robot.toml") as robot:
        robot.run(wait(1.0))
        found = calibrate_tophats_by_hand(
            robot, placed=lambda what: put_down(robot, what), store="tophats.json"
        )
        for name, each in found.items():
            print(f"{name}: {each.reason}, threshold {each.threshold:.0f}")


if __name__ == "__main__":
    main()
