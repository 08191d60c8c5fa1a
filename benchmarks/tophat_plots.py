"""Pictures of the clusters and of the reflectance model (see tophat.py)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from raccoon.estimate.tophat import calibrate
from raccoon.model import reflectance
from raccoon.model.paper import TOPHAT_READINGS


def draw(rng: np.random.Generator, folder: Path) -> None:
    """Histograms of the eight calibration drives with surfaces, threshold and band; and the fitted model."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(4, 2, figsize=(9, 10), constrained_layout=True)
    for axis, condition in zip(axes.ravel(), TOPHAT_READINGS, strict=True):
        samples, _ = reflectance.drive_over_line(rng, condition)
        found = calibrate(samples)
        axis.hist(samples, bins=80, color="0.75", log=True)
        for name, surface, colour in (
            ("white", found.white, "tab:orange"),
            ("black", found.black, "black"),
        ):
            if surface is not None:
                axis.axvline(surface.mean, color=colour, linewidth=1, label=name)
        axis.axvline(found.threshold, color="tab:blue", label="threshold")
        axis.axvspan(found.low, found.high, color="tab:blue", alpha=0.2, label="the last answer stands")
        axis.set_title(
            f"{condition.generation}, {1000 * condition.height:.0f} mm, {condition.light}", fontsize=9
        )
        axis.set_xlabel("counts", fontsize=8)
        axis.set_ylabel("readings", fontsize=8)
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=4)
    figure.savefig(folder / "tophat-clusters.png", dpi=90)
    figure, axes = plt.subplots(1, 2, figsize=(9, 3.6), constrained_layout=True)
    heights = np.linspace(0.004, 0.03, 60)
    for axis, generation in zip(axes, reflectance.GENERATIONS, strict=True):
        for ambient, style in ((0.0, "-"), (1.0, "--")):
            for darkness, colour in ((0.0, "tab:orange"), (1.0, "black")):
                curve = [reflectance.counts(darkness, generation, float(each), ambient) for each in heights]
                name = f"{'black' if darkness else 'white'}, {'direct sun' if ambient else 'indoors'}"
                axis.plot(1000 * heights, curve, style, color=colour, label=name)
        for reading in TOPHAT_READINGS:
            if reading.generation == generation:
                levels = [reading.white, reading.black]
                (paper,) = axis.plot([1000 * reading.height] * 2, levels, "o", color="tab:red")
        paper.set_label("the paper's")
        axis.set_title(f"{generation} sensor", fontsize=9)
        axis.set_xlabel("height in mm")
        axis.set_ylabel("counts")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=5, fontsize=9)
    figure.savefig(folder / "tophat-model.png", dpi=90)
