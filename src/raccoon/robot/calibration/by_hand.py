"""Calibration of the tophats without a drive: someone puts the robot over white, then over black."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from raccoon.core.errors import CalibrationError
from raccoon.core.port import Bystander, bystander_of
from raccoon.core.readings import Inputs
from raccoon.robot.actions.actions import wait, wait_for
from raccoon.robot.actions.conditions import button_pressed, when
from raccoon.robot.actions.limits import check_function, check_name, check_robot
from raccoon.robot.calibration.calibration_drives import collect_inputs
from raccoon.robot.calibration.calibration_shelf import CalibrationShelf, port_counts
from raccoon.robot.remarks import add_remark

if TYPE_CHECKING:
    from raccoon.estimate.tophat import TophatCalibration
    from raccoon.robot.robot import Robot

READING_S = 1.0  # s over each surface
SETTLING_S = 0.5  # s until a robot whose button was pressed stands still
MAX_TRIES = 3  # of each surface, and of both
ALIKE_RATIO = 1.3  # of the lights of two sensors over white, up to which they are of one make and height
BESIDE_LINE_RATIO = 3.0
"""Ratio of their lights over black above which one was partly beside the line. For the paper's four sensors
indoors, 4 to 20 % of the spot make as much."""


def calibrate_tophats_by_hand(
    robot: Robot,
    *tophats: str,
    placed: Callable[[str], object] | None = None,
    store: str | Path | None = None,
    set_name: str = "default",
) -> dict[str, TophatCalibration]:
    """Calibrate the named tophats, or all, from what they read over white and then over black.

    The robot is put down on each surface for 1.5 s, not held. placed: a function that is called with the
    sentence that says what to do, and returns when it is done. None: the sentence is printed, and someone
    presses the controller's button (in simulation the bystander does both). store, set_name: as for
    `calibrate_tophats`. Returns the calibrations by name; they are in use from now on.

    If a sensor was moved meanwhile, reads nothing or the same over both surfaces, the placement is asked for
    again with the reason, up to twice. Exchanged surfaces are recognised by their readings and reported.
    Raises ConfigError for a tophat that robot.toml does not have, a store that is damaged or cannot be
    written, and a controller without a button. Raises CalibrationError naming each tophat that has no
    threshold in the end, and why; then no calibration is changed.
    """
    check_robot(robot, "calibrate_tophats_by_hand()")
    robot.require("calibrate_tophats_by_hand()")
    for name in tophats:
        check_name(tophat=name)
        robot.tophat(name)
    if placed is not None:
        check_function(placed, "calibrate_tophats_by_hand(placed=)", "what")
    shelf = CalibrationShelf(robot, store, set_name)
    with _choose_asking(robot, placed) as asking:
        found = _calibrate_until_right(robot, asking, tophats or tuple(robot.tophats))
    shelf.take(found)
    return found


@contextmanager
def _choose_asking(robot: Robot, placed: Callable[[str], object] | None) -> Iterator[_Asking]:
    """The function that asks for a placement: the program's own, or one that prints the request, or one that
    asks the bystander of a simulated robot."""
    somebody = bystander_of(robot.port) if placed is None else None
    try:
        yield _Asking(robot, placed or (lambda what: _wait_for_button(robot, what)), somebody)
    finally:
        if somebody is not None:
            somebody.put_over(None)


def _calibrate_until_right(
    robot: Robot, asking: _Asking, tophats: Sequence[str]
) -> dict[str, TophatCalibration]:
    """Calibrations by name; placements are asked for again until they are right. Raises CalibrationError."""
    found: dict[str, TophatCalibration] = {}
    left, why = tuple(tophats), ""
    for _ in range(MAX_TRIES):
        white = asking.over("white", left, why)
        black = asking.over("black", left)
        now, wrong = _judge(robot, white, black)
        found.update(now)
        wrong.update(_describe_beside_line(now, found))
        left, why = tuple(wrong), "; ".join(wrong.values())
        if not left:
            return found
    if found.keys() >= set(left):
        add_remark(robot, f"calibrated by hand all the same: {why}")
        return found
    raise CalibrationError(f"calibrated by hand: {why}")


class _Asking:
    """Asks for the robot to be put down and reads the sensors there. placed: see
    `calibrate_tophats_by_hand`."""

    def __init__(self, robot: Robot, placed: Callable[[str], object], somebody: Bystander | None) -> None:
        self._robot, self._placed, self._somebody = robot, placed, somebody

    def over(self, surface: str, names: Sequence[str], why: str = "") -> dict[str, list[float]]:
        """Counts of each tophat over a surface, from a robot at rest. why: the reason for asking again."""
        for _ in range(MAX_TRIES):
            many = "tophats" if len(names) > 1 else "tophat"
            if self._somebody is not None:
                self._somebody.put_over(surface == "black")
            wanted = f"put {many} {' and '.join(names)} over {surface}"
            self._placed(f"{why}: {wanted}" if why else wanted)
            readings: list[Inputs] = []
            self._robot.run(wait(SETTLING_S))
            self._robot.run(collect_inputs(wait(READING_S), readings))
            ports = {name: self._robot.tophat(name).config.analog for name in names}
            read = {name: port_counts(readings, port) for name, port in ports.items()}
            why = "; ".join(
                filter(None, (_describe_disturbance(name, ports[name], read[name]) for name in names))
            )
            if not why:
                self._robot.note(f"over {surface}: " + ", ".join(f"{n} {_median(read[n]):.0f}" for n in read))
                return read
        raise CalibrationError(f"calibration by hand, over {surface}: {why}")


def _describe_disturbance(name: str, port: int, counts: Sequence[float]) -> str:
    """Why the readings do not belong to one place; "" if they do."""
    from raccoon.estimate.tophat.quality import MIN_READINGS, is_restless, was_moved

    if len(counts) < MIN_READINGS:
        return f"tophat {name} is not read: its port, analog {port}, gave {len(counts)} readings"
    if is_restless(counts) or was_moved(counts):
        low, high = min(counts), max(counts)
        return (
            f"tophat {name} was not steady, it read {low:.0f} to {high:.0f} counts: put the robot down, let "
            f"go of it and keep your shadow off the sensor; or the sensor is not plugged into analog {port}"
        )
    return ""


def _judge(
    robot: Robot, white: Mapping[str, Sequence[float]], black: Mapping[str, Sequence[float]]
) -> tuple[dict[str, TophatCalibration], dict[str, str]]:
    """Calibrations by name, and what is wrong with the other sensors. Black reads higher: if all sensors read
    the surfaces exchanged, they were exchanged."""
    from raccoon.estimate.tophat.standing_calibration import calibrate_standing

    found, wrong, exchanged = {}, {}, []
    for name in white:
        levels = _median(white[name]), _median(black[name])
        pair = (white[name], black[name]) if levels[0] <= levels[1] else (black[name], white[name])
        said = f"tophat {name} read {levels[0]:.0f} counts over white and {levels[1]:.0f} over black"
        each = calibrate_standing(*pair)
        if not each.usable:
            port = robot.tophat(name).config.analog
            wrong[name] = (
                f"{said}, {each.reason}: was it over both surfaces? is a tophat plugged into analog {port}?"
            )
            continue
        found[name] = each
        if levels[0] > levels[1]:
            exchanged.append((name, said))
    if len(exchanged) == len(found) > 0:
        add_remark(
            robot,
            "the tophats read more over white than over black: the surfaces were exchanged, so black "
            "and white are swapped",
        )
        return found, wrong
    for name, said in exchanged:
        del found[name]
        wrong[name] = f"{said}, the opposite of the other tophats"
    return found, wrong


def _describe_beside_line(
    now: Mapping[str, TophatCalibration], found: Mapping[str, TophatCalibration]
) -> dict[str, str]:
    """What is odd about calibrations of `now`, by name: sensors that read alike over white read alike over
    black, unless a part of the spot was beside the line. found: all calibrations."""
    from raccoon.model.reflectance import light_of

    odd = {}
    for name, each in now.items():
        white, black = (light_of(surface.mean) for surface in each.surfaces())
        for other, like in found.items():
            its_white, its_black = like.surfaces()
            is_alike = 1.0 / ALIKE_RATIO < white / light_of(its_white.mean) < ALIKE_RATIO
            if is_alike and black > BESIDE_LINE_RATIO * light_of(its_black.mean):
                odd[name] = (
                    f"tophat {name} read {each.surfaces()[1].mean:.0f} counts over black, and {other} "
                    f"{its_black.mean:.0f}, though both read white alike: was {name} partly beside the line?"
                )
    return odd


def _median(counts: Sequence[float]) -> float:
    """The median of the counts."""
    return sorted(counts)[len(counts) // 2]


def _wait_for_button(robot: Robot, what: str) -> None:
    """Print what to do, and wait until the controller's button was pressed and released."""
    print(f"{what}, and press the button", flush=True)
    robot.run(wait_for(button_pressed()))
    robot.run(wait_for(when(lambda robot: robot.button is not True, "button let go of")))
