from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from blind.drives import exciting
from blind.generator import Noise, make
from diagnoses import make_diagnosis
from raccoon.core.config import RobotConfig, parse_robot
from raccoon.core.errors import HoldoutError, TraceError
from raccoon.core.readings import BEMF_VOLTS_PER_COUNT
from raccoon.diagnose.diagnosis import diagnose
from raccoon.diagnose.drives.log import log_from_columns
from raccoon.diagnose.drives.time_column import check_time
from raccoon.diagnose.drives.units import check_units
from raccoon.diagnose.experiment.manoeuvres import manoeuvre
from raccoon.diagnose.fit.linear_model import linearise
from raccoon.diagnose.fit.problem import Problem
from raccoon.diagnose.recordings import drive as drive_diagnosis
from raccoon.diagnose.recordings.diagnosis import diagnose_recording
from raccoon.diagnose.recordings.rows.repeated import without_duplicate_times
from raccoon.diagnose.result import Diagnosis, Verdict
from raccoon.diagnose.unknown.probes import make_probe_function

ROBOT = RobotConfig()
COUNT, K_E = BEMF_VOLTS_PER_COUNT, ROBOT.model.left.back_emf_constant.value
Columns = dict[str, np.ndarray]


@pytest.fixture(scope="module")
def good() -> Columns:
    return dict(make(4, seconds=8.0).columns)


def check(columns: Columns, robot: RobotConfig = ROBOT) -> None:
    check_units(log_from_columns(columns, robot), robot)


def test_a_good_recording_passes(good: Columns) -> None:
    check(good)


@pytest.mark.parametrize(
    ("column", "factor", "said"),
    [
        ("motor.0.duty", 100.0, "percent"),
        ("motor.0.duty", 6.8, r"volts \(column motor\.N\.voltage\) or percent"),
        ("motor.0.duty", 255.0, "PWM of 8 bits"),
        ("motor.0.duty", 400.0, "a Wombat's PWM"),
        ("motor.0.duty", 1500.0, "ticks a second"),
        ("imu.gyro.z", 57.3, "degrees"),
        ("imu.gyro.z", 954.0, "the sensor's own counts"),
        ("motor.1.bemf", 0.0033, "volts"),
        ("battery.voltage", 1 / 0.008862, "counts"),
        ("battery.voltage", 1000.0, "millivolts"),
        ("imu.gyro.z", 1 / 6.2832, "turns a second"),
        ("battery.voltage", 0.5, "about 6.8 V drive the motors: it looks like one cell's"),
        ("motor.1.bemf", 3.296, "millivolts, not counts"),
        ("motor.0.bemf", COUNT / K_E, "volts or radians a second|radians a second or volts"),
        ("motor.0.bemf", 9.549 * COUNT / K_E, "turns a minute, not counts"),
        ("motor.0.bemf", 0.034 * COUNT / K_E, "metres a second, not counts"),
        ("motor.0.bemf", 0.0625, r"1[3-8] times too small: is it in counts\?"),
        ("motor.0.duty", 0.5, r"none reaches that; is it in counts, and is full power 1\?"),
        ("motor.0.bemf", -1.0, "opposite sign"),
        ("imu.gyro.z", -1.0, "swapped"),
    ],
)
def test_wrong_units_and_signs_are_said(good: Columns, column: str, factor: float, said: str) -> None:
    with pytest.raises(TraceError, match=said):
        check({**good, column: factor * good[column]})


@pytest.mark.parametrize(
    ("factor", "said"),
    [
        (57.3, "degrees a second"),
        (9.549, "turns a minute"),
        (1 / 6.2832, "turns a second"),
        (0.0345, "metres a second"),
        (34.5, "millimetres a second"),
        (5.0, "is it in rad/s, and robot.toml this robot's"),
    ],
)
def test_an_encoder_in_another_unit_is_said(good: Columns, factor: float, said: str) -> None:
    """One in turns a minute, nearly ten times too large, was diagnosed as a robot that is as assumed."""
    encoders = {name: each for name, each in good.items() if "bemf" not in name}
    for port in (0, 1):
        volts = good[f"motor.{port}.bemf"] * BEMF_VOLTS_PER_COUNT
        encoders[f"motor.{port}.speed"] = volts / ROBOT.model.left.back_emf_constant.value
    check(encoders)
    with pytest.raises(TraceError, match=said):
        check({**encoders, "motor.1.speed": factor * encoders["motor.1.speed"]})


@pytest.mark.parametrize(("factor", "said"), [(57.3, "degrees"), (-1.0, "turns against the wheels")])
def test_a_gyro_beside_encoders_is_judged_too(factor: float, said: str) -> None:
    """Mirrored it was diagnosed as if it were not: only back-EMF was asked for its sign."""
    columns = dict(make(6, seconds=8.0, encoders=True).columns)
    columns = {name: each[:-1] for name, each in columns.items()}
    check(columns)
    with pytest.raises(TraceError, match=said):
        check({**columns, "imu.gyro.z": factor * columns["imu.gyro.z"]})


def test_a_battery_that_robot_toml_has_wrong_is_no_wrong_unit(good: Columns) -> None:
    """Back-EMF and the battery's own reading agree: that is for the diagnosis to say."""
    check(good, parse_robot({"model": {"battery": {"open_circuit_voltage": 4.5}}}))


def test_a_gyro_that_does_not_turn_with_the_robot_is_said(good: Columns) -> None:
    """The column of another axis, or wheels in the air."""
    noise = 0.02 * np.random.default_rng(2).standard_normal(len(good["t"]))
    with pytest.raises(TraceError, match="another axis, or were the wheels off the floor"):
        check({**good, "imu.gyro.z": noise})


def test_volts_in_millivolts_are_said(good: Columns) -> None:
    volts = {name: each for name, each in good.items() if "duty" not in name and "battery" not in name}
    volts |= {f"motor.{port}.voltage": 6800.0 * good[f"motor.{port}.duty"] for port in (0, 1)}
    with pytest.raises(TraceError, match=r"motor\.N\.voltage reaches .* millivolts"):
        diagnose_recording(volts, ROBOT)


@pytest.mark.parametrize("port", [0, 1])
def test_one_motor_that_turns_the_other_way_is_said(good: Columns, port: int) -> None:
    """Command and reading of a motor that is wired the other way agree; its turns do not suit the gyro."""
    names = (f"motor.{port}.duty", f"motor.{port}.bemf")
    with pytest.raises(
        TraceError, match=rf"motor {port} turns the other way .* inverted = true under \[motor\.{port}\]"
    ):
        check({**good, **{name: -good[name] for name in names}})
    wrong = parse_robot({"motor": {str(port): {"inverted": True}}})
    with pytest.raises(TraceError, match=f"motor {port} turns the other way .* inverted = false"):
        check(good, wrong)


def straight(wander: float) -> Columns:
    """A robot that drives straight back and forth, and is steered by so many rad/s."""
    time = np.arange(0.0, 8.0, 0.005)
    speed, turn = 4.0 * np.sign(np.sin(time)), wander * np.sin(2.3 * time)
    model = ROBOT.model
    wheel = 0.5 * turn * model.drive.track_width.value / model.drive.wheel_radius.value
    counts = model.left.back_emf_constant.value / BEMF_VOLTS_PER_COUNT
    noise = np.random.default_rng(3)
    found = {"t": time, "imu.gyro.z": turn + 0.003 * noise.standard_normal(len(time))}
    for port, sign in ((0, -1.0), (1, 1.0)):
        found[f"motor.{port}.duty"] = 0.75 * np.sign(speed) + sign * 0.05 * turn
        found[f"motor.{port}.bemf"] = counts * (speed + sign * wheel) + noise.standard_normal(len(time))
    return found


@pytest.mark.parametrize("port", [0, 1])
def test_one_motor_that_turns_the_other_way_is_said_of_a_robot_that_nearly_drives_straight(port: int) -> None:
    """Its wheels went alike all the time, so nobody asked whose turns the gyro sees."""
    columns, names = straight(0.4), (f"motor.{port}.duty", f"motor.{port}.bemf")
    check(columns)
    with pytest.raises(TraceError, match=rf"motor {port} .* write inverted = true under \[motor\.{port}\]"):
        check({**columns, **{name: -columns[name] for name in names}})


def test_wheels_that_go_against_each_other_all_the_time_are_no_lazy_gyro() -> None:
    """A robot that only drove straight, with a motor the other way round, had "another axis"."""
    columns = straight(0.0)
    check(columns)
    with pytest.raises(TraceError, match="If it drove straight, one motor turns the other way than robot"):
        check({**columns, **{f"motor.1.{kind}": -columns[f"motor.1.{kind}"] for kind in ("duty", "bemf")}})


@pytest.mark.parametrize("kind", ["duty", "bemf"])
def test_columns_of_the_two_wheels_that_are_swapped_are_said(good: Columns, kind: str) -> None:
    left, right = (f"motor.{port}.{kind}" for port in (0, 1))
    with pytest.raises(TraceError, match="follows the command of motor"):
        check({**good, left: good[right], right: good[left]})


def test_swapped_commands_are_said_of_a_drive_that_is_mostly_straight() -> None:
    """Each wheel follows the other's command by 0.87 there."""
    left = np.repeat([0.5, -0.5, 0.6, -0.6, 0.4, -0.4, 0.5, 0.3, -0.5, -0.3], 200)
    right = np.repeat([0.5, -0.5, 0.6, -0.6, 0.4, -0.4, 0.3, -0.3, -0.5, 0.2], 200)
    noise = np.random.default_rng(2).normal(0.0, 5.0, (2, len(left)))
    columns = {
        "t": 0.005 * np.arange(len(left)),
        "motor.0.duty": left,
        "motor.1.duty": right,
        "motor.0.bemf": 1700.0 * left + noise[0],
        "motor.1.bemf": 1700.0 * right + noise[1],
        "battery.voltage": np.full(len(left), 6.8),
    }
    assert 0.8 < float(np.corrcoef(left, right)[0, 1]) < 0.9
    check(columns)
    with pytest.raises(TraceError, match="follows the command of motor"):
        check({**columns, "motor.0.duty": right, "motor.1.duty": left})


def test_an_encoder_that_counts_against_its_command_is_said_without_a_gyro(good: Columns) -> None:
    encoders = {name: each for name, each in good.items() if "bemf" not in name and "gyro" not in name}
    for port, sign in ((0, 1.0), (1, -1.0)):
        encoders[f"motor.{port}.speed"] = sign * good[f"motor.{port}.bemf"] / 303.4 / 1.08
    with pytest.raises(TraceError, match=r"motor\.1\.speed has the opposite sign"):
        check(encoders)


def test_a_simulation_without_numbers_is_an_error_that_says_what_to_check(problem: Problem) -> None:
    linear = linearise(problem, problem.nominal(), ["friction.coulomb@left"])
    nowhere = replace(linear, residual=np.full_like(linear.residual, np.nan))
    with pytest.raises(TraceError, match="gives no finite numbers"):
        make_probe_function(problem)(nowhere)


def test_a_straight_line_says_nothing_of_the_gyros_sign() -> None:
    """A robot that pulls to the left while the right counter reads too little is wired well."""
    straight = dict(make(4, drive=manoeuvre("back and forth")).columns)
    straight["imu.gyro.z"] = straight["imu.gyro.z"] + 0.1 * straight["motor.0.duty"]
    straight["motor.1.bemf"] = 0.85 * straight["motor.1.bemf"]
    check(straight)


def test_empty() -> None:
    with pytest.raises(TraceError, match="empty"):
        diagnose({"t": np.zeros(0)}, ROBOT)


def test_two_samples(good: Columns) -> None:
    with pytest.raises(TraceError, match="2 samples"):
        diagnose({key: column[:2] for key, column in good.items()}, ROBOT)


def test_what_is_a_moment_too_short_is_not_said_to_be_long_enough(good: Columns) -> None:
    with pytest.raises(TraceError, match=r"400 samples over 1\.995 s"):
        check({**{key: column[:400] for key, column in good.items()}, "t": 0.005 * np.arange(400)})


@pytest.mark.parametrize(("factor", "unit"), [(1e3, "milliseconds"), (1e6, "microseconds")])
def test_time_in_another_unit(good: Columns, factor: float, unit: str) -> None:
    with pytest.raises(TraceError, match=f"looks like {unit}, not seconds"):
        check({**good, "t": factor * good["t"]})
    with pytest.raises(TraceError, match=f"looks like {unit}, not seconds"):
        diagnose_recording({**good, "t": factor * good["t"]}, ROBOT)


@pytest.mark.parametrize("kind", ["drive", "geometry"])
def test_time_in_another_unit_is_no_fault_of_a_reference_or_of_the_wheels(good: Columns, kind: str) -> None:
    """The heading was said to be in another unit, and without commands the wheels to be a fifth as large."""
    turned = 1e3 * good["t"]
    columns = {**good, "t": turned, **{f"truth.{name}": np.cos(good["t"]) for name in ("x", "y", "heading")}}
    if kind == "geometry":
        columns = {name: each for name, each in columns.items() if "duty" not in name}
    with pytest.raises(TraceError, match="looks like milliseconds, not seconds"):
        diagnose_recording(columns, ROBOT)


@pytest.mark.parametrize("within", [False, True])
def test_rows_in_which_wheels_answer_are_refused(within: bool) -> None:
    """Of a command that changes one cycle after a row the next row shows 15 ms of answer; of one that changes
    at a row it shows none, and every fourth row of 200 Hz is all there is to know."""
    duty = np.repeat(np.random.default_rng(2).uniform(-1.0, 1.0, 40), 60)
    duty = np.concatenate([duty[:1], duty[:-1]]) if within else duty
    speed = np.asarray(lfilter([0.15], [1.0, -0.85], np.concatenate([[0.0], duty[:-1]])), float)
    wheels = {f"motor.{port}.duty": duty for port in (0, 1)}
    wheels |= {f"motor.{port}.bemf": 1600.0 * speed for port in (0, 1)}
    fourth = {key: each[::4] for key, each in ({"t": 0.005 * np.arange(2400.0)} | wheels).items()}
    assert log_from_columns(fourth, parse_robot({"controller": {"rate_hz": 50.0}})).notes == ()
    if within:
        with pytest.raises(TraceError, match=r"a row every 20 ms.*known.*controller\.rate_hz = 50 into"):
            log_from_columns(fourth, ROBOT)
    else:
        (note,) = log_from_columns(fourth, ROBOT).notes
        assert "as slow as its rows; if it is, write controller.rate_hz = 50 into robot.toml" in note


@pytest.mark.parametrize("own", [False, True])
def test_behind_a_median_the_gyro_tells_that_rows_are_no_cycles(own: bool) -> None:
    """The wheels' readings are as old as every third row is long. own: of a program that is as slow."""
    duty = exciting(np.random.default_rng(1), 16.0)
    duty = np.repeat(duty[::3], 3, axis=0)[: len(duty)] if own else duty
    every = make(1, [], duty, 16.0, Noise(drop_share=0.0), imu_rate=190.0).columns
    changes = np.flatnonzero(np.diff(every["motor.0.duty"])) + 1
    first = int(np.bincount(changes % 3).argmax()) if own else 0
    third = {name: each[first::3] for name, each in every.items()}
    if own:
        assert "assumed to be as slow as its rows" in log_from_columns(third, ROBOT).notes[0]
    else:
        with pytest.raises(TraceError, match=r"a row every 15 ms.*controller\.rate_hz = 66\.7 into"):
            log_from_columns(third, ROBOT)


def test_rows_that_no_controller_has_are_refused(good: Columns) -> None:
    check({key: column[::2] for key, column in good.items()})
    with pytest.raises(TraceError, match=r"a row every 60 ms.*at least every 12\.5 ms$"):
        check({key: column[::12] for key, column in good.items()})


def test_a_time_of_too_few_digits_is_said(good: Columns) -> None:
    """Seconds since 1970 in six digits."""
    with pytest.raises(TraceError, match=r"must advance, and never does: .* too few digits"):
        check({**good, "t": np.full_like(good["t"], 1.79591e9)})


def test_a_time_that_is_rounded_is_said(good: Columns) -> None:
    with pytest.raises(TraceError, match=r"must advance, and stands still in 50 % .* rounded to 0\.01 s"):
        check({**good, "t": np.round(good["t"], 2)})


def test_a_time_that_jumps_by_more_than_a_drive_lasts_is_said(good: Columns) -> None:
    time = good["t"].copy()
    time[-1] = 1e300
    with pytest.raises(TraceError, match=r"t jumps from 7\.\d+ s to 1e\+300 s at row 15"):
        check({**good, "t": time})


@pytest.mark.parametrize("port", [0, 1])
def test_back_emf_in_words_without_a_sign_is_said(good: Columns, port: int) -> None:
    """It had the opposite sign of its command."""
    name = f"motor.{port}.bemf"
    words = np.where(good[name] < 0.0, good[name] + 65536.0, good[name])
    with pytest.raises(TraceError, match=rf"motor\.{port}\.bemf reaches 65535: numbers below 0 .* 16 bits"):
        diagnose({**good, name: words}, ROBOT)


@pytest.mark.parametrize("port", [0, 1])
def test_a_reading_of_the_opposite_sign_is_no_motor_that_is_the_other_way_round(
    good: Columns, port: int
) -> None:
    """The wheels then turn as the gyro does not, all the time. (Inverting the motor changes its command.)"""
    name = f"motor.{port}.bemf"
    said = rf"motor\.{port}\.bemf has the opposite sign of its command \(robot.toml's inverted flips both\)"
    with pytest.raises(TraceError, match=said):
        diagnose({**good, name: -good[name]}, ROBOT)


@pytest.mark.parametrize("zero", [0.7, -0.8])
def test_a_gyro_whose_zero_is_far_off_is_no_robot_in_a_hand(good: Columns, zero: float) -> None:
    name = "imu.gyro.z"
    with pytest.raises(TraceError, match=r"imu\.gyro\.z says -?0\.[78]\d? rad/s more .*its zero is off"):
        diagnose({**good, name: good[name] + zero}, ROBOT)


def test_an_angle_in_the_place_of_the_gyro_is_not_only_a_robot_in_a_hand(good: Columns) -> None:
    name = "imu.gyro.z"
    heading = np.cumsum(np.nan_to_num(good[name])) * 0.005
    with pytest.raises(TraceError, match=r"lifted, or .* Or imu\.gyro\.z does not turn as .* an angle"):
        diagnose({**good, name: 5.0 * (heading - heading.mean())}, ROBOT)


def test_back_emf_of_fewer_bits_is_no_fault_of_the_gyro(good: Columns) -> None:
    """Of both wheels in quarters of counts the gyro was said to be in another unit."""
    quarters = {f"motor.{port}.bemf": 0.25 * good[f"motor.{port}.bemf"] for port in (0, 1)}
    with pytest.raises(TraceError, match=r"are .* times too small for what imu\.gyro\.z says"):
        check({**good, **quarters})


def test_time_that_goes_back(good: Columns) -> None:
    time = good["t"].copy()
    time[100] = time[90]
    with pytest.raises(TraceError, match="must advance"):
        diagnose({**good, "t": time}, ROBOT)


def test_time_that_is_no_number(good: Columns) -> None:
    time = good["t"].copy()
    time[100] = np.nan
    with pytest.raises(TraceError, match="not a number"):
        diagnose({**good, "t": time}, ROBOT)


def test_no_commands(good: Columns) -> None:
    columns = {key: column for key, column in good.items() if "duty" not in key}
    with pytest.raises(TraceError, match="no commands"):
        diagnose(columns, ROBOT)


def test_another_robots_ports(good: Columns) -> None:
    with pytest.raises(TraceError, match=r"motor\.2\.duty is not in the recording"):
        diagnose(good, parse_robot({"drive": {"left": 2, "right": 3}}))


def test_constant_commands_cannot_tell(good: Columns) -> None:
    still = {**good, "motor.0.duty": 0.0 * good["t"], "motor.1.duty": 0.0 * good["t"]}
    still["motor.0.bemf"] = still["motor.1.bemf"] = 0.0 * good["t"]
    assert diagnose(still, ROBOT).verdict is Verdict.NOT_IDENTIFIABLE


def test_inverted_wiring_is_taken_away(good: Columns) -> None:
    robot = parse_robot({"motor": {"0": {"inverted": True}}})
    flipped = {**good, "motor.0.duty": -good["motor.0.duty"], "motor.0.bemf": -good["motor.0.bemf"]}
    plain, turned = log_from_columns(good, ROBOT), log_from_columns(flipped, robot)
    assert np.array_equal(plain.duty, turned.duty)
    assert np.array_equal(plain.channels[0].values, turned.channels[0].values, equal_nan=True)


def test_a_command_holds_until_the_next_one_and_none_is_none() -> None:
    """As for raccoon replay. The first command was taken for that of all rows before it: a robot that stood
    was said to have been switched off while it was driven."""
    given = np.full(1000, np.nan)
    given[[400, 600]] = 0.5, -0.3
    columns = {"t": 0.005 * np.arange(1000), "motor.0.duty": given, "motor.1.duty": np.zeros(1000)}
    log = log_from_columns(columns, ROBOT)
    assert log.duty[:, 0].tolist() == [0.0] * 400 + [0.5] * 200 + [-0.3] * 400


def test_a_missing_channel_is_named(good: Columns) -> None:
    log = log_from_columns({key: each for key, each in good.items() if "gyro" not in key}, ROBOT)
    assert "imu.gyro.z" in log.missing
    assert log.channel("gyro") is None


def test_samples_that_were_written_twice_are_left_out_of_the_recording_and_of_what_judges_it(
    good: Columns, monkeypatch: pytest.MonkeyPatch
) -> None:
    again = np.insert(np.arange(len(good["t"])), [500, 900], [499, 899])
    twice = {name: each[again] for name, each in good.items()}
    once, said = without_duplicate_times(twice)
    assert "2 samples have the time of the one before and are left out" in said[0]
    for name, each in good.items():
        np.testing.assert_array_equal(once[name], each)
    other = {name: each[: len(good["t"])] for name, each in make(5, seconds=8.0).columns.items()}
    compared: list[Columns] = []

    def answer(columns: Columns, _: RobotConfig, *, holdout: Columns, **__: object) -> Diagnosis:
        compared.extend((columns, holdout))
        return make_diagnosis()

    monkeypatch.setattr(drive_diagnosis, "diagnose", answer)
    found = diagnose_recording(twice, ROBOT, holdout={name: each[again] for name, each in other.items()})
    assert said[0] in found.notes
    for columns, whole in zip(compared, (good, other), strict=True):
        np.testing.assert_array_equal(columns["t"], whole["t"])
    assert without_duplicate_times(good) == (good, ())
    assert without_duplicate_times({}) == ({}, ())


def test_a_robot_that_stands_judges_nothing(good: Columns) -> None:
    """A battery's resistance was said to be seen again in a recording of a robot at rest."""
    still = {name: 0.0 * each if name.endswith("duty") else each for name, each in good.items()}
    with pytest.raises(HoldoutError, match=r"commands never change.*it validates nothing"):
        diagnose(good, ROBOT, holdout=still)


@pytest.mark.parametrize(
    ("step", "said"),
    [
        (0.5, "in hundredths of a second; at most 0.2 s are allowed"),
        (1.0, "like milliseconds or hundredths of a second, or numbers of rows, not"),
        (5.0, "like milliseconds, not"),
        (2000.0, "like microseconds, not"),
    ],
)
def test_the_unit_of_a_time_is_named(step: float, said: str) -> None:
    with pytest.raises(TraceError, match=said):
        check_time(np.linspace(0.0, 8.0 * step, 9))
