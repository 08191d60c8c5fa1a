import math

import numpy as np
import pytest
from numpy.typing import NDArray

from raccoon.core.errors import CalibrationError, ConfigError
from raccoon.core.readings import Status
from raccoon.estimate.tophat import Tophat, TophatCalibration, TophatReading, Verdict, calibrate
from raccoon.estimate.tophat.calibration import Surface
from raccoon.model.paper import TOPHAT_READINGS as PAPER_READINGS
from raccoon.model.paper import TophatReading as PaperReading
from raccoon.model.reflectance import AMBIENT, FULL_SCALE, fit, line_coverage, spot_radius

RATE = 200.0


def calibration(white: float = 180.0, black: float = 2930.0) -> TophatCalibration:
    rng = np.random.default_rng(1)
    return calibrate(np.concatenate([rng.normal(white, 4, 400), rng.normal(black, 8, 100)]))


def run(tophat: Tophat, counts: list[float]) -> list[TophatReading]:
    return [tophat.update(index / RATE, value) for index, value in enumerate(counts)]


def test_line_gives_two_edges() -> None:
    readings = run(Tophat(calibration()), [180.0] * 20 + [2930.0] * 12 + [180.0] * 20)
    edges = [reading.edge for reading in readings if reading.edge]
    assert [edge.to_black for edge in edges] == [True, False]
    assert edges[0].time == pytest.approx(19.5 / RATE, abs=1e-4)
    assert edges[1].time == pytest.approx(31.5 / RATE, abs=1e-4)
    assert [reading.black for reading in readings].count(True) == 12
    assert all(reading.status is Status.OK for reading in readings)


def test_black_as_far_as_no_line_is_wide_may_be_less_light_and_many_lines_are_not() -> None:
    tophat = Tophat(calibration())
    for _ in range(30):
        assert {each.status for each in run(tophat, [180.0] * 20 + [2930.0] * 12)} == {Status.OK}
    told = [each.status for each in run(tophat, [2930.0] * 120)]  # 1.2 mm a reading
    assert told[100] is Status.OK
    assert told[-1] is Status.UNCERTAIN


def test_a_sensor_that_stands_half_on_a_line_is_in_no_doubt() -> None:
    tophat = Tophat(calibration())
    run(tophat, [180.0] * 20)
    for index in range(100):
        reading = tophat.update(0.1 + index / RATE, 400.0 + index % 2, way=0.0)
        assert (reading.status, tophat.levels.is_in_doubt) == (Status.OK, False)


def test_a_floor_at_the_bottom_of_the_converter_is_white() -> None:
    found = calibrate([0.0] * 80 + [3000.0] * 20 + [0.0] * 80)
    for adapt in (True, False):
        readings = run(Tophat(found, adapt=adapt), [0.0] * 50 + [3000.0] * 12 + [0.0] * 50)
        assert [reading.edge.to_black for reading in readings if reading.edge] == [True, False]
        assert readings[30].black is readings[100].black is False
        assert readings[58].black is True


@pytest.mark.parametrize("spikes", [[2930.0], [2930.0, 180.0, 180.0, 180.0] * 5])
@pytest.mark.parametrize("before", [1, 10])
def test_spikes_that_stand_alone_change_nothing(spikes: list[float], before: int) -> None:
    readings = run(Tophat(calibration()), [180.0] * before + spikes + [180.0] * 10)
    assert not any(reading.black for reading in readings)
    assert not any(reading.edge for reading in readings)


def test_hysteresis_keeps_the_answer_between_the_limits() -> None:
    found = calibration()
    assert found.threshold is not None
    near = [found.threshold + 3.0, found.threshold - 3.0] * 20
    from_white = run(Tophat(found, adapt=False), [180.0, 180.0, *near])
    from_black = run(Tophat(found, adapt=False), [2930.0, 2930.0, *near])
    assert not any(reading.black for reading in from_white)
    assert all(reading.black for reading in from_black)


def test_edge_is_found_between_readings_where_half_the_spot_is_black() -> None:
    """Counts are 4095 / (1 + light), and light is what the covered share is linear in."""
    white, black = 4095 / 180 - 1, 4095 / 2930 - 1
    covered = np.clip((np.arange(30) - 11.3) / 6.0, 0.0, 1.0)  # half covered at 14.3
    counts = 4095 / (1 + white + (black - white) * covered)
    readings = run(Tophat(calibration()), list(counts))
    edges = [reading.edge for reading in readings if reading.edge]
    assert len(edges) == 1
    assert edges[0].time * RATE == pytest.approx(14.3, abs=0.05)
    assert readings[14].coverage == pytest.approx(covered[14], abs=0.02)


def test_darkness_is_a_probability() -> None:
    found = calibration()
    readings = [Tophat(found).update(0.0, value) for value in (5.0, 180.0, found.threshold, 2930.0, 4082.0)]
    darkness = [reading.darkness for reading in readings]
    assert darkness[0] < 1e-6
    assert darkness[1] < 1e-3
    assert darkness[2] == pytest.approx(0.5, abs=0.01)
    assert darkness[3] > 1 - 1e-6
    assert darkness[4] > 1 - 1e-6


def test_darkness_is_that_of_two_normal_densities_of_one_spread() -> None:
    """Log odds of (black - white) (counts - middle) / sd^2."""
    found = TophatCalibration(
        Verdict.OK, "", Surface(1000.0, 40.0, 99), Surface(1200.0, 40.0, 99), 1100.0, 1060.0, 1140.0
    )
    for counts in (1040.0, 1090.0, 1150.0):
        odds = 200.0 * (counts - 1100.0) / 40.0**2
        darkness = Tophat(found, adapt=False).update(0.0, counts).darkness
        assert darkness == pytest.approx(1.0 / (1.0 + math.exp(-odds)), rel=0.1)


@pytest.mark.parametrize(
    ("white", "black", "more", "other"),
    [
        (180.0, 2930.0, 0.2, False),  # of the light between both surfaces
        (180.0, 2930.0, 0.3, True),
        (100.0, 190.0, 0.3, False),  # 12 counts, less than the noise
        (370.0, 724.0, -0.1, False),
        (370.0, 724.0, -0.3, True),
    ],
)
def test_light_that_moves_the_edge_by_more_than_noise_is_other_light(
    white: float, black: float, more: float, other: bool
) -> None:
    """More of it shows on white, less on black, which loses at most 0.58 of what white does."""
    lit, dark = FULL_SCALE / white - 1.0, FULL_SCALE / black - 1.0
    light = (lit if more > 0.0 else dark) + (1.0 if more > 0.0 else 0.58) * more * (lit - dark)
    tophat = Tophat(calibration(white, black), adapt=False)
    for _ in range(4):
        assert not tophat.other_light
        run(tophat, [FULL_SCALE / (1.0 + light)])
    assert tophat.other_light is other
    run(tophat, [white])
    assert not tophat.other_light


def test_missing_reading_is_not_a_reading() -> None:
    tophat = Tophat(calibration())
    nothing = tophat.update(0.0, None)
    assert nothing.black is None
    assert nothing.status is Status.INVALID
    tophat.update(0.005, 2930.0)
    gap = tophat.update(0.010, None)
    assert gap.black is True
    assert gap.status is Status.UNCERTAIN


@pytest.mark.parametrize("floor", [180.0, 2930.0])
@pytest.mark.parametrize("ends", [(0.0,), (4095.0,), (4095.0, 0.0), (4086.0, 4095.0, 0.0, 4.0, 0.0)])
def test_a_loose_wire_at_the_ends_of_the_range_is_no_floor(floor: float, ends: tuple[float, ...]) -> None:
    tophat = Tophat(calibration())
    run(tophat, [floor] * 20)
    rattles = [ends[n % len(ends)] if n % 7 > 1 else floor for n in range(100)]
    for reading in run(tophat, rattles):
        assert reading.black is (floor > 1000.0)
        assert reading.edge is None
    assert tophat.update(1.0, ends[0]).status is Status.UNCERTAIN


def behind_stock_filter(inputs: list[float], phase: int) -> list[float]:
    """What a program reads every 5 ms of a converter that is read five times in these."""
    filtered, word = [], int(inputs[0])
    for each in inputs:
        word = int(0.9 * word + 0.1 * round(each))
        filtered.append(float(word))
    return filtered[phase::5]


@pytest.mark.parametrize("condition", PAPER_READINGS, ids=lambda each: f"{each.generation}-{each.light}")
def test_a_wire_that_breaks_is_no_line_on_its_way_through_the_stock_filter(condition: PaperReading) -> None:
    optics = fit(condition.generation).at(condition.height)
    white, black = (optics.counts(dark, AMBIENT[condition.light]) for dark in (0.0, 1.0))
    surfaces = Surface(white, 6.0, 400), Surface(black, 6.0, 100)
    found = TophatCalibration.of_surfaces(Verdict.OK, "", *surfaces, share_black=0.1)
    for phase in range(5):
        broken = behind_stock_filter([white] * (100 + phase) + [FULL_SCALE] * 80, phase)
        tophat = Tophat(found)
        for index, counts in enumerate(broken):
            reading = tophat.update(index / RATE, counts, None, 5e-4)
            assert reading.black is False
        assert reading.status is Status.UNCERTAIN
    for way in (2.5e-4, 1e-3, 1.5e-3):
        at = 0.008 + way * np.arange(0.0, 0.025 / way, 0.2)
        dark = line_coverage(at, 0.03, 0.02, spot_radius(condition.height))
        line = behind_stock_filter([*optics.counts(dark, AMBIENT[condition.light])], 0)
        tophat = Tophat(found, adapt=False)
        answers = [tophat.update(index / RATE, counts, None, way).black for index, counts in enumerate(line)]
        assert found.high is not None
        assert answers.index(True) == 1 + next(index for index, each in enumerate(line) if each > found.high)


def test_a_surface_at_the_end_of_the_range_is_one() -> None:
    assert Tophat(calibration(3300.0, 4070.0)).update(0.0, 4095.0).black is True


def test_needs_a_threshold() -> None:
    with pytest.raises(CalibrationError, match="too_few"):
        Tophat(TophatCalibration(Verdict.TOO_FEW, "nothing there"))
    with pytest.raises(ConfigError, match="debounce"):
        Tophat(calibration(), debounce=0)


def test_on_an_edge_readings_beyond_both_surfaces_are_other_light() -> None:
    tophat = Tophat(calibration(1270.0, 3800.0), adapt=False)
    noticed = []
    # The second is half on black in 0.3 of the sun.
    for counts in ([1270.0, 1900.0, 3800.0, 1100.0, 1100.0, 1100.0, 1900.0], [490.0] * 6):
        run(tophat, counts)
        noticed.append(tophat.other_light)
    assert noticed == [False, True]
    assert tophat.update(1.0, 490.0).coverage == 0.0
    assert not tophat.relearn(489.0, 491.0)  # one surface
    assert tophat.relearn(370.0, 724.0)
    reading = tophat.update(1.1, 490.0)
    assert reading.coverage == pytest.approx(0.5, abs=0.01)
    assert [reading.status, tophat.other_light] == [Status.OK, False]


def test_what_one_surface_reads_in_two_places_is_not_taken_for_two() -> None:
    tophat = Tophat(calibration(1270.0, 3800.0), adapt=False)
    assert not tophat.relearn(370.0, 430.0)  # black would read 720
    assert tophat.update(0.0, 1270.0).coverage == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize(("white", "black"), [(5, 60), (3, 100), (3, 40), (1, 100)])
@pytest.mark.parametrize("seed", range(3))
def test_a_surface_near_the_converters_bottom_is_not_taken_for_a_change_of_light(
    white: int, black: int, seed: int
) -> None:
    """A count there is much of the light: its noise pulled the levels of both surfaces along."""
    rng = np.random.default_rng(seed)

    def counts(mean: float, number: int) -> NDArray[np.float64]:
        return np.clip(np.round(rng.normal(mean, 2.0, number)), 0.0, 4095.0)

    calibration = calibrate(np.concatenate([counts(white, 400), counts(black, 400)]))
    assert calibration.verdict is (Verdict.WEAK if white < 4 else Verdict.OK)
    tophat = Tophat(calibration)
    seen = [tophat.update(0.005 * tick, float(each)).black for tick, each in enumerate(counts(white, 2000))]
    assert not any(seen)
    seen = [tophat.update(0.005 * tick, float(each)).black for tick, each in enumerate(counts(black, 20))]
    assert all(seen[4:])
