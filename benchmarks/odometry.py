"""The odometry against three simpler schemes, on the same traces.

    python benchmarks/odometry.py [PART ...] [--seeds N | --quick] [--first-seed N]

Parts: time, optiodom, slip, match, clean, consistency, effects, calibrated.
Without a name all parts run, about twenty minutes of one core; each says how long it took. Every part prints
what was asked of it and what came out. Position errors are those of the robot's middle, in m; path is the
true way after the start.
"""

from __future__ import annotations

import argparse
import math
import secrets
import statistics
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from odometry_rivals import SCHEMES, DeadReckoning, Estimator, Ours
from odometry_traces import (
    DATA,
    EFFECTS,
    Trace,
    calibrated,
    match,
    optiodom,
    optiodom_robot,
    real_robot,
    runs,
    sessions,
    simulated,
    spread_motors,
    with_random_slip,
    with_slip,
    with_wandering_bias,
)
from raccoon.core.config import RobotConfig
from raccoon.estimate.drive.estimate_builder import POSE_DOUBT_REASONS
from raccoon.estimate.drive.prior import gyro_scale_std, offset_std_counts, scale_std, track_std
from raccoon.estimate.drive.stepper import GYRO_RATE_HZ
from raccoon.estimate.drive_calibration.columns import Manoeuvre, manoeuvre_from_columns
from raccoon.estimate.drive_calibration.fit import calibrate_drive
from raccoon.estimate.ekf.state import OdometrySettings
from raccoon.sim.effects.chain import Noise
from raccoon.sim.effects.parameters import Parameters


@dataclass
class Score:
    """Errors of one scheme on one trace."""

    rms: float
    final: float
    heading: float
    path: float
    coverage: float | None
    microseconds: float


def score(estimator: Estimator, trace: Trace) -> Score:
    """Run a trace through an estimator; the pose is given at the start."""
    errors, headings, inside, ticks = [], [], [], []
    for number, (inputs, command) in enumerate(trace.cycles):
        truth = inputs.truth
        assert truth is not None
        if number == trace.start:
            estimator.place((truth.x, truth.y, truth.heading))
        begin = time.perf_counter()
        x, y, heading = estimator.update(inputs, command)
        ticks.append(time.perf_counter() - begin)
        if number < trace.start:
            continue
        errors.append(math.hypot(x - truth.x, y - truth.y))
        headings.append(heading - truth.heading)
        if isinstance(estimator, Ours) and number % 20 == 0:
            inside.append(within_ellipse(estimator, (x - truth.x, y - truth.y)))
    return Score(
        rms=math.sqrt(statistics.fmean(each**2 for each in errors)),
        final=errors[-1],
        heading=abs(headings[-1]),
        path=trace.path,
        coverage=statistics.fmean(inside) if inside else None,
        microseconds=1e6 * statistics.median(ticks),
    )


def within_ellipse(ours: Ours, error: tuple[float, float]) -> bool:
    """Is the truth inside the stated 95 % ellipse of the position?"""
    P = ours.odometry.pose_covariance[:2, :2]
    e = np.array(error)
    return bool(e @ np.linalg.solve(P, e) <= 5.991)


def compared(title: str, traces: Iterable[Trace]) -> dict[str, list[Score]]:
    """Score every scheme on every trace and print a line each."""
    scores: dict[str, list[Score]] = {name: [] for name in SCHEMES}
    for trace in traces:
        for name, scheme in SCHEMES.items():
            scores[name].append(score(scheme(trace.robot), trace))
    print(f"\n{title} ({len(scores['this filter'])} traces)")
    print(
        f"{'':16}{'RMS mm':>9}{'final mm':>10}{'95% % path':>11}{'heading deg':>12}{'95%':>8}{'cover':>8}"
        f"{'us':>7}"
    )
    for name, each in scores.items():
        covers = [one.coverage for one in each if one.coverage is not None]
        print(
            f"{name:16}{1e3 * pooled(each):9.1f}{1e3 * statistics.median(o.final for o in each):10.1f}"
            f"{np.percentile([100 * o.final / o.path for o in each], 95):11.2f}"
            f"{math.degrees(statistics.median(o.heading for o in each)):12.2f}"
            f"{math.degrees(np.percentile([o.heading for o in each], 95)):8.2f}"
            f"{100 * statistics.fmean(covers) if covers else math.nan:8.1f}"
            f"{statistics.median(o.microseconds for o in each):7.1f}"
        )
    sys.stdout.flush()
    return scores


def pooled(scores: list[Score]) -> float:
    """Root of the mean square over traces."""
    return math.sqrt(statistics.fmean(each.rms**2 for each in scores))


def effects(seeds: range) -> None:
    """Each effect in turn, on matches of 30 s of a robot that nobody calibrated."""
    heading_row("one effect at a time, robot.toml as documented", seeds)
    for title, parameters in cases():
        row(title, [match(seed, parameters, 30.0) for seed in seeds])


def calibrated_effects(seeds: range) -> None:
    """The same after the calibration drive with a tape, the effect being there; and motors of the spread."""
    heading_row("the same after a calibration drive of 0.6 m along a tape", seeds)
    spread = [(spread_motors(seed), seed) for seed in seeds]
    row("motors of the spread", [after_calibration(each, seed) for each, seed in spread])
    for title, parameters in cases():
        row(title, [after_calibration(parameters, seed) for seed in seeds])


def after_calibration(parameters: Parameters, seed: int) -> Trace:
    """A match of 30 s of a robot that was calibrated before."""
    return replace(match(seed, parameters, 30.0), robot=calibrated(parameters, seed))


def cases() -> list[tuple[str, Parameters]]:
    """A robot without faults, and one of each fault."""
    nominal = Parameters.from_robot(RobotConfig())
    found = [("none", nominal)]
    for name, where, values in EFFECTS:
        title = f"{name}{'@' + where if where else ''} {'/'.join(f'{each:.3g}' for each in values.values())}"
        found.append((title, nominal.with_effect(name, where, **values)))
    return found


def heading_row(title: str, seeds: range) -> None:
    """What stands over the rows."""
    print(f"\n{title}: RMS of the position error in mm, {len(seeds)} matches of 30 s each")
    print(f"{'':36}{''.join(f'{name:>16}' for name in SCHEMES)}{'cover':>9}{'heading deg 95%':>17}")


def row(title: str, traces: list[Trace]) -> None:
    """Root mean square of the position error of each scheme, and what the filter says of its own."""
    scores = {
        name: [score(scheme(trace.robot), trace) for trace in traces] for name, scheme in SCHEMES.items()
    }
    ours = scores["this filter"]
    places = "".join(f"{1e3 * pooled(each):16.1f}" for each in scores.values())
    covered = 100 * statistics.fmean(each.coverage or 0.0 for each in ours)
    turned = math.degrees(np.percentile([each.heading for each in ours], 95))
    print(f"{title:36}{places}{covered:9.1f}{turned:17.2f}", flush=True)


def matches(seeds: range) -> None:
    """Two minutes with real gyro drift, offsets and motors that differ by 4 %."""
    scores = compared("two-minute match, real faults", (match(s, real_robot(s)) for s in seeds))
    ours = scores["this filter"]
    heading = math.degrees(np.percentile([each.heading for each in ours], 95))
    place = float(np.percentile([100 * each.final / each.path for each in ours], 95))
    print(
        f"asked: heading <= 1 deg, position <= 1 % of path at the 95th percentile: {heading:.2f}, {place:.2f}"
    )
    for name in list(SCHEMES)[1:]:
        rival = scores[name]
        share_place = np.percentile([e.final / e.path for e in ours], 95) / np.percentile(
            [e.final / e.path for e in rival], 95
        )
        share_heading = np.percentile([e.heading for e in ours], 95) / np.percentile(
            [e.heading for e in rival], 95
        )
        print(f"asked: at most 0.5 of {name}: position {share_place:.2f}, heading {share_heading:.2f}")


def slip(seeds: range) -> None:
    """One wheel loses half of its way for half a second while driving straight."""
    named, headings, shares = [], [], []
    plan = [(2.0, 0.0, 0.0), (4.0, 0.18, 0.0), (1.0, 0.0, 0.0)]
    for seed in seeds:
        side = ("left", "right")[seed % 2]
        robot = RobotConfig()
        clean = simulated("slip", robot, Parameters.from_robot(robot), plan, seed)
        begin = 3.5 + 0.05 * (seed % 7)
        trace = with_slip(clean, begin, 0.5, side, 0.5)
        ours, plain = Ours(robot), DeadReckoning(robot)
        found = math.inf
        for inputs, command in trace.cycles:
            pose = ours.update(inputs, command)
            other = plain.update(inputs, command)
            if f"the {side} wheel slips" in ours.odometry.estimate.reasons:
                found = min(found, inputs.time - begin)
        truth = inputs.truth
        assert truth is not None
        named.append(found)
        headings.append(abs(math.degrees(pose[2] - truth.heading)))
        error = math.hypot(pose[0] - truth.x, pose[1] - truth.y)
        shares.append(error / math.hypot(other[0] - truth.x, other[1] - truth.y))
    print(f"\nslip: one wheel loses 50 % for 0.5 s ({len(seeds)} drives)")
    print(f"asked: named within 0.2 s: worst {max(named):.3f} s")
    print(f"asked: heading error left <= 0.3 deg: worst {max(headings):.3f} deg")
    print(
        f"asked: position error <= 1/3 of dead reckoning: median {statistics.median(shares):.3f}, "
        f"worst {max(shares):.3f}"
    )


def clean(seeds: range) -> None:
    """False alarms in clean matches."""
    alarms: dict[str, int] = {}
    for seed in seeds:
        trace = match(seed, Parameters.from_robot(RobotConfig()))
        ours = Ours(trace.robot)
        told: set[str] = set()
        for inputs, command in trace.cycles:
            ours.update(inputs, command)
            told.update(set(ours.odometry.estimate.reasons).difference(POSE_DOUBT_REASONS))
        for reason in told:
            alarms[reason] = alarms.get(reason, 0) + 1
    slips = sum(count for reason, count in alarms.items() if "slip" in reason)
    print(f"\nfalse alarms in {len(seeds)} clean matches: asked 0 of slip: {slips}; all: {alarms or 'none'}")


def consistency(seeds: range) -> None:
    """Normalised estimation error squared, with faults drawn from the very prior the filter has."""
    squares, inside = [], []
    for seed in seeds:
        settings = OdometrySettings()
        # As much as it is held for in a second, of readings that come at another rate.
        gyro = settings.gyro_noise * math.sqrt(RobotConfig().controller.rate_hz / GYRO_RATE_HZ)
        noise = Noise(bemf=settings.bemf_noise_counts, gyro=gyro)
        trace = with_random_slip(match(seed, drawn(seed), 40.0, noise=noise), settings.slip_noise, seed)
        trace = with_wandering_bias(trace, settings.gyro_bias_walk, seed)
        ours = Ours(trace.robot)
        for number, (inputs, command) in enumerate(trace.cycles):
            x, y, heading = ours.update(inputs, command)
            truth = inputs.truth
            assert truth is not None
            if number > 400 and number % 50 == 0:
                inside.append(within_ellipse(ours, (x - truth.x, y - truth.y)))
            error = np.array([x - truth.x, y - truth.y, heading - truth.heading])
        squares.append(float(error @ np.linalg.solve(ours.odometry.pose_covariance, error)))
    from scipy.stats import chi2

    low, high = (float(chi2.ppf(p, 3 * len(seeds))) / len(seeds) for p in (0.025, 0.975))
    print(f"\nconsistency over {len(seeds)} simulated runs of 40 s, faults drawn from the prior")
    print(f"asked: mean NEES (3) inside {low:.2f}..{high:.2f}: {statistics.fmean(squares):.2f}")
    print(
        f"asked: truth inside the 95 % ellipse in 93..97 % of ticks: {100 * statistics.fmean(inside):.1f} %"
    )


def drawn(seed: int) -> Parameters:
    """A robot whose faults come from the filter's own prior.

    The delay between wheels and gyro, which the prior holds as one number, is drawn as its causes: a late
    gyro and wheels that slip as they speed up, each half a normal of 10 ms, and a filter off by 2 ms.
    """
    settings, random = OdometrySettings(), np.random.default_rng([seed, 3])
    robot = RobotConfig()

    def factor(std: float) -> float:
        return 1.0 + std * float(np.clip(random.normal(), -2.5, 2.5))

    lag = robot.model.bemf.filter_time_constant.value
    found = Parameters.from_robot(robot)
    found = found.with_effect("drive.track_width", factor=factor(track_std(robot, settings)))
    found = found.with_effect("imu.gyro_scale", factor=factor(gyro_scale_std(robot, settings)))
    found = found.with_effect("imu.gyro_bias", rate=settings.gyro_bias * float(random.normal()))
    found = found.with_effect("imu.latency", seconds=0.01 * abs(float(random.normal())))
    for side in ("left", "right"):
        found = found.with_effect("bemf.scale", side, factor=factor(scale_std(robot, settings, side)))
        counts = offset_std_counts(robot, settings, side) * float(random.normal())
        found = found.with_effect("bemf.offset", side, counts=counts)
        found = found.with_effect(
            "drive.wheel_eccentricity",
            side,
            amplitude=settings.runout * abs(float(random.normal())),
            phase=float(random.uniform(-math.pi, math.pi)),
        )
    found = found.with_effect("drive.wheel_slip", time=0.01 * abs(float(random.normal())))
    return found.with_effect("bemf.filter_lag", time_constant=lag + 0.002 * float(random.normal()))


def columns(trace: Trace) -> Manoeuvre:
    """A recorded run for the calibration."""
    truth = [cycle.truth for cycle, _ in trace.cycles if cycle.truth is not None]
    return manoeuvre_from_columns(
        {
            "t": np.array([cycle.time for cycle, _ in trace.cycles]),
            "motor.0.position": np.array([float(cycle.position[0] or 0.0) for cycle, _ in trace.cycles]),
            "motor.1.position": np.array([float(cycle.position[1] or 0.0) for cycle, _ in trace.cycles]),
            "truth.x": np.array([each.x for each in truth]),
            "truth.y": np.array([each.y for each in truth]),
            "truth.heading": np.array([each.heading for each in truth]),
        },
        trace.robot,
    )


def recorded(_: range) -> None:
    """Motion-capture sessions: calibrated on odd runs, tested on even ones."""
    if not (DATA / "optiodom").exists():
        print(f"\noptiodom: skipped, no recordings at {DATA}")
        return
    way = 2 * math.pi * 0.042 / (64 * 43.7)
    nominal = optiodom_robot("nominal", way, way, 0.2)
    odd = [optiodom(name, run, nominal) for name in sessions() for run in runs(name) if run % 2]
    found = calibrate_drive(nominal, [columns(trace) for trace in odd])
    print(
        f"\noptiodom: track {found.track_width.value:.4f} +- {found.track_width.std:.4f} m, wheel radii "
        f"{1e3 * found.left_radius.value:.3f} and {1e3 * found.right_radius.value:.3f} mm"
    )
    robot = found.applied(nominal)
    for title, used in (("nominal geometry", nominal), ("calibrated on odd runs", robot)):
        even = [optiodom(name, run, used) for name in sessions() for run in runs(name) if run % 2 == 0]
        place, turn = [], []
        inside = []
        for trace in even:
            ours = Ours(used)
            for number, (inputs, command) in enumerate(trace.cycles):
                truth = inputs.truth
                assert truth is not None
                if number == 0:
                    ours.place((truth.x, truth.y, truth.heading))
                x, y, heading = ours.update(inputs, command)
                place.append((x - truth.x) ** 2 + (y - truth.y) ** 2)
                turn.append((heading - truth.heading) ** 2)
                if number % 10 == 0:
                    inside.append(within_ellipse(ours, (x - truth.x, y - truth.y)))
        print(
            f"{title}: asked RMS <= 8.1 mm, heading <= 1.5 deg on even runs: "
            f"{1e3 * math.sqrt(statistics.fmean(place)):.2f} mm, "
            f"{math.degrees(math.sqrt(statistics.fmean(turn))):.2f} deg; inside the 95 % ellipse "
            f"{100 * statistics.fmean(inside):.1f} %"
        )


def _wheels_step(each: Any) -> None:
    each.step(0.005, (4.0, 4.5), (1e-3, 1e-3), 2.0, 1e-3)


def _whole_step(each: Any) -> None:
    each.step(0.005, (4.0, 4.5, 0.1), (1e-3, 1e-3, 1e-5), 2.0, 1e-3)


def _medians(step: Callable[[Any], None], fast: Any, stock: Any) -> tuple[float, float]:
    """Microseconds of a step of either filter, in turns."""
    clocks: tuple[list[float], list[float]] = ([], [])
    for _ in range(4000):
        for each, clock in ((fast, clocks[0]), (stock, clocks[1])):
            begin = time.perf_counter()
            step(each)
            clock.append(1e6 * (time.perf_counter() - begin))
    return statistics.median(clocks[0]), statistics.median(clocks[1])


def times(_: range) -> None:
    """One predict and update against stock filterpy, and the whole estimator a tick."""
    from raccoon.core.readings import SIMULATOR
    from raccoon.estimate.drive.prior import prior, process_noise
    from raccoon.estimate.ekf.filter import DriveFilter
    from raccoon.estimate.ekf.state import SIZE, OdometrySettings
    from raccoon.model.drive import DriveGeometry

    sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "tests"))
    from reference_filter import ReferenceFilter

    settings, robot = OdometrySettings(), RobotConfig()
    geometry = DriveGeometry.from_robot(robot)
    parts = (*prior(robot, settings, SIMULATOR), geometry, process_noise(robot, settings, 0.003))
    steps = {
        "two readings at once": _wheels_step,
        "three readings at once": _whole_step,
    }
    print(f"\npredict and update, {SIZE} states; asked: at most a quarter of filterpy, equal to 1e-9")
    for name, step in steps.items():
        fast, stock = DriveFilter(*parts), ReferenceFilter(*parts)
        ours, theirs = _medians(step, fast, stock)
        off = max(abs(a - b) / max(1.0, abs(b)) for a, b in zip(fast.flat, stock.flat, strict=True))
        print(
            f"  {name}: generated {ours:.1f} us, filterpy {theirs:.1f} us: {ours / theirs:.3f}; {off:.1e} off"
        )
    trace = match(0, real_robot(0), 60.0)
    odometry, ticks = Ours(robot).odometry, []
    for inputs, command in trace.cycles:
        begin = time.perf_counter()
        odometry.update(inputs, command)
        ticks.append(1e6 * (time.perf_counter() - begin))
    print(
        f"asked: whole estimator at most 100 us median a tick: {statistics.median(ticks):.1f} "
        f"(mean {statistics.fmean(ticks):.1f}, 99 % {np.percentile(ticks, 99):.1f})"
    )


PARTS: dict[str, tuple[Callable[[range], None], int]] = {
    "time": (times, 0),
    "optiodom": (recorded, 0),
    "slip": (slip, 20),
    "match": (matches, 100),
    "clean": (clean, 100),
    "consistency": (consistency, 200),
    "effects": (effects, 20),
    "calibrated": (calibrated_effects, 20),
}
QUICK = 4
"""Simulated runs of every part with --quick."""


def main() -> None:
    """Run the parts that were named, or all of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], help="what to measure (all)")
    parser.add_argument(
        "--seeds", type=int, help="how many simulated runs instead of the figure's own number"
    )
    parser.add_argument("--first-seed", type=int, help="the same runs again; else fresh ones")
    parser.add_argument("--quick", action="store_true", help=f"{QUICK} simulated runs of each part")
    arguments = parser.parse_args()
    first = secrets.randbelow(10**6) if arguments.first_seed is None else arguments.first_seed
    print(f"simulated runs from seed {first}")
    begin = time.process_time()
    for name in arguments.parts or PARTS:
        measure, usual = PARTS[name]
        began = time.process_time()
        count = arguments.seeds or (QUICK if arguments.quick else usual)
        measure(range(first, first + count))
        print(f"({name}: {time.process_time() - began:.0f} s of processor time)", flush=True)
    print(f"\nall: {time.process_time() - begin:.0f} s of processor time")


if __name__ == "__main__":
    main()
