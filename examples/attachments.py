"""Fetch something: an arm on a motor, a claw on a servo, and the drive, each while the others go on."""

from raccoon import MotionTimeout, deg, move, open_robot, parallel, seq, servo, straight, wait


def main() -> None:
    """Run it on the robot that robot.toml names."""
    with open_robot("robot.toml") as robot:
        robot.run(wait(1.0))
        robot.run(parallel(servo("claw", "open"), move("arm", deg(60)), straight(0.20)))
        robot.run(seq(move("arm", deg(0)), servo("claw", "closed", seconds=0.5)))
        try:
            robot.run(parallel(move("arm", deg(45), speed=2.0), straight(-0.20)))
        except MotionTimeout as blocked:
            print(f"the arm is blocked: {blocked}")
        print(f"arm at {robot.mechanism('arm').angle:.2f} rad, claw at {robot.servo('claw').pulse} us")


if __name__ == "__main__":
    main()
