"""Stretches in which a robot does not drive freely: found, left out and said, and no fault taken for one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from blind.generator import make
from blind.hidden import CAUSES, UNKNOWN, Hidden, draw, draw_unknown
from raccoon.core.config import RobotConfig, parse_robot
from raccoon.core.errors import TraceError
from raccoon.core.readings import MOTOR_PORTS, Outputs
from raccoon.diagnose.drives.disturbances import without_disturbances
from raccoon.diagnose.drives.log import Log, log_from_columns
from raccoon.diagnose.drives.obstructions import (
    find_obstructed_stretches,
    leave_out_obstructed,
    without_held_readings,
)
from raccoon.diagnose.drives.units import check_units, describe_wrong_units
from raccoon.diagnose.experiment.manoeuvres import manoeuvre
from raccoon.diagnose.recordings.diagnosis import diagnose_recording
from raccoon.diagnose.result import Verdict
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.port import SimPort
from raccoon.sim.world.table import Wall, World
from raccoon.trace.columns import recording_of
from raccoon.trace.format import read_trace
from raccoon.trace.record import RecordingPort
from raccoon.trace.recording import Recording

Array = NDArray[np.float64]
ROBOT = RobotConfig()
AHEAD = World(walls=(Wall((0.3, -2.0), (0.3, 2.0)),))
"""A wall in front of the simulated robot, which starts at 0."""
LEG = np.tile([0.5, 0.5], (700, 1))
REST = np.zeros((100, 2))
SPINS = np.vstack([np.tile(each, (120, 1)) for each in ([-0.6, 0.6], [0.6, -0.6], [-0.3, 0.3], [0.3, -0.3])])
BACK = np.vstack([np.tile(each, (120, 1)) for each in ([-0.8, -0.8], [0.4, 0.4], [-0.4, -0.4], [-0.5, -0.2])])


@pytest.fixture(scope="module")
def pushed(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """A sound simulated robot that turns, drives into a wall, pushes, and drives back."""
    path = tmp_path_factory.mktemp("wall") / "run"
    port = RecordingPort(SimPort(Parameters(), AHEAD, seed=1), path, seed=1)
    for left, right in np.vstack([REST, SPINS, REST, LEG, REST, BACK, REST]):
        port.read()
        port.write(Outputs(duty=(float(left), float(right), *[0.0] * (MOTOR_PORTS - 2))))
    port.close()
    return recording_of(read_trace(f"{path}.jsonl.gz"))


def touched(recording: Recording) -> tuple[float, float]:
    """s from which the robot stands at the wall, by its true place, and at which the push ends."""
    time, x = recording["t"], recording["truth.x"]
    duty = recording["motor.0.duty"]
    push = (duty == 0.5) & (x > np.nanmax(x) - 0.002) & (recording["motor.1.duty"] == 0.5)
    return float(time[push][0]), float(time[push][-1])


def test_a_push_against_a_wall_is_found(pushed: Recording) -> None:
    log = log_from_columns(pushed.columns, ROBOT)
    (found,) = find_obstructed_stretches(log, ROBOT)
    start, end = touched(pushed)
    assert found.start == pytest.approx(start, abs=0.2)
    assert found.start < start + 0.03
    assert found.end == pytest.approx(end, abs=0.15)
    assert found.why == "held"


@pytest.mark.usefixtures("few_causes")
def test_a_wall_is_no_fault_of_the_robot_and_is_said(pushed: Recording) -> None:
    found = diagnose_recording(pushed.columns, ROBOT, device=pushed.device)
    assert (found.verdict, found.causes) == (Verdict.ADEQUATE, ())
    (note,) = (each for each in found.notes if "fell behind" in each)
    assert note.startswith("from ")
    assert note.endswith("held by a wall, or switched off? Left out, since the simulated robot drives freely")


def test_what_is_left_out_is_lost_until_the_robot_has_settled(pushed: Recording) -> None:
    log = log_from_columns(pushed.columns, ROBOT)
    free = leave_out_obstructed(log, find_obstructed_stretches(log, ROBOT))
    ((start, end),) = free.held
    ((first, settled),) = free.lost
    assert first == start
    assert end + 0.2 < settled < end + 1.1
    known = without_held_readings(free).channel("bemf_left")
    assert known is not None
    out = (log.time >= start) & (log.time <= end)
    assert np.array_equal(np.isnan(known.values), out)
    part = free.longest_part()
    assert part.time[0] == log.time[0]
    assert part.time[-1] <= start
    assert (part.lost, part.held) == ((), ())


def turned_in_a_hand(columns: dict[str, Array], start: float, end: float) -> dict[str, Array]:
    """A recording of a robot that a hand turned to and fro, whatever its wheels did."""
    time = columns["t"]
    inside = (time >= start) & (time < end)
    sway = 1.5 * np.sin(2.0 * (time - start))
    known = np.isfinite(columns["imu.gyro.z"])
    return {**columns, "imu.gyro.z": np.where(inside & known, sway, columns["imu.gyro.z"])}


@pytest.fixture(scope="module")
def blind() -> dict[str, Array]:
    return dict(make(4, seconds=20.0).columns)


@pytest.mark.parametrize(("start", "end"), [(0.0, 3.0), (8.0, 11.0), (16.5, 21.0)])
def test_a_robot_in_a_hand_is_found(blind: dict[str, Array], start: float, end: float) -> None:
    lifted = turned_in_a_hand(blind, start, end)
    log = log_from_columns(lifted, ROBOT)
    (found,) = find_obstructed_stretches(log, ROBOT)
    assert found.why == "lifted"
    assert start - 1.0 < found.start < start + 0.3
    assert min(end, float(blind["t"][-1])) - 0.3 < found.end < end + 1.0
    (note,) = leave_out_obstructed(log, [found]).notes
    assert note.startswith(f"from {found.start:.1f} to {found.end:.1f} s the robot turned as no wheel did")


def test_so_it_is_of_a_controller_of_50_hz(blind: dict[str, Array]) -> None:
    """Lifted twice, it was refused: its gyro was said to be another axis."""
    slow = parse_robot({"controller": {"rate_hz": 50.0}})
    lifted = turned_in_a_hand(blind, 8.0, 11.0)

    def in_slow_rows(columns: dict[str, Array]) -> Log:
        gyro = columns["imu.gyro.z"]
        seen = np.isfinite(gyro)
        read = {**columns, "imu.gyro.z": np.interp(columns["t"], columns["t"][seen], gyro[seen])}
        return log_from_columns({name: each[::4] for name, each in read.items()}, slow)

    (found,) = find_obstructed_stretches(in_slow_rows(lifted), slow)
    assert found.why == "lifted"
    assert 7.0 < found.start < 8.3
    assert 10.7 < found.end < 12.0
    assert find_obstructed_stretches(in_slow_rows(blind), slow) == ()


def test_too_little_free_driving_is_an_error_that_says_why(blind: dict[str, Array]) -> None:
    short = {name: each[:2000] for name, each in turned_in_a_hand(blind, 1.5, 10.0).items()}
    log = log_from_columns(short, ROBOT)
    found = find_obstructed_stretches(log, ROBOT)
    with pytest.raises(TraceError, match=r"turned as no wheel did.*needs at least 2 s of driving freely"):
        leave_out_obstructed(log, found)


def test_what_happened_in_a_moment_is_left_out_with_a_note(blind: dict[str, Array]) -> None:
    log = log_from_columns(blind, ROBOT)
    less = without_disturbances(log, [12.0, 5.0])
    starts, ends = [start for start, _ in less.lost], [end - start for start, end in less.lost]
    assert starts == pytest.approx([4.4, 11.4])
    assert all(1.2 < each < 2.6 for each in ends)
    assert less.notes[-1].startswith("around 5.0 and 12.0 s, and only then, the robot moved as no command")
    part = less.longest_part()  # which began 0.6 s before the second one, and compared it
    assert (part.time[0], part.time[-1]) == pytest.approx((12.6, log.time[-1]), abs=0.01)
    assert without_disturbances(log, []) is log
    assert without_disturbances(log.between(11.0, 13.5), [12.0]).lost == ()  # too little is left


def hidden() -> list[Hidden]:
    rng = np.random.default_rng(3)
    most = {"friction.stiction", "motor.current_limit", "motor.heating", "friction.load_dependent"}
    found = [draw(each, rng, 1.5 if each in most else 1.0) for each in CAUSES]
    return found + [draw_unknown(each, rng) for each in UNKNOWN]


def test_no_fault_is_taken_for_a_wall_or_a_hand() -> None:
    for number, each in enumerate(hidden()):
        drive = ("exciting", "contest")[number % 2]
        log = log_from_columns(make(number, [each], drive=drive, seconds=15.0).columns, ROBOT)
        assert find_obstructed_stretches(log, ROBOT) == (), each


def dead_from(columns: dict[str, Array], start: float, ports: tuple[int, ...]) -> dict[str, Array]:
    """A recording with wheels that stand from then on, and the gyro that says so."""
    late = columns["t"] >= start
    changed = {f"motor.{port}.bemf": np.where(late, 0.0, columns[f"motor.{port}.bemf"]) for port in ports}
    found = {**columns, **changed}
    per_count = 3.3 / 4096 * 9.0 / 2.2 / 1.08 * 0.0345 / 0.16
    turn = per_count * (found["motor.1.bemf"] - found["motor.0.bemf"])
    gyro = np.where(late & np.isfinite(columns["imu.gyro.z"]), turn, columns["imu.gyro.z"])
    return {**found, "imu.gyro.z": gyro}


def test_a_motor_that_is_unplugged_is_none(blind: dict[str, Array]) -> None:
    """Its wheel stands in the midst of a command, but the robot turns as the wheels say."""
    straight = dict(make(4, drive=manoeuvre("straight"), seconds=10.0).columns)
    assert find_obstructed_stretches(log_from_columns(dead_from(straight, 1.0, (0,)), ROBOT), ROBOT) == ()
    assert find_obstructed_stretches(log_from_columns(dead_from(blind, 8.0, (1,)), ROBOT), ROBOT) == ()


def test_a_battery_that_gives_way_is_none() -> None:
    """Both wheels get slower, and its reading says why."""
    columns = dict(make(4, drive=manoeuvre("straight"), seconds=10.0).columns)
    weak = (columns["t"] > 1.0) & (columns["t"] < 1.8)
    for port in (0, 1):
        columns[f"motor.{port}.bemf"] = np.where(weak, 0.6, 1.0) * columns[f"motor.{port}.bemf"]
    said = find_obstructed_stretches(log_from_columns(columns, ROBOT), ROBOT)
    assert [each.why for each in said] == ["held"]
    columns["battery.voltage"] = np.where(weak, 0.65, 1.0) * columns["battery.voltage"]
    assert find_obstructed_stretches(log_from_columns(columns, ROBOT), ROBOT) == ()


def test_what_was_not_read_is_no_hand(blind: dict[str, Array]) -> None:
    """A line over half a second without a gyro turned as no wheel did."""
    columns = dict(blind)
    for name in ("imu.gyro.z", "motor.1.bemf"):
        unread = (np.sin(3.0 * blind["t"] + len(name)) > 0.6) | (blind["t"] > blind["t"][-1] - 3.0)
        columns[name] = np.where(unread, np.nan, blind[name])
    assert find_obstructed_stretches(log_from_columns(columns, RobotConfig()), RobotConfig()) == ()


def test_a_gyro_that_never_agrees_with_the_wheels_is_none(blind: dict[str, Array]) -> None:
    """One of another axis, or in another unit: that is an error, and no robot in a hand."""
    gyro = blind["imu.gyro.z"]
    for other in (-gyro, gyro / 6.28, 57.3 * gyro, 0.02 * np.random.default_rng(2).normal(size=len(gyro))):
        assert find_obstructed_stretches(log_from_columns({**blind, "imu.gyro.z": other}, ROBOT), ROBOT) == ()


def test_a_log_of_free_driving_is_the_same_object(blind: dict[str, Array]) -> None:
    log = log_from_columns(blind, ROBOT)
    assert leave_out_obstructed(log, find_obstructed_stretches(log, ROBOT)) is log
    assert without_held_readings(log) is log


def slipping_at_a_wall(columns: dict[str, Array]) -> dict[str, Array]:
    """A recording whose robot stands at a wall for nearly all of the time, while its wheels go on."""
    late = columns["t"] > 6.0
    return {**columns, "imu.gyro.z": np.where(late, 0.15, 1.0) * columns["imu.gyro.z"]}


def test_units_are_judged_by_free_driving_alone() -> None:
    spins = np.vstack([SPINS] * 16)
    columns = slipping_at_a_wall(dict(make(4, drive=spins).columns))
    log = log_from_columns(columns, ROBOT)
    with pytest.raises(TraceError, match="times what is expected from the wheels"):
        check_units(log, ROBOT)
    check_units(
        without_held_readings(leave_out_obstructed(log, find_obstructed_stretches(log, ROBOT))), ROBOT
    )
    assert describe_wrong_units(columns, ROBOT) == ""


def test_a_recording_that_names_its_firmware_knows_its_units(blind: dict[str, Array]) -> None:
    turns = {**blind, "imu.gyro.z": blind["imu.gyro.z"] / 6.28}
    assert "turns a second" in describe_wrong_units(turns, ROBOT)
    assert describe_wrong_units(turns, ROBOT, native=True) == ""
    blank = np.full(len(turns["t"]), np.nan)
    without = {name: column for name, column in turns.items() if name != "motor.1.duty"}
    for told in (without, {**turns, "motor.1.duty": blank}):  # there is nothing to compare with
        assert describe_wrong_units(told, ROBOT) == ""
    wrong: Log = log_from_columns({**blind, "imu.gyro.z": -blind["imu.gyro.z"]}, ROBOT)
    with pytest.raises(TraceError, match="swapped"):
        check_units(replace(wrong), ROBOT, native=True)
