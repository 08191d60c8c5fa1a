"""The robot's tophats in lights that change, with stored sets, and with sensors that are not as they were."""

import math
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from random import Random

import pytest

from raccoon import (
    Action,
    CalibrationError,
    ConfigError,
    MotionTimeout,
    Robot,
    after_distance,
    after_time,
    align_on_line,
    calibrate_tophats,
    drive,
    load_tophats,
    move,
    on_black,
    open_robot,
    seq,
    servo,
    wait,
)
from raccoon.core.config import MechanismConfig, ServoConfig
from raccoon.core.readings import Inputs, Status
from raccoon.estimate.tophat import calibrate
from raccoon.estimate.tophat.calibration import Surface, TophatCalibration, Verdict
from raccoon.estimate.tophat.standing_calibration import calibrate_standing
from raccoon.estimate.tophat.store import StoredCalibration, TophatStore
from raccoon.model import reflectance
from raccoon.model.reflectance import FULL_SCALE
from raccoon.robot.actions.actions import Steps
from raccoon.sim.world.table import Line, World
from robots import FULL_RATE as CONFIG
from robots import InterceptingPort, tophat_calibration
from robots import simulated_port as simulated_port_of
from standing_port import StandingPort

simulated_port = partial(simulated_port_of, config=CONFIG)

LINES = "".join(
    f"[[line]]\npoints = [[{0.3 + 0.37 * i:.2f}, -1.0], [{0.3 + 0.37 * i:.2f}, 1.0]]\nwidth = 0.02\n"
    for i in range(12)
)


def table(tmp_path: Path, light: str = "") -> World:
    file = tmp_path / "table.toml"
    file.write_text(f'name = "stripes"\n{LINES}{light}', encoding="utf-8")
    return World.from_file(file)


def compared(action: Action[object], seen: list[tuple[float, bool, bool]]) -> Action[None]:
    """The action; time, what each tophat says and what is true go into `seen`, once a tick and sensor."""

    def steps(robot: Robot) -> Steps[None]:
        for _ in action.start(robot):
            assert robot.inputs is not None
            assert robot.inputs.truth is not None
            for sensor in robot.tophats.values():
                truth = robot.inputs.truth.surface[sensor.config.analog]
                seen.append((robot.time, bool(sensor.black), bool(truth)))
            yield

    return Action("compared", steps)


@pytest.mark.parametrize(
    ("light", "way"),
    [
        ("[[light]]\nlow = [1.1, -2.0]\nhigh = [1.8, 2.0]\nambient = 0.6\n", 2.0),
        ("[[light]]\nlow = [-2.0, -2.0]\nhigh = [9.0, 2.0]\nambient = 0.8\nend = 6.0\n", 1.5),
        ("[[light]]\nlow = [-2.0, -2.0]\nhigh = [9.0, 2.0]\nambient = 0.3\nbegin = 6.0\n", 1.2),
    ],
    ids=["sun patch", "sun goes", "sun comes"],
)
def test_lines_are_told_in_a_light_that_changes(tmp_path: Path, light: str, way: float) -> None:
    seen: list[tuple[float, bool, bool]] = []
    with open_robot(CONFIG, port=simulated_port(world=table(tmp_path, light))) as robot:
        robot.run(wait(0.3))
        calibrate_tophats(robot, 0.5)
        assert robot.time < 5.5
        robot.run(compared(drive(0.24).until(after_distance(way)), seen))
    assert sum(black for _, _, black in seen) > 60
    wrong = sum(black is not truth for _, black, truth in seen)
    assert wrong <= 0.02 * len(
        seen
    )  # the ticks in which hysteresis and debounce lag behind an edge among them


@pytest.mark.parametrize(("distance", "speed"), [(-0.3, None), (0.3, -0.2), (-0.3, -0.2), (-0.3, 0.2)])
def test_a_negative_way_is_driven_backwards(
    distance: float, speed: float | None, monkeypatch: pytest.MonkeyPatch
) -> None:
    loaded_at: list[int] = []
    port = simulated_port(world=World(lines=(Line(((-0.1, -1.0), (-0.1, 1.0))),)))
    with open_robot(CONFIG, port=port) as robot:
        monkeypatch.setattr(
            "raccoon.estimate.tophat.mixture.load_scikit_learn", lambda: loaded_at.append(robot.ticks)
        )
        calibrate_tophats(robot, distance, speed)
        assert robot.pose.x == pytest.approx(-0.3, abs=0.03)
    assert loaded_at == [0]  # which takes ten seconds on a Raspberry Pi 3: before it moves


def test_a_stored_set_that_does_not_fit_is_said_within_a_second_of_driving(tmp_path: Path) -> None:
    store = tmp_path / "tophats.json"
    with open_robot(CONFIG, port=simulated_port(world=table(tmp_path))) as robot:
        robot.run(wait(0.3))
        calibrate_tophats(robot, 0.5, store=store, set_name="hall")
    light = "[[light]]\nlow = [-2.0, -2.0]\nhigh = [9.0, 2.0]\nambient = 0.2\n"
    with open_robot(CONFIG, port=simulated_port(world=table(tmp_path, light))) as robot:
        load_tophats(robot, store, "hall")
        robot.run(wait(6.0))  # as for the start light: it was taken for proved by then
        robot.run(drive(0.2).until(after_distance(0.2)))
        assert any("left does not read" in said for said in robot.drive.remarks.values())
        assert robot.tophat("left").status is Status.UNCERTAIN
    with open_robot(CONFIG, port=simulated_port(world=table(tmp_path))) as robot:
        load_tophats(robot, store, "hall")
        robot.run(wait(0.3))
        robot.run(drive(0.2).until(after_distance(0.7)))
        assert not any("tophat" in said for said in robot.drive.remarks.values())
        assert robot.tophat("left").status is Status.OK


def test_a_set_may_lie_beside_a_program_that_is_started_from_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As the robot.toml does: the controller's screen starts programs from a folder of its own."""
    team, other = tmp_path / "team", tmp_path / "other"
    for folder in (team, other):
        folder.mkdir()
    monkeypatch.setattr(sys.modules["__main__"], "__file__", str(team / "program.py"), raising=False)
    with open_robot(CONFIG, port=simulated_port(world=table(tmp_path))) as robot:
        robot.run(wait(0.3))
        monkeypatch.chdir(team)
        calibrate_tophats(robot, 0.4, store="tophats.json")
        monkeypatch.chdir(other)
        assert set(load_tophats(robot)) == {"left", "right"}
        calibrate_tophats(robot, 0.4, store="tophats.json")  # the same file goes on, there is no second one
    assert list(other.iterdir()) == []
    assert len(TophatStore(team / "tophats.json").history()) == 4


def test_two_robots_may_share_a_file(tmp_path: Path) -> None:
    store = tmp_path / "tophats.json"
    levels = {"one": 300.0, "two": 600.0}  # newest last
    found = {
        name: calibrate([white + n % 7 for n in range(200)] + [2800.0 + n % 7 for n in range(100)])
        for name, white in levels.items()
    }
    TophatStore(store).add(
        *(
            StoredCalibration(sensor, "default", f"2026-01-0{day}T09:00:00+00:00", found[name], name)
            for day, name in enumerate(levels, 1)
            for sensor in ("left", "right")
        )
    )
    for name, used, said in (("one", "one", False), ("two", "two", False), ("three", "two", True)):
        robot = Robot(StandingPort(), replace(CONFIG, name=name))
        assert load_tophats(robot, store)["left"].threshold == found[used].threshold
        assert any("is from the robot 'two'" in each for each in robot.drive.remarks.values()) is said


def test_no_real_robot_goes_by_what_a_simulated_one_read(tmp_path: Path) -> None:
    """A sweep at home was the newest calibration at the tournament."""
    found = {
        name: calibrate([white + n % 7 for n in range(200)] + [2800.0 + n % 7 for n in range(100)])
        for name, white in ((CONFIG.name, 300.0), (f"{CONFIG.name} (simulated)", 600.0))
    }
    stored = {
        name: [StoredCalibration(sensor, "hall", "", each, name) for sensor in ("left", "right")]
        for name, each in found.items()
    }
    real, virtual = Robot(StandingPort(), CONFIG), Robot(simulated_port(), CONFIG)
    mine, its, both = (TophatStore(tmp_path / f"{name}.json") for name in ("mine", "its", "both"))
    for store, names in ((mine, [CONFIG.name]), (its, [*found][1:]), (both, [*found])):
        store.add(*(each for name in names for each in stored[name]))
    for robot, store, name in ((real, both, 0), (virtual, both, 1), (virtual, mine, 0), (virtual, its, 1)):
        used = load_tophats(robot, store.path, "hall")["left"]
        assert used.threshold == found[[*found][name]].threshold
    with pytest.raises(CalibrationError, match=r"there is 'hall' of left \(simulated\), right"):
        load_tophats(real, its.path, "hall")
    assert not virtual.drive.remarks


def test_a_set_that_is_not_there_is_said(tmp_path: Path) -> None:
    with (
        open_robot(CONFIG, port=simulated_port()) as robot,
        pytest.raises(
            CalibrationError,
            match=r"no calibration of left, right in the set 'default'; the file does not exist",
        ),
    ):
        load_tophats(robot, tmp_path / "none.json")


def test_what_is_there_instead_of_a_set_is_said(tmp_path: Path) -> None:
    store = tmp_path / "tophats.json"
    with open_robot(CONFIG, port=simulated_port(world=table(tmp_path))) as robot:
        with pytest.raises(
            CalibrationError, match=r"the file does not exist: calibrate_tophats\(\.\.\., store=\)"
        ):
            load_tophats(robot, store)
        robot.run(wait(0.3))
        calibrate_tophats(robot, 0.4, store=store, set_name="hall")
        with pytest.raises(CalibrationError, match=r"in the set 'hal'; there is 'hall' of left, right$"):
            load_tophats(robot, store, "hal")


def damaged(folder: Path) -> Path:
    file = folder / "damaged.json"
    file.write_text('{"format": 1, "calibr', encoding="utf-8")
    return file


def folder_instead(folder: Path) -> Path:
    file = folder / "folder.json"
    file.mkdir()
    return file


def in_a_file(folder: Path) -> Path:
    (folder / "file").touch()
    return folder / "file" / "tophats.json"


@pytest.mark.parametrize("make", [damaged, folder_instead, in_a_file])
def test_a_store_that_cannot_keep_it_is_said_before_the_drive(
    tmp_path: Path, make: Callable[[Path], Path]
) -> None:
    with open_robot(CONFIG, port=simulated_port(world=table(tmp_path))) as robot:
        store = make(tmp_path)
        with pytest.raises(ConfigError, match=store.name):
            calibrate_tophats(robot, 0.9, store=store)
        assert robot.ticks == 0


@pytest.mark.parametrize("before", [False, True], ids=["full after the drive", "before it"])
def test_a_calibration_that_the_card_does_not_take_is_used_and_that_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, before: bool
) -> None:
    def full(*_given: object, **_more: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("raccoon.estimate.tophat.store.write_atomically", full)
    if before:
        monkeypatch.setattr("tempfile.mkstemp", full)
    store = tmp_path / "new" / "tophats.json"
    with open_robot(CONFIG, port=simulated_port(world=table(tmp_path))) as robot:
        robot.run(wait(0.3))
        found = calibrate_tophats(robot, 0.4, store=store)
        assert robot.tophat("left").calibration == found["left"]
        said = (
            f"the tophats are calibrated, but the calibration could not be stored in {store}: [Errno "
            "28] No space left on device"
        )
        assert said in robot.drive.remarks.values()
        assert not list(store.parent.iterdir())


def rewired(inputs: Inputs, change: Callable[[list[float | None]], None], begin: float) -> Inputs:
    """The analog readings go through `change` from `begin` s on."""
    counts = list(inputs.analog)
    if inputs.time > begin:
        change(counts)
    return replace(inputs, analog=tuple(counts))


def unplug(counts: list[float | None]) -> None:
    counts[0] = 4095.0


def silence(counts: list[float | None]) -> None:
    counts[0] = None


def flood(counts: list[float | None]) -> None:
    counts[0] = 1.0


def swap(counts: list[float | None]) -> None:
    counts[0], counts[1] = counts[1], counts[0]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (unplug, "tophat left reads the top of the scale"),
        (silence, "tophat left is not read"),
        (flood, "tophat left reads the bottom of the scale"),
    ],
)
def test_a_sensor_that_sees_nothing_any_more_is_said(
    change: Callable[[list[float | None]], None], said: str
) -> None:
    port = InterceptingPort(simulated_port(), seen=lambda inputs: rewired(inputs, change, 1.0))
    with open_robot(CONFIG, port=port) as robot:
        for sensor in robot.tophats.values():
            sensor.calibrate(tophat_calibration())
        robot.run(drive(0.15).until(after_time(0.8)))
        assert not robot.drive.remarks
        robot.run(drive(0.15).until(after_time(1.2)))
        assert any(each.startswith(said) for each in robot.drive.remarks.values())
        assert robot.tophat("left").status is Status.INVALID


def test_sensors_that_are_exchanged_while_the_robot_drives_are_said(tmp_path: Path) -> None:
    port = simulated_port(world=table(tmp_path), effects={"tophat.height@1": {"height": 0.015}})
    with open_robot(CONFIG, port=InterceptingPort(port, seen=lambda each: rewired(each, swap, 5.5))) as robot:
        robot.run(wait(0.3))
        calibrate_tophats(robot, 0.5)
        assert robot.time < 5.5
        robot.run(drive(0.24).until(after_distance(0.7)))
        assert any(
            each.startswith("tophat left reads what right should") for each in robot.drive.remarks.values()
        )
        assert robot.tophat("left").status is Status.UNCERTAIN


@pytest.mark.parametrize(
    ("counts", "said"),
    [
        (
            2400.0,
            "is a tophat, and no other sensor, plugged into analog 0",
        ),  # a distance sensor, of the floor
        (4095.0, r"no light, or unplugged\); check the plug of analog 0$"),
        (0.0, r"wires that touch, or too much light\); check the plug of analog 0$"),
    ],
)
def test_a_port_without_a_tophat_is_named_by_a_calibration(tmp_path: Path, counts: float, said: str) -> None:
    def other(words: list[float | None]) -> None:
        words[0] = counts

    port = InterceptingPort(
        simulated_port(world=table(tmp_path)), seen=lambda inputs: rewired(inputs, other, 0.0)
    )
    with (
        open_robot(CONFIG, port=port) as robot,
        pytest.raises(CalibrationError, match=rf"^after 0.4 m: left: .*{said}"),
    ):
        calibrate_tophats(robot, 0.4)


def test_an_open_port_sees_no_line_and_is_said_while_the_robot_stands() -> None:
    """It floats between the surfaces and about black, as on the emulated controllers."""
    noise, level = Random(1), 2500.0

    def wander(counts: list[float | None]) -> None:
        nonlocal level
        level = min(max(level + noise.gauss(0.0, 20.0), 2300.0), 2900.0)
        counts[0] = level

    is_open = False
    port = InterceptingPort(
        simulated_port(), seen=lambda each: rewired(each, wander, 0.0) if is_open else each
    )
    with open_robot(CONFIG, port=port) as robot:
        for sensor in robot.tophats.values():
            sensor.calibrate(tophat_calibration())
        robot.run(wait(1.5))
        assert not robot.blind
        is_open = True
        robot.run(wait(1.5))
        assert (robot.tophat("left").black, robot.tophat("left").status) == (None, Status.INVALID)
        wanders = "tophat left: its reading wanders while the robot stands: is it plugged into analog 0"
        assert any(wanders in each for each in robot.drive.remarks.values())
        with pytest.raises(MotionTimeout, match=wanders):
            robot.run(drive(0.15).until(on_black("left")).timeout(0.3))
        with pytest.raises(MotionTimeout, match=wanders):
            robot.run(align_on_line("left", "right", reach=0.05))
        is_open = False
        robot.run(wait(1.5))
        assert not robot.blind


@pytest.mark.parametrize(("turned", "light"), [(0.0, 0.01), (1.0, 0.02)])
def test_a_robot_that_is_carried_from_black_to_its_start_on_white_sees_white(
    turned: float, light: float
) -> None:
    """As after a calibration by hand. What its sensors read in the air was taken for other light, and white
    for black in that, until the first line or for ever. turned: rad/s meanwhile. light: at the start."""
    noise, model = Random(1), reflectance.fit("new")
    at_table, in_the_air = model.at(0.007), model.at(0.06)
    white, black = (FULL_SCALE / (1.0 + float(at_table.light(dark, 0.02))) for dark in (0.0, 1.0))
    place = "black"

    def carried(inputs: Inputs) -> Inputs:
        time, gyro = inputs.time, inputs.gyro
        seen = float(at_table.light(0.0, light)) if place == "white" else FULL_SCALE / black - 1.0
        if place == "air":
            seen = float(in_the_air.light(0.0, 0.02 + 0.01 * math.sin(5.0 * time)))
            assert gyro is not None
            gyro = (0.0, 0.0, turned * math.sin(2.0 * time) / inputs.device.gyro_rad_s)
        counts = round(FULL_SCALE / (1.0 + seen) + noise.gauss(0.0, 3.0))
        return replace(inputs, analog=(counts,) * len(inputs.analog), gyro=gyro)

    with open_robot(CONFIG, port=InterceptingPort(simulated_port(), seen=carried)) as robot:
        robot.run(wait(0.1))
        for sensor in robot.tophats.values():
            levels = ([level + i % 5 - 2.0 for i in range(200)] for level in (white, black))
            sensor.calibrate(calibrate_standing(*levels))
        for now, seconds in (("black", 0.3), ("air", 1.7), ("white", 1.0)):
            place = now
            robot.run(wait(seconds))
        resting = [(each.black, each.status) for each in robot.tophats.values()]
        robot.run(drive(0.15).until(after_distance(0.05)))
        driving = [(each.black, each.status) for each in robot.tophats.values()]
        assert resting == driving == [(False, Status.OK)] * 2


def test_a_sensor_that_an_arm_shakes_over_an_edge_is_plugged_in() -> None:
    noise = Random(2)

    def shake(counts: list[float | None]) -> None:
        counts[0] = 2500.0 + noise.gauss(0.0, 60.0)

    config = replace(CONFIG, mechanisms={"arm": MechanismConfig(2)}, servos={"claw": ServoConfig(0)})
    port = InterceptingPort(simulated_port(config=config), seen=lambda each: rewired(each, shake, 0.5))
    with open_robot(config, port=port) as robot:
        for sensor in robot.tophats.values():
            sensor.calibrate(tophat_calibration())
        robot.run(seq(wait(0.5), move("arm", 3.0, 2.0), servo("claw", 1000, seconds=1.0)))
        assert not robot.blind
        robot.run(wait(1.5))
        assert robot.blind  # nothing moves, and it does


def test_sensors_that_were_exchanged_since_they_were_calibrated_are_said(tmp_path: Path) -> None:
    exchanged = False
    sim = simulated_port(world=table(tmp_path), effects={"tophat.height@1": {"height": 0.015}})
    port = InterceptingPort(sim, seen=lambda each: rewired(each, swap, 0.0) if exchanged else each)
    with open_robot(CONFIG, port=port) as robot:
        calibrate_tophats(robot, 0.4)
        exchanged = True
        calibrate_tophats(robot, 0.4)
        said = list(robot.drive.remarks.values())
    assert any("left and right each read what the other one read at its last" in each for each in said)
    assert not any("higher or lower" in each for each in said)


@pytest.mark.parametrize(
    ("change", "said"), [(silence, "is not read"), (unplug, "reads the top of the scale")]
)
def test_who_waits_for_a_line_in_vain_is_told_that_the_sensor_sees_nothing(
    change: Callable[[list[float | None]], None], said: str
) -> None:
    def rewire(inputs: Inputs) -> Inputs:
        counts = list(inputs.analog)
        change(counts)
        return replace(inputs, analog=tuple(counts))

    surfaces = Surface(1270.0, 10.0, 300), Surface(3800.0, 10.0, 100)
    known = TophatCalibration(Verdict.OK, "", *surfaces, threshold=1900.0, low=1850.0, high=2000.0)
    with open_robot(CONFIG, port=InterceptingPort(simulated_port(world=World.empty()), seen=rewire)) as robot:
        robot.tophat("left").calibrate(known)
        with pytest.raises(MotionTimeout, match=f"the wheels follow; tophat left {said}"):
            robot.run(drive(0.1).until(on_black("left")).timeout(1.5))


def test_a_sensor_that_comes_loose_while_it_is_calibrated_is_said(tmp_path: Path) -> None:
    def rewire(inputs: Inputs) -> Inputs:
        counts = list(inputs.analog)
        if inputs.time > 2.0:
            unplug(counts)
        return replace(inputs, analog=tuple(counts))

    with open_robot(
        CONFIG, port=InterceptingPort(simulated_port(world=table(tmp_path)), seen=rewire)
    ) as robot:
        calibrate_tophats(robot, 0.5)
        said = [each for each in robot.drive.remarks.values() if "with care" in each]
    assert [each[:15] for each in said] == ["use tophat left"]
    assert "loose wire" in said[0]
