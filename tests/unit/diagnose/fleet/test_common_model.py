"""What the recordings of a robot have in common, as one model."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest

from diagnoses import make_cause, make_diagnosis
from raccoon.core.config import RobotConfig
from raccoon.diagnose.fleet.common_model import CrossCheck, _ModelPool, common_model, make_cross_check
from raccoon.diagnose.fleet.summary import Fleet, fleet_of
from raccoon.diagnose.reports.fleet_text import fleet_report
from raccoon.diagnose.result import (
    ChannelResult,
    Diagnosis,
    ParameterResult,
    Rejected,
    Verdict,
)
from raccoon.sim.effects.effect import effect
from raccoon.sim.effects.parameters import Parameters
from raccoon.sim.effects.provenance import Origin

NAMES = ("battery.internal_resistance", "motor.back_emf_constant@left", "drive.slope")
FIRST = {
    "battery.internal_resistance": "resistance",
    "motor.back_emf_constant": "factor",
    "drive.slope": "along_x",
}


def drive(friction: float = 0.2, rmse: float = 3.0, **causes: float) -> Diagnosis:
    """A drive that refitted its friction, and the causes that it names: battery, motor (the left), slope."""
    model = Parameters().with_effect("friction.coulomb", torque=friction)
    model = model.with_origin("friction.coulomb", None, Origin({"torque": 0.01}, "refitted"))
    named = []
    for key, value in causes.items():
        name = next(each for each in NAMES if key in each)
        id_, _, where = name.partition("@")
        model = model.with_effect(id_, where or None, **{FIRST[id_]: value})
        model = model.with_origin(id_, where or None, Origin({FIRST[id_]: 0.004}, "named: it is so", 0.9))
        numbers = {FIRST[id_]: ParameterResult(value, 0.004, "", 1.0)}
        named.append(make_cause(name, numbers, "It is so.", probability=0.9))
    rejected = tuple(Rejected(each, "it is as assumed") for each in NAMES)
    channel = ChannelResult("imu.gyro.z", "rad/s", rmse, 1.0, 1.0, 0.5)
    return make_diagnosis(
        *named, verdict=Verdict.EXPLAINED, channels=(channel,), rejected=rejected, model=model
    )


def of(drives: Sequence[Diagnosis]) -> Fleet:
    return fleet_of({f"day{day}": each for day, each in enumerate(drives)})


def effects(fleet: Fleet, name: str | None = None) -> Mapping[tuple[str, str | None], Mapping[str, float]]:
    model = common_model(fleet, name)
    assert model is not None
    return model.effects


def test_what_most_drives_name_is_in_it_and_what_one_does_is_not() -> None:
    weak = [0.94, 0.95, 0.96, 0.95]
    fleet = of([drive(motor=each, **({"slope": 0.03} if each == 0.96 else {})) for each in weak])
    model = common_model(fleet)
    assert model is not None
    assert set(model.effects) == {("friction.coulomb", None), ("motor.back_emf_constant", "left")}
    assert model.value("motor.back_emf_constant", "factor", "left") == 0.95
    origin = model.origins[("motor.back_emf_constant", "left")]
    assert origin.source == "named in 4 of 4 recordings"
    assert origin.probability == 0.9
    assert origin.std["factor"] == pytest.approx(math.hypot(1.4826 * 0.005, 0.004 / 2.0))


def test_what_is_refitted_is_the_median_of_those_that_do_not_name_it() -> None:
    fleet = of([drive(each) for each in (0.18, 0.19, 0.26)])
    assert effects(fleet) == {("friction.coulomb", None): {"torque": 0.19}}
    assert effects(fleet, "day2") == {("friction.coulomb", None): {"torque": pytest.approx(0.185)}}


def test_of_two_causes_that_are_not_told_apart_one_is_in_it() -> None:
    """Five drives named a weak left motor and four a smaller left wheel, each or the other: both were common,
    and the model had twice what is wrong."""
    motor, wheel = NAMES[1], "drive.wheel_radius@left"
    weak = drive(motor=0.94)
    weak = replace(weak, causes=(replace(weak.causes[0], confounded_with=("drive.wheel_radius",)),))
    named = make_cause(wheel, {"factor": ParameterResult(0.94, 0.004, "", 1.0)}, confounded_with=(motor,))
    model = Parameters().with_effect("drive.wheel_radius", "left", factor=0.94)
    small = replace(
        drive(), causes=(named,), model=model.with_origin("drive.wheel_radius", "left", Origin({}, "named"))
    )
    fleet = of([weak, small, weak, small, weak, small, weak, small, weak])
    assert [(each.name, each.common, each.instead) for each in fleet.causes] == [
        (motor, True, ""),
        (wheel, False, motor),
    ]
    assert set(effects(fleet)) == {("friction.coulomb", None), ("motor.back_emf_constant", "left")}
    told = f"[{wheel}]: 100 % of 4 that can tell (instead of K_E (left) in day1, day3, day5, day7), 0.94"
    assert told in fleet_report(fleet)
    both = replace(weak, causes=(replace(weak.causes[0], confounded_with=()), named))
    assert all(each.common for each in of([both] * 4).causes)


def test_a_slope_is_of_the_place_where_a_run_began() -> None:
    """Most of a week's runs were on one table, and each began in another direction."""
    assert ("drive.slope", None) not in effects(of([drive(slope=0.03) for _ in range(5)]))


def test_a_part_that_was_replaced_is_as_it_is_since() -> None:
    fleet = of([drive(motor=1.05 if day < 4 else 0.93) for day in range(8)])
    assert effects(fleet)[("motor.back_emf_constant", "left")]["factor"] == 0.93
    assert effects(fleet, "day6")[("motor.back_emf_constant", "left")]["factor"] == 0.93
    assert effects(fleet, "day1")[("motor.back_emf_constant", "left")]["factor"] == 1.05


def test_one_that_was_only_before_the_last_jump_is_not_in_it() -> None:
    fleet = of([drive(motor=0.9) if day < 4 else drive() for day in range(8)])
    assert ("motor.back_emf_constant", "left") not in effects(fleet)
    assert ("motor.back_emf_constant", "left") in effects(fleet, "day2")


def test_what_creeps_is_where_it_has_come_to() -> None:
    fleet = of([drive(battery=0.06 + 0.01 * day) for day in range(8)])
    key = ("battery.internal_resistance", None)
    assert effects(fleet)[key]["resistance"] == pytest.approx(0.13)
    assert effects(fleet, "day7")[key]["resistance"] == pytest.approx(0.13)  # foreseen by seven others
    assert effects(fleet, "day2")[key]["resistance"] == pytest.approx(0.08)


def refitted(**causes: float) -> Diagnosis:
    """A drive whose causes are within robot.toml's standard deviation."""
    return replace(drive(**causes), causes=())


def test_what_creeps_is_followed_before_it_is_named() -> None:
    """A battery that runs down is named on the last four of ten days: the model had the charge of the first
    six, and foresaw the last ones worse than robot.toml did."""
    fleet = of([(drive if day > 5 else refitted)(battery=0.05 + 0.008 * day) for day in range(10)])
    key = ("battery.internal_resistance", None)
    assert effects(fleet)[key]["resistance"] == pytest.approx(0.122)
    assert effects(fleet, "day9")[key]["resistance"] == pytest.approx(0.122)
    assert effects(fleet, "day2")[key]["resistance"] == pytest.approx(0.066)
    model = common_model(fleet)
    assert model is not None
    assert model.origins[key].source == "named in 4 of 10 recordings"


def test_a_replaced_part_that_is_named_now_and_then_is_as_it_is_since() -> None:
    days = [refitted(motor=1.0)] * 5 + [(drive if day % 3 else refitted)(motor=0.96) for day in range(6)]
    days = [*days[:6], refitted(motor=0.96), *days[6:]]
    fleet = of(days)
    assert effects(fleet)[("motor.back_emf_constant", "left")]["factor"] == 0.96
    assert effects(fleet, "day1")[("motor.back_emf_constant", "left")]["factor"] == 1.0


@pytest.mark.parametrize(("scatter", "own"), [(0.03, 0.01), (0.0, 0.01)])
def test_how_sure_a_line_is_of_the_next_number_is_what_it_is_off_by(scatter: float, own: float) -> None:
    """Of five recordings, in the mean square over many fleets: scatter^2 (1 + h), h the next one's leverage.
    Three tenths of that were said. Where nothing scatters the line is as sure as its numbers make it."""
    rng, names = np.random.default_rng(3), [f"day{day}" for day in range(6)]
    pool = _ModelPool({}, {name: row for row, name in enumerate(names)}, "day5")
    parameter = effect("battery.internal_resistance").parameters[0]
    design = np.stack([np.ones(5), np.arange(5.0)], axis=1)
    leverage = np.array([1.0, 5.0]) @ np.linalg.inv(design.T @ design) @ np.array([1.0, 5.0])
    said, off = [], []
    for numbers in 0.3 + 0.05 * np.arange(6) + scatter * rng.standard_normal((1500, 6)):
        value, std = pool._value_on_trend(parameter, names[:5], numbers[:5], [own] * 5)
        said.append(std**2)
        off.append((numbers[5] - value) ** 2)
    assert np.mean(off) == pytest.approx(scatter**2 * (1.0 + leverage), rel=0.1, abs=1e-20)
    expected = np.mean(off) if scatter else own**2 * leverage
    assert np.mean(said) == pytest.approx(expected, rel=0.1)


def test_the_one_to_foresee_has_no_say() -> None:
    fleet = of([drive(motor=each) for each in (0.95, 0.95, 0.95, 0.7)])
    assert effects(fleet, "day3")[("motor.back_emf_constant", "left")]["factor"] == 0.95
    assert common_model(of([drive()]), "day0") is None
    assert common_model(fleet_of({"tophat": make_diagnosis()})) is None


def test_a_model_can_be_written_and_read(tmp_path_factory: pytest.TempPathFactory) -> None:
    path = tmp_path_factory.mktemp("model") / "model.toml"
    model = common_model(of([drive(motor=0.94, battery=0.1) for _ in range(3)]))
    assert model is not None
    model.save(path)
    again = Parameters.from_model_file(path)
    assert again == model
    assert again.origins == model.origins


def test_inertias_are_those_of_all() -> None:
    nominal = RobotConfig().model.drive.inertia_turn
    model = common_model(of([drive() for _ in range(3)]))
    assert model is not None
    assert model.robot.model.drive.inertia_turn.value == nominal.value


def test_what_a_model_foresees_is_said_in_units_of_the_noise() -> None:
    first, again = drive(rmse=3.0, motor=0.94), drive(rmse=1.2, slope=0.03)
    assert make_cross_check(first, again) == CrossCheck(3.0, 1.2, 1.0, ("drive.slope",))
