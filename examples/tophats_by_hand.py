"""Calibrate the tophats without a drive over the table: the robot is put over white, then over black."""

from raccoon import calibrate_tophats_by_hand, open_robot


def main() -> None:
    """Run it on the robot that robot.toml names; somebody holds a simulated one over white and black."""
    with open_robot("robot.toml") as robot:
        found = calibrate_tophats_by_hand(robot, store="tophats.json")
        for name, each in found.items():
            print(f"{name}: {each.reason}, threshold {each.threshold:.0f}")


if __name__ == "__main__":
    main()
