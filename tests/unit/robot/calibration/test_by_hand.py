"""Tophats calibrated by hand: the robot is put over white, then over black, and seldom right at once."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from raccoon import CalibrationError, ConfigError, calibrate_tophats_by_hand, load_tophats, open_robot, wait
from raccoon.core.readings import Inputs
from raccoon.core.sections import ControllerConfig
from raccoon.model.reflectance import fit
from raccoon.robot.robot import Robot
from robots import CONFIG, InterceptingPort
from standing_port import StandingPort

WHITE, BLACK = 180.0, 2930.0
Where = Mapping[str, float] | Callable[[float], Mapping[str, float]]
RIGHTLY = EVERYWHERE_WHITE, EVERYWHERE_BLACK = tuple({"left": each, "right": each} for each in (WHITE, BLACK))


class Hands(InterceptingPort):
    """A robot that is put from place to place: counts of each tophat there, or of the time there (s)."""

    def __init__(self, *places: Where) -> None:
        super().__init__(StandingPort(), seen=self._read)
        self._rng, self._places, self._there = np.random.default_rng(3), list(places), 0.0
        self.asked: list[str] = []
        self._place: Where = EVERYWHERE_WHITE

    def placed(self, what: str) -> None:
        self.asked.append(what)
        self._place, self._there = self._places.pop(0), 0.0

    def _read(self, inputs: Inputs) -> Inputs:
        self._there += 0.005
        place = self._place(self._there) if callable(self._place) else self._place
        counts = [place["left"], place["right"], *inputs.analog[2:]]
        noisy = (each and min(max(round(each + self._rng.normal(0.0, 3.0)), 0), 4095) for each in counts)
        return replace(inputs, analog=tuple(noisy))


def by_hand(port: Hands, *names: str, store: Path | None = None) -> Robot:
    with open_robot(CONFIG, port=port) as robot:
        found = calibrate_tophats_by_hand(robot, *names, placed=port.placed, store=store)
        assert {name: robot.tophat(name).calibration for name in found} == found
        assert not any(any(each.duty) for each in port.written)
        return robot


def test_white_then_black_and_the_levels_are_those() -> None:
    port = Hands(EVERYWHERE_WHITE, EVERYWHERE_BLACK)
    robot = by_hand(port)
    assert port.asked == [f"put tophats left and right over {each}" for each in ("white", "black")]
    for sensor in robot.tophats.values():
        assert sensor.calibration is not None
        white, black = sensor.calibration.surfaces()
        assert (white.mean, black.mean) == pytest.approx((WHITE, BLACK), abs=2.0)
        # Half of a spot that sees both: 21.75 and 0.398 of light, and 4095 / (1 + 11.07).
        assert sensor.calibration.threshold == pytest.approx(339.0, rel=0.25)
        assert sensor.calibration.verdict == "ok"
    assert not robot.drive.remarks


def test_one_of_them_may_be_calibrated_alone_and_is_kept(tmp_path: Path) -> None:
    store = tmp_path / "tophats.json"
    robot = by_hand(Hands(EVERYWHERE_WHITE, EVERYWHERE_BLACK), "right", store=store)
    assert robot.tophat("left").calibration is None
    with (
        open_robot(CONFIG, port=Hands()) as other,
        pytest.raises(CalibrationError, match="of left"),
    ):
        load_tophats(other, store)


def test_exchanged_surfaces_are_taken_for_what_they_are_and_said() -> None:
    robot = by_hand(Hands(EVERYWHERE_BLACK, EVERYWHERE_WHITE))
    calibration = robot.tophat("left").calibration
    assert calibration is not None
    assert calibration.surfaces()[0].mean == pytest.approx(WHITE, abs=2.0)
    assert any("black and white are swapped" in said for said in robot.drive.remarks.values())


TREMBLING: Where = lambda time: dict.fromkeys(("left", "right"), WHITE * (1.0 + 0.3 * np.sin(20.0 * time)))  # noqa: E731
A_HAND_LEAVES: Where = lambda time: dict.fromkeys(("left", "right"), 400.0 if time < 1.0 else WHITE)  # noqa: E731


@pytest.mark.parametrize(
    ("places", "said"),
    [
        ([TREMBLING, *RIGHTLY], "left was not steady"),
        ([A_HAND_LEAVES, *RIGHTLY], "keep your shadow off the sensor"),
        ([EVERYWHERE_WHITE, EVERYWHERE_WHITE, *RIGHTLY], "was it over both"),
        (
            [EVERYWHERE_WHITE, {"left": BLACK, "right": WHITE}, *RIGHTLY],
            "tophat right read 180 counts over white and 180 over black",
        ),
        (
            [{"left": WHITE, "right": BLACK}, {"left": BLACK, "right": WHITE}, *RIGHTLY],
            "right read 2930 counts over white and 180 over black, the opposite of the other tophats",
        ),
        (
            [EVERYWHERE_WHITE, {"left": BLACK, "right": 1000.0}, *RIGHTLY],
            "1000 counts over black, and left 2930, though both read white alike: was right partly",
        ),
    ],
    ids=["held", "shaded", "not moved", "one beside the line", "one on the line", "one over its edge"],
)
def test_what_went_wrong_is_said_and_asked_for_again(places: Sequence[Where], said: str) -> None:
    port = Hands(*places)
    robot = by_hand(port)
    assert len(port.asked) == len(places)
    assert any(said in each for each in port.asked)
    assert all(each.calibration is not None for each in robot.tophats.values())


def test_a_tophat_that_stays_unlike_its_neighbour_is_used_with_care() -> None:
    unlike = EVERYWHERE_WHITE, {"left": BLACK, "right": 1000.0}
    robot = by_hand(Hands(*unlike * 3))
    assert any("all the same: tophat right" in each for each in robot.drive.remarks.values())


@pytest.mark.parametrize(
    ("left", "said"),
    [
        ((4095.0, 4095.0), "no light, or unplugged"),
        ((2400.0, 2407.0), "is a tophat plugged into analog 0"),  # a distance sensor looks at the floor
        ((0.0, 0.0), "bottom"),
        ((None, None), "is not read: its port, analog 0, gave 0 readings"),
    ],
    ids=["unplugged", "a distance sensor", "shorted", "silent"],
)
def test_a_port_without_a_tophat_is_named_in_the_end_and_nothing_is_changed(
    left: tuple[float, float], said: str
) -> None:
    places = [{"left": each, "right": right} for each, right in zip(left, (WHITE, BLACK), strict=True)]
    port = Hands(*places * 3)
    with open_robot(CONFIG, port=port) as robot:
        with pytest.raises(CalibrationError, match="left") as caught:
            calibrate_tophats_by_hand(robot, placed=port.placed)
        assert said in str(caught.value)
        assert "right" not in str(caught.value)
        assert robot.tophat("right").calibration is None


def test_what_cannot_be_is_said_before_anybody_is_asked(tmp_path: Path) -> None:
    port = Hands()
    with open_robot(CONFIG, port=port) as robot:
        with pytest.raises(ConfigError, match="rear"):
            calibrate_tophats_by_hand(robot, "rear", placed=port.placed)
        with pytest.raises(ConfigError, match="it is a folder, a device or a pipe; name a file"):
            calibrate_tophats_by_hand(robot, placed=port.placed, store=tmp_path)
        with pytest.raises(TypeError, match="takes a function of the what"):
            calibrate_tophats_by_hand(robot, placed=lambda: None)  # type: ignore[arg-type, misc]
    with (
        open_robot(replace(CONFIG, tophats={}), port=port) as robot,
        pytest.raises(ConfigError, match="there is no tophat in"),
    ):
        calibrate_tophats_by_hand(robot, placed=port.placed)
    assert not port.asked


def test_the_controllers_button_says_that_it_is_done(capsys: pytest.CaptureFixture[str]) -> None:
    port = Hands()

    def seen(inputs: Inputs) -> Inputs:
        """Pressed from 0.1 to 0.3 s, and from 2 to 2.2 s, after which it is over black."""
        port._place = EVERYWHERE_WHITE if inputs.time < 51.9 else EVERYWHERE_BLACK
        return replace(port._read(inputs), extra={"button": float(0.1 < (inputs.time - 50.0) % 1.9 < 0.3)})

    port.seen = seen
    config = replace(CONFIG, controller=ControllerConfig(port="wombat"))
    with open_robot(config, port=port) as robot:
        calibrate_tophats_by_hand(robot)
        assert robot.time - 50.0 == pytest.approx(2.2 + 1.5, abs=0.05)
    assert capsys.readouterr().out.splitlines() == [
        f"put tophats left and right over {each}, and press the button" for each in ("white", "black")
    ]


@pytest.mark.parametrize("kind", ["sim", "emulator"])
def test_somebody_holds_a_simulated_robot_over_white_and_black(kind: str) -> None:
    """Over what its sensors were measured on; afterwards they see the table."""
    config = replace(CONFIG, controller=ControllerConfig(port=kind))
    optics = fit("new").at(0.007)
    with open_robot(config) as robot:
        found = calibrate_tophats_by_hand(robot)
        assert robot.time == pytest.approx(2 * (0.5 + 0.2 + 1.5), abs=0.1)
        for each in found.values():
            assert each.white
            assert each.black
            assert each.white.mean == pytest.approx(optics.counts(0.0, 0.0), abs=5.0)
            assert each.black.mean == pytest.approx(optics.counts(1.0, 0.0), abs=5.0)
        robot.run(wait(0.1))
        assert robot.tophat("left").black is False
        assert not robot.drive.remarks
