"""Figures of a report, drawn without a display. Needs matplotlib."""

from __future__ import annotations

import base64
import io
import warnings
from typing import Any

import numpy as np

from raccoon.diagnose.reports.unknown_text import covariate_text
from raccoon.diagnose.result import Curve, Diagnosis, Shape

BEFORE, AFTER, MEASURED = "#b5422c", "#2c6fb5", "#aaaaaa"
MAX_POINTS = 4000
"""Largest number of points of a curve; more make a page large without being visible."""


def figure_to_base64_png(figure: Any) -> str:
    """A figure as base64 text of a PNG. A character that no font has is drawn as a box, without a warning."""
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        figure.savefig(buffer, format="png", dpi=110)
    return base64.b64encode(buffer.getvalue()).decode("ascii")


def _new_figure(height: float) -> Any:
    """An empty figure of this height (inches), as wide as a page."""
    from matplotlib.figure import Figure

    return Figure(figsize=(8.0, height), layout="constrained")


def _after_label(diagnosis: Diagnosis) -> str:
    """Label of the simulation after the diagnosis."""
    return "with the causes" if diagnosis.causes else "within robot.toml's tolerances"


def _before_label(diagnosis: Diagnosis) -> str:
    """Label of the simulation before the diagnosis. For a drive it is already refitted within robot.toml's
    tolerances."""
    return "without the causes" if diagnosis.causes else "before"


def _hide_frame(axes: Any) -> None:
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def error_figure(diagnosis: Diagnosis) -> Any:
    """Error of each channel before and after, over its noise floor."""
    figure = _new_figure(0.62 * len(diagnosis.channels) + 1.3)
    axes = figure.subplots()
    names = [each.name for each in diagnosis.channels]
    floors = [max(each.noise_floor, 1e-300) for each in diagnosis.channels]
    before = [each.rmse_before / floor for each, floor in zip(diagnosis.channels, floors, strict=True)]
    after = [each.rmse_after / floor for each, floor in zip(diagnosis.channels, floors, strict=True)]
    rows = np.arange(len(names))
    for shift, values, label, color in (
        (-0.2, before, _before_label(diagnosis), BEFORE),
        (0.2, after, _after_label(diagnosis), AFTER),
    ):
        bars = axes.barh(rows + shift, values, 0.38, label=label, color=color)
        for text in axes.bar_label(bars, fmt=_ratio_text, padding=3, fontsize=9):
            # The noise line must not run through the text.
            text.set_bbox({"facecolor": "white", "edgecolor": "none", "pad": 0.5})
    axes.axvline(1.0, color="0.3", linewidth=1.0, linestyle="--", label="noise")
    axes.set_yticks(rows, names)
    axes.invert_yaxis()
    axes.margins(x=0.12)
    axes.set_xlabel("error on unseen data / noise")
    axes.legend(fontsize=9, frameon=False, ncols=3, loc="lower right", bbox_to_anchor=(1.0, 1.0))
    _hide_frame(axes)
    return figure


def _ratio_text(value: float) -> str:
    """A ratio with two significant digits, more for integer parts above 99: 0.97, 1.0, 12, 374."""
    return f"{value:.2g}" if value < 0.995 else f"{value:.1f}" if value < 9.95 else f"{value:.0f}"


def cause_figure(diagnosis: Diagnosis) -> Any:
    """Held-out error without each cause and with all causes."""
    causes = diagnosis.causes
    figure = _new_figure(0.5 * len(causes) + 1.2)
    axes = figure.subplots()
    rows = np.arange(len(causes))
    without = [each.gain.heldout_rmse_before for each in causes]
    together = [each.gain.heldout_rmse_after for each in causes]
    axes.hlines(rows, together, without, color="0.75", linewidth=3, zorder=1)
    axes.scatter(without, rows, 70, color=BEFORE, zorder=2, label="this cause left out")
    axes.scatter(together, rows, 70, color=AFTER, zorder=2, label="with it")
    axes.axvline(1.0, color="0.3", linewidth=1.0, linestyle="--")
    axes.set_yticks(rows, [each.name for each in causes])
    axes.set_ylim(len(causes) - 0.5, -0.5)
    axes.set_xlim(0.0, 1.05 * max(1.0, *without, *together))  # room for the largest dot
    axes.set_xlabel("error on unseen data / noise")
    axes.legend(fontsize=9, frameon=False, ncols=2, loc="lower right", bbox_to_anchor=(1.0, 1.0))
    _hide_frame(axes)
    return figure


def shape_figure(shape: Shape) -> Any:
    """A fitted curve of an unknown effect over its covariate, with a band of two standard deviations."""
    figure = _new_figure(2.6)
    axes = figure.subplots()
    low, high = shape.values - 2.0 * shape.stds, shape.values + 2.0 * shape.stds
    axes.fill_between(shape.over, low, high, color=AFTER, alpha=0.2, linewidth=0.0)
    axes.plot(shape.over, shape.values, color=AFTER, linewidth=1.6)
    axes.axhline(0.0, color="0.7", linewidth=0.8)
    axes.set_xlabel(f"{covariate_text(shape)}, {shape.over_unit}")
    axes.set_ylabel(f"{shape.quantity}, {shape.unit}", fontsize=9)
    _hide_frame(axes)
    return figure


def curve_figure(curve: Curve, diagnosis: Diagnosis) -> Any:
    """Measured and simulated values over time, and the errors before and after below."""
    plain, better = _before_label(diagnosis), _after_label(diagnosis)
    step = max(1, len(curve.time) // MAX_POINTS)
    time, measured, before, after = (
        each[::step] for each in (curve.time, curve.measured, curve.before, curve.after)
    )
    simulated = bool(np.isfinite(before).any())
    compared = simulated and bool(np.nan_to_num(measured).any())
    figure = _new_figure(3.9 if compared else 2.3)
    panels = figure.subplots(2, 1, sharex=True, height_ratios=(2, 1)) if compared else [figure.subplots()]
    top, bottom = panels[0], panels[-1]
    if compared or not simulated:
        top.plot(time, measured, color=MEASURED, linewidth=3.2, label="measured")
        top.set_ylabel(f"{curve.name}, {curve.unit}", fontsize=9)
    if compared:
        top.plot(time, before, color=BEFORE, linewidth=0.9, label=f"simulated, {plain}")
        top.plot(time, after, color=AFTER, linewidth=0.9, label=f"simulated, {better}")
    if simulated:
        bottom.plot(time, before - measured, color=BEFORE, linewidth=0.8, label=plain)
        bottom.plot(time, after - measured, color=AFTER, linewidth=0.8, label=better)
        bottom.axhline(0.0, color="0.7", linewidth=0.8)
        bottom.set_ylabel(f"error, {curve.unit}" if compared else f"{curve.name}, {curve.unit}", fontsize=9)
    top.legend(fontsize=8, frameon=False, ncols=3, loc="lower right", bbox_to_anchor=(1.0, 1.0))
    bottom.set_xlabel("t, s")
    for axes in panels:
        _hide_frame(axes)
    return figure
