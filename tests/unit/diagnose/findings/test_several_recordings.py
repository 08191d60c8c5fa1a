"""Recordings that are fitted together: batteries that they do not share, and what they are not asked for."""

from dataclasses import replace

import numpy as np
import pytest

from diagnoses import make_cause, make_diagnosis
from raccoon.diagnose.drives.log import Log, Run
from raccoon.diagnose.findings.path_dependence import restricted_to_shareable
from raccoon.diagnose.findings.separate_batteries import (
    NOT_SHARED_REASON,
    SEPARATE_BATTERIES_NOTE,
    batteries_may_differ,
    has_separate_batteries,
    separate_battery_notes,
    with_resistance_not_judged,
    without_shared_resistance,
)
from raccoon.diagnose.hypotheses.cause_catalogue import drive_causes
from raccoon.diagnose.hypotheses.coordinates import Settings
from raccoon.diagnose.hypotheses.per_recording import (
    BATTERY_RESISTANCE,
    PER_RECORDING_STDS,
    RUN,
    battery_resistances,
    per_recording_coordinates,
    per_recording_settings,
)
from raccoon.diagnose.result import Verdict

LOG = Log(np.zeros(2), np.zeros((2, 2)), (), runs=(Run(0.0, (None, None)), Run(9.0, (None, None))))


OF_RESISTANCE = make_cause(BATTERY_RESISTANCE[0], said="")


def settings(*ohm: float) -> Settings:
    own = {(RUN, str(number), BATTERY_RESISTANCE[0]): each - 0.05 for number, each in enumerate(ohm)}
    return (
        dict.fromkeys(PER_RECORDING_STDS, 0.0)
        | {BATTERY_RESISTANCE: 0.05}
        | per_recording_settings(len(ohm), 0.05)
        | own
    )


@pytest.mark.parametrize(
    ("ohm", "told"),
    [((0.05, 0.16), True), ((0.05, 0.058), False), ((0.16, 0.17), False), ((0.008, 0.02), False)],
)
def test_batteries_that_differ_are_said_with_the_resistance_of_each(
    ohm: tuple[float, float], told: bool
) -> None:
    asked = settings(*ohm)
    assert battery_resistances(asked, 2) == pytest.approx(ohm)
    said = separate_battery_notes(asked, replace(LOG, separate_batteries=True))
    assert bool(said) is told
    if told:
        assert said[0].startswith(
            f"{SEPARATE_BATTERIES_NOTE}0.050 ohm in recording 1, 0.160 ohm in recording 2"
        )
    assert separate_battery_notes(asked, LOG) == ()


def test_it_is_asked_for_where_a_battery_is_named_or_something_is_left() -> None:
    assert batteries_may_differ(make_diagnosis(OF_RESISTANCE))
    assert batteries_may_differ(make_diagnosis(verdict=Verdict.UNKNOWN))
    assert batteries_may_differ(make_diagnosis(verdict=Verdict.PARTLY))
    assert not batteries_may_differ(make_diagnosis(verdict=Verdict.EXPLAINED))
    assert not batteries_may_differ(make_diagnosis())


def test_a_battery_for_each_is_taken_where_they_differ_and_is_no_cause() -> None:
    assert not has_separate_batteries(make_diagnosis())
    own = make_diagnosis(notes=(f"{SEPARATE_BATTERIES_NOTE}...",))
    assert has_separate_batteries(own)
    assert [(each.id, each.reason) for each in with_resistance_not_judged(own).rejected] == [
        (BATTERY_RESISTANCE[0], NOT_SHARED_REASON)
    ]


def test_no_battery_is_asked_for_that_recordings_share_once_each_has_its_own() -> None:
    names = {each.id for each in drive_causes()}
    assert names - {each.id for each in without_shared_resistance(drive_causes())} == {BATTERY_RESISTANCE[0]}


def test_an_own_resistance_is_never_below_none() -> None:
    coordinates = [
        each for each in per_recording_coordinates(2, 0.05) if each.name.startswith(BATTERY_RESISTANCE[0])
    ]
    assert len(coordinates) == 2
    for each in coordinates:
        assert 0.05 + each.value(each.low) > 0.0175  # by which robot.toml's may be less
        assert 0.05 + each.value(each.high) > 0.3
        assert each.value(0.0) == 0.0
    assert not any(each.name.startswith(BATTERY_RESISTANCE[0]) for each in per_recording_coordinates(2))


def test_friction_of_a_direction_may_be_a_slope_that_several_are_not_asked_for() -> None:
    of_direction = replace(OF_RESISTANCE, id="friction.direction_dependent", confounded_with=("bemf.offset",))
    said = restricted_to_shareable(make_diagnosis(of_direction, OF_RESISTANCE))
    assert said.causes[0].confounded_with == ("bemf.offset", "drive.slope")
    assert (said.causes[0].probability, said.causes[1]) == (0.5, OF_RESISTANCE)
