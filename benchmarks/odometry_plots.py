"""Plots for docs/odometry.md: a match with its estimate and ellipses, the residuals, and a slip.

python benchmarks/odometry_plots.py [docs/pictures]
"""

from __future__ import annotations

import argparse
import math
from pathlib import Path

import matplotlib as mpl
import numpy as np

from odometry_rivals import SCHEMES, Ours
from odometry_traces import match, real_robot, simulated, with_slip
from raccoon.core.config import RobotConfig
from raccoon.sim.effects.parameters import Parameters

mpl.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from matplotlib.patches import Ellipse


def ellipse(axes: Axes, at: tuple[float, float], P: np.ndarray) -> None:
    """The 95 % ellipse of a position."""
    values, vectors = np.linalg.eigh(P)
    width, height = 2.0 * np.sqrt(5.991 * values)
    angle = math.degrees(math.atan2(vectors[1, 0], vectors[0, 0]))
    axes.add_patch(Ellipse(at, width, height, angle=angle, fill=False, color="tab:blue", alpha=0.6))


def plot_match(folder: Path) -> None:
    """Truth, every scheme, and this filter's ellipses; then its errors against two deviations."""
    trace = match(2, real_robot(2))
    schemes = {name: scheme(trace.robot) for name, scheme in SCHEMES.items() if name != "dead reckoning"}
    poses: dict[str, list[tuple[float, float, float]]] = {name: [] for name in schemes}
    truth, deviations, ellipses = [], [], []
    for number, (inputs, command) in enumerate(trace.cycles):
        for name, scheme in schemes.items():
            pose = scheme.update(inputs, command)
            if number % 20 == 0:
                poses[name].append(pose)
        if number % 20:
            continue
        ours = schemes["this filter"]
        assert isinstance(ours, Ours)
        at = inputs.truth
        assert at is not None
        truth.append((inputs.time, at.x, at.y, at.heading))
        e = ours.odometry.estimate
        deviations.append((e.x_std, e.y_std, e.heading_std))
        if number % 2000 == 0:
            ellipses.append(((e.x, e.y), ours.odometry.pose_covariance[:2, :2]))
    true, stds = np.array(truth), np.array(deviations)
    figure, axes = plt.subplots(figsize=(7, 6), layout="constrained")
    axes.plot(true[:, 1], true[:, 2], "k", linewidth=2.5, alpha=0.35, label="truth")
    for name, way in poses.items():
        axes.plot(*np.array(way)[:, :2].T, linewidth=0.9, label=name)
    for at_place, P in ellipses:
        ellipse(axes, at_place, P)
    axes.set(xlabel="x (m)", ylabel="y (m)", aspect="equal", title="Two-minute match with real faults")
    axes.legend(loc="center left", bbox_to_anchor=(1.02, 0.5))
    figure.savefig(folder / "odometry-match.png", dpi=110)
    errors = np.array(poses["this filter"]) - true[:, 1:]
    scale = (1e3, 1e3, math.degrees(1.0))
    figure, rows = plt.subplots(3, 1, sharex=True, figsize=(7, 6), layout="constrained")
    for place, label in enumerate(("x error (mm)", "y error (mm)", "heading error (deg)")):
        band = 2.0 * scale[place] * stds[:, place]
        rows[place].fill_between(true[:, 0], -band, band, alpha=0.25, label="2 sigma")
        rows[place].plot(true[:, 0], scale[place] * errors[:, place], linewidth=0.9)
        rows[place].set_ylabel(label)
    rows[0].legend()
    rows[2].set_xlabel("time (s)")
    figure.savefig(folder / "odometry-residuals.png", dpi=110)


def plot_slip(folder: Path) -> None:
    """Heading while one wheel slips."""
    robot = RobotConfig()
    plan = [(2.0, 0.0, 0.0), (4.0, 0.18, 0.0), (1.0, 0.0, 0.0)]
    trace = with_slip(simulated("slip", robot, Parameters.from_robot(robot), plan, 0), 3.5, 0.5, "left", 0.5)
    figure, axes = plt.subplots(figsize=(7, 3.5), layout="constrained")
    for name, scheme in SCHEMES.items():
        estimator = scheme(robot)
        headings = [estimator.update(inputs, command)[2] for inputs, command in trace.cycles]
        times = [inputs.time for inputs, _ in trace.cycles]
        axes.plot(times, np.degrees(headings), label=name)
    true = [math.degrees(inputs.truth.heading) for inputs, _ in trace.cycles if inputs.truth]
    axes.plot(times, true, "k--", label="truth")
    axes.axvspan(3.5, 4.0, alpha=0.15, color="tab:red", label="left wheel slips")
    axes.set(xlabel="time (s)", ylabel="heading (deg)")
    axes.legend()
    figure.savefig(folder / "odometry-slip.png", dpi=110)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="?", type=Path, default=Path("docs/pictures"))
    target = parser.parse_args().folder
    target.mkdir(parents=True, exist_ok=True)
    plot_match(target)
    plot_slip(target)
