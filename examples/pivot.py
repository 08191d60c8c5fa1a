"""Turn about one wheel, as to swing around a pole beside it."""

from raccoon import deg, open_robot, pivot, seq, wait


def main() -> None:
    """Run it on the robot that robot.toml names."""
    with open_robot("robot.toml") as robot:
        robot.run(wait(1.0))
        _, end = robot.run(seq(pivot(deg(90), "left"), pivot(deg(-90), "right")))
        print(f"ended {1000 * end.along:+.1f} mm along and {1000 * end.across:+.1f} mm beside the mark")


if __name__ == "__main__":
    main()
