import json
import math
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from raccoon.core.errors import ConfigError
from raccoon.estimate.tophat import TophatCalibration, Verdict, calibrate
from raccoon.estimate.tophat.calibration_watch import CalibrationWatch, Fit, find_swapped, has_height_changed
from raccoon.estimate.tophat.store import MAX_STORED, StoredCalibration, TophatStore


@cache
def made(white: float, black: float, seed: int = 0) -> TophatCalibration:
    rng = np.random.default_rng(seed)
    return calibrate(np.concatenate([rng.normal(white, 5, 400), rng.normal(black, 8, 60)]))


def entry(
    sensor: str = "left", time: str = "2026-03-01T10:00:00", white: float = 1270.0
) -> StoredCalibration:
    return StoredCalibration(sensor, "table", time, made(white, 3800.0), "drumbot", 0.0, 6.7, "new")


def test_what_is_stored_comes_back(tmp_path: Path) -> None:
    store = TophatStore(tmp_path / "deep" / "tophats.json")
    assert store.history() == []
    first, second = entry(), entry(time="2026-03-02T10:00:00", white=1300.0)
    store.add(first)
    store.add(second)
    store.add(entry("right"))
    assert store.history("left") == [first, second]
    assert store.latest("left", "table") == second
    assert store.latest("left", "other") is None
    assert [each.name for each in store.path.parent.iterdir()] == ["tophats.json"]


def test_a_store_that_is_no_file_is_refused(tmp_path: Path) -> None:
    for path in (Path("/dev/full"), tmp_path):
        with pytest.raises(ConfigError, match=f"{path}: it is a folder, a device or a pipe"):
            TophatStore(path).add(entry())


def test_failed_calibration_replaces_nothing(tmp_path: Path) -> None:
    store = TophatStore(tmp_path / "tophats.json")
    store.add(entry())
    failed = StoredCalibration("left", "table", "", TophatCalibration(Verdict.ONE_SURFACE, "bare floor"))
    with pytest.raises(ConfigError, match="one_surface"):
        store.add(failed)
    assert len(store.history()) == 1


def test_several_are_stored_all_or_none(tmp_path: Path) -> None:
    """They are of one drive and one light: half of them would stand beside those of another."""
    store = TophatStore(tmp_path / "tophats.json")
    store.add(entry("left"), entry("right"))
    failed = StoredCalibration("right", "table", "", TophatCalibration(Verdict.ONE_SURFACE, "bare floor"))
    with pytest.raises(ConfigError, match="right: a calibration that is one_surface"):
        store.add(entry("left", time="later"), failed)
    assert [each.sensor for each in store.history()] == ["left", "right"]
    store._write([entry("left")] * MAX_STORED + [entry("right")])
    store.add(entry("left", time="later"), entry("right", time="later"))
    assert [len(store.history(sensor)) for sensor in ("left", "right")] == [MAX_STORED, 2]
    assert [store.history(sensor)[-1].time for sensor in ("left", "right")] == ["later", "later"]


def test_history_is_bounded(tmp_path: Path) -> None:
    store = TophatStore(tmp_path / "tophats.json")
    kept = entry()
    store._write([kept] * MAX_STORED)
    store.add(entry(time="later"))
    assert len(store.history()) == MAX_STORED
    assert store.history()[-1].time == "later"


@pytest.mark.parametrize(
    "text", ["", "{}", '{"format": 9, "calibrations": []}', '{"format": 1, "calibrations": [{}]}']
)
def test_damaged_file_is_named(tmp_path: Path, text: str) -> None:
    path = tmp_path / "tophats.json"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(ConfigError, match=r"tophats\.json"):
        TophatStore(path).history()


@pytest.mark.parametrize(
    ("keys", "value", "said"),
    [
        ("calibration.white.mean", -5.0, r"white\.mean = -5\.0: allowed are numbers from 0 to 4095"),
        ("calibration.black.mean", 5000, r"black\.mean = 5000: allowed are numbers from 0 to 4095"),
        ("calibration.white.mean", math.nan, r"white\.mean = nan: allowed are numbers from 0 to 4095"),
        ("calibration.white.sd", 0.0, r"white\.sd = 0\.0: allowed are numbers above 0 up to 4095"),
        ("calibration.white.count", 1.5, r"white\.count = 1\.5: allowed are whole numbers from 0"),
        ("calibration.threshold", 1e9, r"threshold = 1000000000\.0: allowed are numbers from 0 to 4095"),
        ("calibration.threshold", "700", r"threshold = '700': allowed are numbers from 0 to 4095"),
        ("calibration.threshold", True, r"threshold = True: allowed are"),
        ("calibration.threshold", 900.0, r": white\.mean = 12\d\d.*, threshold = 900, .*: they must rise in"),
        ("calibration.low", None, r"calibration\.low: it is missing, the verdict needs it"),
        ("calibration.threshold", None, r"calibration\.threshold: it is missing, the verdict needs it"),
        ("calibration.white", None, r"calibration\.white: it is missing, the verdict needs it"),
        ("calibration.white", [1270.0, 5.0], r"calibration\.white = \[1270\.0, 5\.0\]: it must be a table"),
        ("calibration.white", {"mean": 1270.0}, r"calibration\.white\.sd: it is missing"),
        ("calibration.verdict", "fine", r"verdict = 'fine': allowed is ok \| weak"),
        ("calibration.share_black", 1.5, r"share_black = 1\.5: allowed are numbers from 0 to 1"),
        ("calibration.separation", 10**400, r"separation = 10+\.\.\.: allowed are numbers from 0"),
        ("calibration.separation", math.inf, r"separation = inf: allowed are numbers from 0"),
        ("calibration.flickers", 60, r"flickers = 60: allowed are 0, 100, 120 and 250"),
        ("calibration.treshold", 1.0, r"treshold: there is no such key \(did you mean threshold\?\)"),
        ("battery_voltage", 67.0, r"battery_voltage = 67\.0: allowed are numbers from 0 to 30"),
        ("generation", "newest", r"generation = 'newest': allowed are null, old and new"),
        ("time", 5, r"time = 5: it must be a text"),
    ],
)
def test_what_no_sensor_reads_is_refused_by_name(tmp_path: Path, keys: str, value: object, said: str) -> None:
    store = TophatStore(tmp_path / "tophats.json")
    store.add(entry("right"))
    store.add(entry("left"))
    table = json.loads(store.path.read_text(encoding="utf-8"))
    *path, last = keys.split(".")
    place = table["calibrations"][1]
    for key in path:
        place = place[key]
    place[last] = value
    store.path.write_text(json.dumps(table), encoding="utf-8")
    for read in (store.history, lambda: store.add(entry("left"))):
        with pytest.raises(ConfigError, match=rf"tophats\.json: calibrations\[1\] \(sensor left\).*{said}"):
            read()


@pytest.mark.parametrize("sensor", [5, None])
def test_an_entry_without_a_sensor_is_told_by_its_number(tmp_path: Path, sensor: object) -> None:
    path = tmp_path / "tophats.json"
    table = {"sensor": sensor, "set_name": "table", "time": "", "calibration": {}}
    path.write_text(json.dumps({"format": 1, "calibrations": [table]}), encoding="utf-8")
    with pytest.raises(ConfigError, match=rf"calibrations\[0\]\.sensor = {sensor}: it must be a text"):
        TophatStore(path).history()


def test_a_recording_is_named_and_not_shown(tmp_path: Path) -> None:
    path = tmp_path / "run.jsonl.gz"
    path.write_bytes(b"\x1f\x8b" * 10_000)
    with pytest.raises(ConfigError, match="not a file of tophat calibrations") as caught:
        TophatStore(path).history()
    assert len(str(caught.value)) < len(str(path)) + 150


def test_file_is_plain_json(tmp_path: Path) -> None:
    store = TophatStore(tmp_path / "tophats.json")
    store.add(entry())
    assert json.loads(store.path.read_text(encoding="utf-8"))["calibrations"][0]["battery_voltage"] == 6.7


@pytest.mark.parametrize(
    ("level", "sd", "fit"),
    [
        (1270, 5, Fit.FITS),
        (1700, 5, Fit.CHANGED),
        (3440, 9, Fit.CHANGED),
        (4095, 0, Fit.UNPLUGGED),
        (0, 0, Fit.SATURATED),
    ],
)
def test_misfit_is_noticed_within_a_second(level: float, sd: float, fit: Fit) -> None:
    watch = CalibrationWatch(made(1270, 3800))
    rng = np.random.default_rng(0)
    for _ in range(200):
        watch.update(float(np.clip(rng.normal(level, sd), 0, 4095)))
    assert watch.fit is fit


def test_open_input_is_unplugged() -> None:
    watch = CalibrationWatch(made(1270, 3800))
    rng = np.random.default_rng(0)
    for _ in range(200):
        watch.update(float(rng.uniform(0, 4095)))
    assert watch.fit is Fit.UNPLUGGED


def test_what_goes_to_and_fro_over_an_edge_in_a_slow_loop_is_plugged_in() -> None:
    """2 mm a reading, as in a loop with 10 ms of the program's own code: it was "jumping about"."""
    watch = CalibrationWatch(made(1270, 3800))
    for counts in (1270.0, 2100.0, 3800.0, 3200.0) * 50:
        watch.update(counts, 0.002)
    assert watch.fit is not Fit.UNPLUGGED


def test_watch_says_nothing_of_a_few_readings() -> None:
    """A robot that drives off half on a line reads no surface at first, which is no other light."""
    watch = CalibrationWatch(made(1270, 3800))
    fits = [watch.fit]
    for counts in [2500.0] * 40 + [3800.0] * 160:
        watch.update(counts)
        fits.append(watch.fit)
    assert sorted(set(fits)) == [Fit.FITS, Fit.UNKNOWN]


def test_height_is_told_from_light() -> None:
    assert has_height_changed(made(180, 2930), made(1830, 3810))
    assert not has_height_changed(made(180, 2930), made(50, 170))
    assert not has_height_changed(made(1270, 3800), made(140, 250))
    for known in (made(210, 3900), made(180, 2930)):  # no known sensor reads 200 and 3900: no known height
        assert not has_height_changed(made(200, 3900), known)
        assert not has_height_changed(known, made(200, 3900))


def test_swapped_plugs_are_named() -> None:
    stored = {"left": made(180, 2930), "right": made(1270, 3800), "rear": made(600, 3300)}
    assert find_swapped(stored, {"left": [182.0] * 9, "right": [1268.0] * 9, "rear": [600.0] * 9}) is None
    assert find_swapped(stored, {"left": [1268.0] * 9, "right": [182.0] * 9, "rear": [600.0] * 9}) == (
        "left",
        "right",
    )
