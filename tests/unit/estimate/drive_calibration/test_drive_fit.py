"""The drive's geometry from recorded manoeuvres: found within its deviation, or refused with what would
do.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from drive_traces import K_E, RADIUS, TRACK, Errors, Segment, drive
from raccoon.core.config import Measured, MotorConfig, RobotConfig, parse_robot
from raccoon.core.errors import CalibrationError
from raccoon.core.readings import SI_WORDS
from raccoon.estimate.drive_calibration.columns import Array, Manoeuvre, TapedWay, manoeuvre_from_columns
from raccoon.estimate.drive_calibration.fit import calibrate_drive, fit_drive
from raccoon.estimate.drive_calibration.paths import START_S, integrate_path, shape_residuals, truth_residuals
from raccoon.estimate.drive_calibration.plausibility import describe_surprises
from shared_data import data_path

LEFT_SQUARE: list[Segment] = [(3.0, 0.2, 0.0), (0.7, 0.0, 0.0), (1.0, 0.0, 1.6), (0.7, 0.0, 0.0)] * 4
RIGHT_SQUARE: list[Segment] = [(s, v, -w) for s, v, w in LEFT_SQUARE]
WAIT: list[Segment] = [(1.5, 0.0, 0.0)]
ODD = Errors(scale=(1.035, 0.965), offset_counts=(31.5, -54.9), track=1.03, gyro_bias=0.004)
ROBOT = RobotConfig()


def columns(segments: Sequence[Segment], seed: int = 0) -> dict[str, Array]:
    """A recording as the interchange format has it: SI, blank where there is nothing."""
    return dict(recorded(tuple(segments), seed))


@cache
def recorded(segments: tuple[Segment, ...], seed: int) -> dict[str, Array]:
    cycles = [inputs for inputs, _ in drive(segments, ODD, seed=seed)]
    table: dict[str, list[float]] = {}
    for each in cycles:
        assert each.truth is not None
        row = {
            "t": each.time,
            "motor.0.bemf": each.bemf[0],
            "motor.1.bemf": each.bemf[1],
            "motor.0.position": each.position[0],
            "motor.1.position": each.position[1],
            "imu.gyro.z": each.turn_rate,
            "truth.x": each.truth.x,
            "truth.y": each.truth.y,
            "truth.heading": each.truth.heading,
        }
        for name, value in row.items():
            table.setdefault(name, []).append(math.nan if value is None else float(value))
    return {name: np.array(values) for name, values in table.items()}


def without(table: dict[str, Array], *names: str) -> dict[str, Array]:
    return {name: values for name, values in table.items() if not name.startswith(names)}


def assert_found(found: Any) -> None:
    per_tick = 3.3 / 4096 * 9.0 / 2.2 / 1.08
    assert found.left.value == pytest.approx(per_tick / 1.035, abs=4 * found.left.std + 0.002 * per_tick)
    assert found.right.value == pytest.approx(per_tick / 0.965, abs=4 * found.right.std + 0.002 * per_tick)
    assert found.track_width.value == pytest.approx(TRACK * 1.03, abs=4 * found.track_width.std + 5e-4)
    assert found.left_radius.value == pytest.approx(RADIUS / 1.035, rel=0.01)
    assert found.left_offset.value == pytest.approx(31.5, abs=1.0)
    assert found.error_after < 0.3 * found.error_before


def quarter_circle(rows: int, truth: Array | None = None) -> Manoeuvre:
    """0.4 m of radius, to the left."""
    angle = np.linspace(0.0, 0.5 * math.pi, rows)
    left, right = (angle * (0.4 + side * TRACK / 2.0) / RADIUS for side in (-1.0, 1.0))
    return Manoeuvre(np.linspace(0.0, 20.0, rows), left, right, None, truth, (None, None), None)


def circles(**known: Any) -> Manoeuvre:
    """One to the left and one to the right, of wheels that go 1.02 and 0.97 times the way that robot.toml
    says, 1.05 times as far apart; with where it went, or with its turns and what `known` says besides."""
    speeds = np.array([0.4 - TRACK / 2.0, 0.4 + TRACK / 2.0]) * 0.3
    times, place, turned = np.linspace(0.0, 20.0, 150), 0.0j, 0.0
    angles, poses = [np.zeros((1, 2))], [np.zeros((1, 3))]
    for left, right in (speeds, speeds[::-1]):
        velocity, rate = 0.5 * (1.02 * left + 0.97 * right), (0.97 * right - 1.02 * left) / (1.05 * TRACK)
        way = velocity * np.expm1(1j * rate * times) / (1j * rate)
        places, headings = place + np.exp(1j * turned) * way, turned + rate * times
        place, turned = places[-1], headings[-1]
        angles.append(angles[-1][-1] + np.outer(times, [left, right])[1:] / RADIUS)
        poses.append(np.column_stack([places.real, places.imag, headings])[1:])
    (left, right), truth = np.concatenate(angles).T, np.concatenate(poses)
    made = Manoeuvre(np.linspace(0.0, 40.0, len(left)), left, right, None, truth, (None, None), None)
    if "taped" in known:
        made = replace(made, truth=None, gyro=truth[:, 2])
    return replace(made, **known)


def test_exact_circles_give_exact_factors_and_the_mean_of_what_each_recording_knows() -> None:
    """Of a device with ten ticks where others have one."""
    made = [
        circles(offsets=((10.0, 1.0), None), battery_voltage=7.0),
        circles(offsets=((20.0, 2.0), (-30.0, 3.0)), battery_voltage=6.5),
    ]
    found = fit_drive(ROBOT, made, device=replace(SI_WORDS, position_counts_seconds=0.1))
    tick = 0.1 * SI_WORDS.bemf_volts / K_E
    assert [found.left.value, found.right.value] == pytest.approx([1.02 * tick, 0.97 * tick], rel=1e-4)
    assert found.track_width.value == pytest.approx(1.05 * TRACK, rel=1e-4)
    radii = [found.left_radius.value, found.right_radius.value]
    assert radii == pytest.approx([1.02 * RADIUS, 0.97 * RADIUS], rel=1e-4)
    assert found.left_offset == Measured(12.0, math.sqrt(1.0 / 1.25), battery_voltage=6.75)  # weights 1, 1/4
    assert found.right_offset == Measured(-30.0, 3.0, battery_voltage=6.75)
    assert found.left.battery_voltage == 6.75
    assert found.error_after < 1e-3 * found.error_before
    found = fit_drive(ROBOT, [circles(), circles(taped=())], device=SI_WORDS)  # one of them gives the lengths
    assert found.left.value == pytest.approx(1.02 * tick / 0.1, rel=1e-4)


def test_recordings_that_differ_are_no_surer_than_their_difference() -> None:
    """A wheel was changed between them: the jackknife of two gives half the difference of their results."""
    changed = replace(circles(), left=1.01 * circles().left)
    found = fit_drive(ROBOT, [circles(), changed], device=SI_WORDS)
    assert found.left.std / found.left.value == pytest.approx(0.005, rel=0.1)
    left = circles().left
    changed_often = [replace(circles(), left=(1.0 + 0.01 * sign) * left) for sign in (-1.0, 1.0) * 4]
    found = fit_drive(ROBOT, changed_often, device=SI_WORDS)
    # The mean of eight: a variance of 1e-4 / 7, times that of Student's t of 7 degrees of freedom, 7 / 5.
    assert found.left.std / found.left.value == pytest.approx(0.01 / math.sqrt(5.0), rel=0.05)


def test_without_a_rest_the_offset_of_robot_toml_counts() -> None:
    table = columns([*WAIT, *LEFT_SQUARE, *RIGHT_SQUARE, *WAIT])
    begin = int(np.searchsorted(table["t"], 1.45))  # it starts at 1.5 s
    robot = RobotConfig(motors={0: MotorConfig(bemf_offset=Measured(31.5))})
    whole = manoeuvre_from_columns(table, ROBOT)
    cut = manoeuvre_from_columns({name: values[begin:] for name, values in table.items()}, robot)
    assert cut.offsets[0] is None
    assert cut.left[-1] == pytest.approx(whole.left[-1] - whole.left[begin], abs=0.2)


def test_a_tape_that_tells_a_wheel_s_way_to_more_than_5_percent_is_refused() -> None:
    """All that a tape is off by goes into the wheels' ways, however many recordings without one there are."""
    truth = circles().truth
    assert truth is not None
    row = int(np.hypot(*truth[:150, :2].T).argmax())
    end, across = circles().t[row], float(np.hypot(*truth[row, :2]))
    taped = circles(taped=[TapedWay(0.0, end, across, 0.04 * across)])
    for others in (0, 1, 7):
        found = fit_drive(ROBOT, [*[circles(taped=())] * others, taped], device=SI_WORDS)
        assert found.left.std / found.left.value == pytest.approx(0.04, rel=0.01)
    with pytest.raises(
        CalibrationError, match=r"^left wheel: these recordings determine it only to 6\.\d % .5 % a"
    ):
        fit_drive(ROBOT, [circles(taped=[TapedWay(0.0, end, across, 0.06 * across)])], device=SI_WORDS)


def test_few_rows_of_an_arc_end_where_many_do() -> None:
    """Each goes along the middle of its headings: an eighth as many rows are 64 times, not 8 times, as far
    off."""
    for rows, off in ((81, 7e-6), (11, 5e-4)):
        end = integrate_path(np.ones(3), ROBOT, quarter_circle(rows))[-1]
        assert end == pytest.approx((0.4, 0.4, 0.5 * math.pi), abs=off)


def test_the_shape_of_a_path_is_right_where_its_start_was_seen_wrong() -> None:
    """Half a degree in the first half second turns all the rest about its start."""
    wrong = math.radians(0.5)
    truth = integrate_path(np.ones(3), ROBOT, quarter_circle(400))
    first = quarter_circle(400).t <= START_S
    truth[first, 2] += wrong
    seen = quarter_circle(400, truth)
    end, shape = (off(np.ones(3), ROBOT, seen)[-1] for off in (truth_residuals, shape_residuals))
    assert end == pytest.approx((-0.4 * wrong, 0.4 * wrong, wrong), rel=0.1)
    assert np.abs(shape).max() < 0.1 * 0.4 * wrong


def test_motion_capture_gives_everything() -> None:
    table = columns([*WAIT, *LEFT_SQUARE, *RIGHT_SQUARE, *WAIT])
    voltage = np.linspace(7.4, 7.0, len(table["t"]))
    voltage[5:-5] = math.nan
    found = calibrate_drive(ROBOT, [manoeuvre_from_columns(table | {"battery.voltage": voltage}, ROBOT)])
    assert_found(found)
    assert found.right_offset is not None
    assert found.right_offset.value == pytest.approx(-54.9, abs=1.0)
    assert found.left.battery_voltage == pytest.approx(7.2)


def test_gyro_and_one_taped_side_give_everything() -> None:
    table = columns([*WAIT, *LEFT_SQUARE, *RIGHT_SQUARE, *WAIT])
    begin, end = np.searchsorted(table["t"], [1.0, 5.1])
    side = math.hypot(
        table["truth.x"][end] - table["truth.x"][begin], table["truth.y"][end] - table["truth.y"][begin]
    )
    made = manoeuvre_from_columns(without(table, "truth"), ROBOT, taped=[TapedWay(1.0, 5.1, side)])
    found = calibrate_drive(ROBOT, [made])
    assert_found(found)
    assert found.left.std / found.left.value > 0.002, "cannot be better than the tape"


def test_a_tape_that_cannot_be_or_surprises_is_told() -> None:
    """0.3 m read for 0.6, or times that hold a part of the way, would halve or double every way to come."""
    table = columns([*WAIT, *LEFT_SQUARE, *RIGHT_SQUARE, *WAIT])

    def taped(begin: float, end: float, metres: float) -> Any:
        piece = [TapedWay(begin, end, metres)]
        return calibrate_drive(ROBOT, [manoeuvre_from_columns(without(table, "truth"), ROBOT, taped=piece)])

    assert taped(1.0, 5.1, 0.6).remarks == ()
    assert "was this motor or wheel changed, or the tape misread?" in taped(1.0, 5.1, 0.5).remarks[0]
    for begin, end, metres in ((1.0, 5.1, 0.28), (1.0, 2.7, 0.6)):
        with pytest.raises(CalibrationError, match="times the expected one: check the tape and its times"):
            taped(begin, end, metres)
    with pytest.raises(CalibrationError, match=r"taped from 100 to 200 s is not in the recording, .* from 0"):
        taped(100.0, 200.0, 0.6)


def test_both_wheels_alike_off_are_the_tape_s_or_its_times() -> None:
    device = replace(SI_WORDS, position_counts_seconds=0.1)
    ticks = 0.1 * SI_WORDS.bemf_volts / K_E
    (remark,) = describe_surprises(ROBOT, device, [Measured(0.7 * ticks, 0.001 * ticks)] * 2)
    assert remark == (
        "both motors' radians_per_tick are 0.700 times what robot.toml says: read the tape and its times "
        "again, or the reference"
    )
    known = MotorConfig(radians_per_tick=Measured(ticks, 0.01 * ticks))
    robot = RobotConfig(motors={0: known, 1: known})
    both = describe_surprises(
        robot, device, [Measured(0.8 * ticks, 0.02 * 0.8 * ticks), Measured(1.2 * ticks, 0.0)]
    )
    assert [each.partition(": ")[0] for each in both] == [
        "radians_per_tick of the left motor (port 0) is 0.800 times what robot.toml says, 8.9 of its "
        "standard deviations off",  # 0.2 of 0.01 and 0.02 together
        "radians_per_tick of the right motor (port 1) is 1.200 times what robot.toml says, 20.0 of its "
        "standard deviations off",
    ]


def test_a_tape_that_outweighs_motion_capture_is_no_better_for_it() -> None:
    """A tape read 1 % wrong, as its deviation says that it may be: what comes of it says so too."""
    table = columns([*WAIT, *LEFT_SQUARE, *RIGHT_SQUARE, *WAIT])
    begin, end = np.searchsorted(table["t"], [1.0, 5.1])
    side = math.dist(*([table["truth.x"][row], table["truth.y"][row]] for row in (begin, end)))
    exact = calibrate_drive(ROBOT, [manoeuvre_from_columns(table, ROBOT)])
    found = calibrate_drive(
        ROBOT, [manoeuvre_from_columns(table, ROBOT, taped=[TapedWay(1.0, 5.1, 1.01 * side, 0.006)])]
    )
    for name in ("left", "right"):
        moved = getattr(found, name).value - getattr(exact, name).value
        assert abs(moved) > 2.0 * getattr(exact, name).std
        assert abs(moved) < 2.0 * getattr(found, name).std


def test_four_ways_taped_with_one_tape_are_twice_as_sure_as_one() -> None:
    """Of a poor one, beside which the rest does not matter: 1 cm of a side."""
    table = columns([*WAIT, *LEFT_SQUARE, *RIGHT_SQUARE, *WAIT])
    shares = []
    for count in (1, 4):
        taped = []
        for begin, end in ((1.0 + 5.4 * side, 5.1 + 5.4 * side) for side in range(count)):
            rows = np.searchsorted(table["t"], [begin, end])
            way = math.hypot(*np.diff(table["truth.x"][rows]), *np.diff(table["truth.y"][rows]))
            taped.append(TapedWay(begin, end, way, 0.01))
        found = calibrate_drive(ROBOT, [manoeuvre_from_columns(without(table, "truth"), ROBOT, taped=taped)])
        shares.append(found.left.std / found.left.value)
    assert shares == pytest.approx([0.01 / 0.6, 0.5 * 0.01 / 0.6], rel=0.15)


def test_motion_capture_that_is_slower_than_the_rows_gives_everything() -> None:
    table = columns([*WAIT, *LEFT_SQUARE, *RIGHT_SQUARE, *WAIT])
    rows = np.arange(len(table["t"]))
    blank = (rows % 8 != 3) | ((rows > 2000) & (rows < 2200))
    table |= {name: np.where(blank, np.nan, table[name]) for name in table if name.startswith("truth")}
    assert_found(calibrate_drive(ROBOT, [manoeuvre_from_columns(table, ROBOT)]))


def test_the_gyro_is_read_at_the_scale_that_robot_toml_gives_it() -> None:
    table = columns([*WAIT, *LEFT_SQUARE, *RIGHT_SQUARE, *WAIT])
    begin, end = np.searchsorted(table["t"], [1.0, 5.1])
    side = math.hypot(
        table["truth.x"][end] - table["truth.x"][begin], table["truth.y"][end] - table["truth.y"][begin]
    )
    table = without(table, "truth")
    table["imu.gyro.z"] = 1.03 * table["imu.gyro.z"]
    robot = parse_robot({"model": {"imu": {"gyro_scale": {"value": 1.03, "std": 0.02}}}})
    found = calibrate_drive(robot, [manoeuvre_from_columns(table, robot, taped=[TapedWay(1.0, 5.1, side)])])
    assert found.track_width.value == pytest.approx(TRACK * 1.03, rel=0.005)
    share = found.track_width.std / found.track_width.value
    assert 0.019 < share < 0.025, "cannot be better than the gyro's scale"
    assert found.left.std / found.left.value < 0.01, "the wheels' way is the tape's"
    deviations = []
    for scale in (1.03, {"value": 1.03, "std": 0.005 * 1.03}):  # what a plain number is known to
        robot = parse_robot({"model": {"imu": {"gyro_scale": scale}}})
        found = calibrate_drive(
            robot, [manoeuvre_from_columns(table, robot, taped=[TapedWay(1.0, 5.1, side)])]
        )
        deviations.append(found.track_width.std)
    assert deviations[0] == pytest.approx(deviations[1])


def test_calibration_makes_the_path_true() -> None:
    table = columns([*WAIT, *LEFT_SQUARE, *RIGHT_SQUARE, *WAIT])
    found = calibrate_drive(ROBOT, [manoeuvre_from_columns(table, ROBOT)])
    robot = found.applied(ROBOT)
    again = manoeuvre_from_columns(columns([*WAIT, *RIGHT_SQUARE, *LEFT_SQUARE, *WAIT], seed=5), robot)
    end = integrate_path(np.ones(3), robot, again)[-1]
    assert again.truth is not None
    assert math.dist(end[:2], again.truth[-1, :2]) < 0.03


def test_recordings_of_several_drives_are_fitted_together() -> None:
    made = [
        manoeuvre_from_columns(columns([*WAIT, *square, *WAIT], seed=seed), ROBOT)
        for seed, square in enumerate((LEFT_SQUARE, RIGHT_SQUARE, LEFT_SQUARE, RIGHT_SQUARE))
    ]
    assert_found(calibrate_drive(ROBOT, made))


def test_inverted_motor_and_back_emf_alone_give_the_same() -> None:
    table = columns([*WAIT, *LEFT_SQUARE, *RIGHT_SQUARE, *WAIT])
    table["motor.0.bemf"] = -table["motor.0.bemf"]
    robot = RobotConfig(motors={0: MotorConfig(inverted=True)})
    found = calibrate_drive(robot, [manoeuvre_from_columns(without(table, "motor.0.p", "motor.1.p"), robot)])
    assert found.left_offset is not None
    assert found.left_offset.value == pytest.approx(-31.5, abs=1.0)
    assert found.track_width.value == pytest.approx(TRACK * 1.03, rel=0.01)


def test_entries_are_keys_that_robot_toml_knows() -> None:
    made = manoeuvre_from_columns(columns([*WAIT, *LEFT_SQUARE, *RIGHT_SQUARE, *WAIT]), ROBOT)
    found = calibrate_drive(ROBOT, [made])
    table: dict[str, Any] = {}
    for key, value in found.entries(ROBOT).items():
        inner = table
        for name in key.split(".")[:-1]:
            inner = inner.setdefault(name, {})
        inner[key.split(".")[-1]] = {"value": value.value, "std": value.std}
    robot = parse_robot(table)
    assert robot.model.drive.track_width == Measured(found.track_width.value, found.track_width.std)
    assert found.applied(ROBOT).motor(1).bemf_offset == found.right_offset


def made(segments: Sequence[Segment], *leave_out: str) -> Manoeuvre:
    return manoeuvre_from_columns(without(columns(segments), *leave_out), ROBOT)


@pytest.mark.parametrize(
    ("segments", "leave_out", "reason"),
    [
        ([*WAIT, *LEFT_SQUARE, *WAIT], (), "degrees left and 0 right: with one turning direction"),
        ([*WAIT, *RIGHT_SQUARE, *WAIT], (), "right: with one turning direction.*once to the left"),
        ([*WAIT, (3.0, 0.2, 0.0), *WAIT], (), "degrees left and 0 right"),
        ([*WAIT, *LEFT_SQUARE, *RIGHT_SQUARE], ("truth",), "no length is known"),
        ([*WAIT, *WAIT], (), "the wheels went 0.0. m: at least 0.3 m"),
    ],
)
def test_a_manoeuvre_that_cannot_tell_is_refused(
    segments: list[Segment], leave_out: tuple[str, ...], reason: str
) -> None:
    with pytest.raises(CalibrationError, match=reason):
        calibrate_drive(ROBOT, [made(segments, *leave_out)])


def test_a_heading_that_scatters_at_the_start_is_as_unsure_as_a_wrong_one_moves_the_result() -> None:
    """The mean of the first four rows, of +- 0.01 rad, may be wrong by 0.01 rad / sqrt(3)."""
    found = []
    for headings in ([0.01, -0.01, 0.01, -0.01], [0.0] * 4, [0.01 / math.sqrt(3.0)] * 4):
        seen = circles()
        assert seen.truth is not None
        seen.truth[:4, 2] += headings
        found.append(fit_drive(ROBOT, [seen], device=SI_WORDS))
    for name in ("left", "right", "track_width"):
        unsure, right, wrong = (getattr(each, name) for each in found)
        assert unsure.std == pytest.approx(abs(wrong.value - right.value), rel=0.15)


def test_a_turning_direction_that_only_one_recording_has_is_of_unknown_deviation() -> None:
    whole = circles()
    with pytest.raises(CalibrationError, match="left wheel: without a part of these recordings it is not"):
        fit_drive(ROBOT, [whole.piece(0, 150), whole.piece(149, 299)], device=SI_WORDS)


def test_a_tape_without_a_gyro_is_refused() -> None:
    table = without(columns([*WAIT, *LEFT_SQUARE, *RIGHT_SQUARE]), "truth", "imu")
    with pytest.raises(CalibrationError, match="no turn is known"):
        calibrate_drive(ROBOT, [manoeuvre_from_columns(table, ROBOT, taped=[TapedWay(1.0, 5.0, 0.6)])])


def test_no_recording_at_all_is_refused() -> None:
    with pytest.raises(CalibrationError, match="no recording"):
        calibrate_drive(ROBOT, [])


@pytest.mark.parametrize("missing", ["t", "motor.0"])
def test_a_missing_column_is_named(missing: str) -> None:
    reason = "no column t" if missing == "t" else "motor 0 has neither"
    with pytest.raises(CalibrationError, match=reason):
        manoeuvre_from_columns(without(columns([*WAIT, *LEFT_SQUARE]), missing), ROBOT)


@pytest.mark.parametrize("times", [range(19), [*range(20), math.nan], [*range(20), 18.0]])
def test_times_that_do_not_rise_are_refused(times: Sequence[float]) -> None:
    with pytest.raises(CalibrationError, match="column t: at least 20 rising times are needed"):
        manoeuvre_from_columns({"t": np.array(times, dtype=float)}, ROBOT)


def recorded_runs(parity: int) -> list[dict[str, Array]]:
    """Square runs of the motion-capture recordings (20 Hz; x, y, heading, right and left ticks a cycle)."""
    files = sorted(data_path("optiodom").glob("square-*/run-*.csv"))
    tables = []
    for file in files:
        if int(file.stem[4:]) % 2 != parity:
            continue
        rows = np.loadtxt(file, delimiter=",")
        tables.append(
            {
                "t": rows[:, 0],
                "truth.x": rows[:, 1],
                "truth.y": rows[:, 2],
                "truth.heading": rows[:, 3],
                "motor.0.position": np.cumsum(rows[:, 5]),
                "motor.1.position": np.cumsum(rows[:, 4]),
            }
        )
    return tables


def recorded_robot() -> RobotConfig:
    tick = {"value": 2 * math.pi / (64 * 43.7), "std": 0.0}
    motor = {"radians_per_tick": tick, "bemf_offset": {"value": 0.0, "std": 0.0}}
    drive_table = {"wheel_radius": 0.042, "track_width": {"value": 0.2, "std": 0.004}}
    return parse_robot({"motor": {"0": motor, "1": motor}, "model": {"drive": drive_table}})


def test_recorded_squares_calibrated_on_odd_runs_hold_on_even_ones() -> None:
    robot = recorded_robot()
    odd = [manoeuvre_from_columns(table, robot) for table in recorded_runs(1)]
    found = calibrate_drive(robot, odd).applied(robot)
    errors: dict[str, list[float]] = {"nominal": [], "fitted": []}
    for table in recorded_runs(0):
        for name, used in (("nominal", robot), ("fitted", found)):
            each = manoeuvre_from_columns(table, used)
            assert each.truth is not None
            start = each.truth[0]
            driven = integrate_path(np.ones(3), used, each)
            turn = np.array(
                [[math.cos(start[2]), -math.sin(start[2])], [math.sin(start[2]), math.cos(start[2])]]
            )
            placed = driven[:, :2] @ turn.T + start[:2]
            errors[name] += ((placed - each.truth[:, :2]) ** 2).sum(axis=1).tolist()
    rms = {name: 1e3 * math.sqrt(float(np.mean(each))) for name, each in errors.items()}
    # A careful fit over all kinds of paths reaches 8.1 mm; its nominal geometry 22 mm.
    assert rms["fitted"] < 8.1
    assert rms["fitted"] < 0.5 * rms["nominal"]
