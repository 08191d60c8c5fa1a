"""Calibrate the tophats once, keep it in a file, and take it from there the next time."""

from pathlib import Path

from raccoon import CalibrationError, calibrate_tophats, load_tophats, open_robot, straight, wait

STORE = Path("tophats.json")


def main() -> None:
    """Run it on the robot that robot.toml names."""
    with open_robot("robot.toml") as robot:
        robot.run(wait(1.0))
        try:
            found = load_tophats(robot, STORE)
        except CalibrationError as error:
            print(f"{error}: calibrating")
            found = calibrate_tophats(robot, distance=1.0, store=STORE)
            robot.run(straight(-1.0))
        print(", ".join(f"{name}: threshold {each.threshold:.0f}" for name, each in found.items()))


if __name__ == "__main__":
    main()
