"""What the battery has left, what it can drive, and the same duties on any battery."""

from raccoon import after_time, check_battery, motors, open_robot, straight, wait


def main() -> None:
    """Run it on the robot that robot.toml names."""
    with open_robot("robot.toml") as robot:
        robot.run(wait(1.0))
        check = robot.run(check_battery(tolerance=0.2))  # refuse=True ends the program where it is not ok
        print(f"{check.advice}; full power is {100 * check.speed_change:+.0f} % fast")
        result = robot.run(straight(0.40, speed=0.5))
        print(f"{100 * result.planned:.0f} % of 0.5 m/s is what the weakest battery of the match can give")
        pack = robot.pack.estimate
        print(f"{100 * pack.charge:.0f} % charged, {pack.internal_resistance:.2f} ohm, {pack.status.name}")
        # Found on a battery of 7.0 V: scaled to the present one. At 1.0 a weaker one could not give all.
        robot.run(motors(0.8, 0.8, tuned_at=7.0).until(after_time(0.5)))
        print(f"heading {robot.pose.heading:+.3f} rad")


if __name__ == "__main__":
    main()
