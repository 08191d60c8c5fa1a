"""The three parts of the demo and the printing of their results."""

from __future__ import annotations

import math
import time
from itertools import repeat
from pathlib import Path

from raccoon import replay
from raccoon.cli.demo.mission import DISTANCE
from raccoon.cli.demo.robots import (
    BATTERIES,
    NAME,
    Claims,
    Outcome,
    Trial,
    measure_claims,
    measure_times,
    replay_program,
    run_both,
    trials,
)
from raccoon.cli.demo.tophats import REFUSED_CONTRAST, TophatResult, tophat_results
from raccoon.cli.shared_options import check_seed
from raccoon.core.errors import ConfigError, TraceError
from raccoon.core.extras import install
from raccoon.model.paper import MOTORS, battery_speed_ratio, extreme_motor_speeds
from raccoon.sweep.workers import process_crew
from raccoon.trace.format import read_trace
from raccoon.trace.record import existing_recording, recording_paths

END_LIMIT = 0.01 * DISTANCE
HEADING_LIMIT = math.radians(1.0)
TRACE = "mission.jsonl.gz"

Results = list[tuple[Trial, Outcome, Outcome]]


def show(folder: Path, seed: int, workers: int) -> int:
    """Run the whole demo. Returns 0 if the library keeps its promised limits, otherwise 1. Raises
    ConfigError."""
    check_seed(seed)
    begin = time.perf_counter()
    if folder.exists() and not folder.is_dir():
        raise ConfigError(f"--out {folder}: it is a file; name a folder")
    _check_trace(folder / TRACE)
    folder.mkdir(parents=True, exist_ok=True)
    results, claims = _drive_all(folder, seed, workers)
    good = _print_drives(results, claims)
    good = _print_tophats(tophat_results(seed)) and good
    _print_replay(folder / TRACE)
    _print_files(folder, results)
    print(f"{time.perf_counter() - begin:.1f} s")
    return 0 if good else 1


def _check_trace(trace: Path) -> None:
    """Raise ConfigError if the recording to be replaced is not one of a demo."""
    there = existing_recording(trace)
    if there is None:
        return
    try:
        robot = read_trace(there).header.config
    except TraceError:
        robot = None
    if robot is None or robot.name != NAME:
        raise ConfigError(f"{there}: it already exists and is not a recording of a demo; name another --out")


def _drive_all(folder: Path, seed: int, workers: int) -> tuple[Results, Claims]:
    record = folder / TRACE
    for each in recording_paths(record):
        each.unlink(missing_ok=True)
    every = trials(seed)
    if workers == 1:
        times = measure_times(seed)
        return [
            run_both(trial, times, record if trial == every[0] else None) for trial in every
        ], measure_claims(seed)
    with process_crew(workers or None) as crew:
        pool = crew.executor
        claims = pool.submit(measure_claims, seed)
        times = pool.submit(measure_times, seed).result()
        records = [record if trial == every[0] else None for trial in every]
        return list(pool.map(run_both, every, repeat(times), records)), claims.result()


def _print_drives(results: Results, claims: Claims) -> bool:
    print(f"\nMission: a Z of {DISTANCE:.1f} m with two turns of 90 deg, sensor noise on. A cell is where it")
    print("really ended: mm from the mark / degrees off. Motors (left-right) are the paper's.\n")
    print("        " + "".join(f"|{f'{voltage} V':^39}" for voltage in BATTERIES))
    print("motors  " + "|    by time        with the library     " * len(BATTERIES))
    cells = {(trial.battery, trial.left, trial.right): (opened, closed) for trial, opened, closed in results}
    for left in range(len(MOTORS)):
        for right in range(len(MOTORS)):
            row = (cells[voltage, left, right] for voltage in BATTERIES)
            print(f"  {left + 1}-{right + 1}   " + "".join("|" + _cell(*pair) for pair in row))
    _print_claims(claims)
    return _print_worst(results)


def _print_claims(claims: Claims) -> None:
    slow, fast = sorted(extreme_motor_speeds())
    rows = (
        ("distance gained by a fresh battery, 6.1 to 7 V", battery_speed_ratio() - 1.0, claims.battery),
        ("speed of motor 3 over motor 1 at 6.6 V", fast / slow - 1.0, claims.motors),
    )
    print(f"\n{'':48}paper   simulated by time")
    for name, printed, simulated in rows:
        print(f"{name:46} {100 * printed:5.1f} %  {100 * simulated:5.1f} %")


def _print_worst(results: Results) -> bool:
    by_time = max(opened.end for _, opened, _ in results)
    end = max(closed.end for _, _, closed in results)
    heading = max(abs(closed.heading) for _, _, closed in results)
    percent = 100.0 / DISTANCE
    rows = (
        ("end point, by time", 1e3 * by_time, f"mm  = {percent * by_time:.2f} % of the way"),
        ("end point, with the library", 1e3 * end, f"mm  = {percent * end:.2f} % (promised: under 1 %)"),
        ("heading, with the library", math.degrees(heading), "deg (promised: under 1 deg)"),
    )
    print()
    for name, value, unit in rows:
        print(f"worst {name:28} {value:7.2f} {unit}")
    return end < END_LIMIT and heading < HEADING_LIMIT


def _cell(opened: Outcome, closed: Outcome) -> str:
    return (
        f"{1e3 * opened.end:7.0f} /{math.degrees(opened.heading):6.1f}  "
        f"{1e3 * closed.end:9.1f} /{math.degrees(closed.heading):6.2f}     "
    )


def _print_tophats(results: list[TophatResult]) -> bool:
    print("\nTophats: calibrated on a 60 cm drive over one 15 mm line, judged on another such drive.\n")
    print("sensor height light    white  black   threshold  verdict  wrong   peers' rule")
    for each in results:
        at, found = each.condition, each.calibration
        threshold = "-" if found.threshold is None else f"{found.threshold:.0f}"
        refused = "refuses" if at.contrast < REFUSED_CONTRAST else "accepts"
        print(
            f"{at.generation:6} {1e3 * at.height:3.0f} mm {at.light:7} {at.white:6} {at.black:6} "
            f"{threshold:>11}  {found.verdict:8} {100 * each.wrong:4.2f} %  {refused}"
        )
    return all(each.calibration.threshold is not None for each in results)


def _print_replay(trace: Path) -> None:
    recording = read_trace(trace)
    replay(recording, replay_program)
    print(f"\nReplayed {len(recording.ticks)} ticks of a recorded mission through the library:")
    print("every command and every estimate is the recorded one, to the last bit.")


def _print_files(folder: Path, results: Results) -> None:
    print(f"\ntrace    {folder / TRACE}")
    try:
        from raccoon.cli.demo.picture import draw
    except ImportError:
        print(f"picture  none: matplotlib is missing: {install('report')}")
        return
    picture = folder / "demo.png"
    draw(results, picture)
    print(f"picture  {picture}")
