"""Writing of `docs/effects.md` from the catalogue, with a picture of each effect in a recording."""

from __future__ import annotations

import io
from itertools import groupby
from pathlib import Path
from typing import TYPE_CHECKING

from raccoon.cli.effects.listing import PLACE_TEXTS, neutral_text
from raccoon.cli.effects.recordings import Comparison, comparison
from raccoon.core.errors import ConfigError
from raccoon.core.files import write_atomically
from raccoon.sim.effects.effect import Effect, all_effects

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_HEAD = """# Effects

These effects can make a robot differ from the nominal one. A diagnosis may name all of them except
`friction.presliding`, which every robot has, and `imu.low_pass`, which is no fault: it fits both.
`raccoon effects` lists them. `raccoon effects --write docs` writes this page: edit
`sim/effects/catalogue.py` instead.

Each picture shows one channel of the same drive (creeping, steps forward and back, turns; for tophats: over
lines): the channel in which the effect shows most, grey without it and red with it, and below that the
difference. An effect that is off has its neutral value, at which it changes nothing, exactly.

To add an effect, add an entry to `sim/effects/catalogue.py`, its term to `sim/plant/equations.py` or
`friction.py` (a statement that ends with `# effect: ID`) and its numbers to `sim/effects/physical.py`, and
write this page again. The tests of neutral values find it by themselves;
[the simulator's page](simulator.md) says more.
"""


def write_page(folder: Path) -> int:
    """Write effects.md and effects/*.png into a folder. Returns the number of pictures. Raises ConfigError if
    the folder does not exist."""
    if not folder.is_dir():
        raise ConfigError(f"{folder}: there is no such folder")
    pictures = folder / "effects"
    pictures.mkdir(exist_ok=True)
    sections = [_HEAD]
    entries = all_effects()
    for group, members in groupby(entries, key=lambda each: each.group):
        sections.append(f"## {group}\n")
        for entry in members:
            shown = comparison(entry)
            write_atomically(pictures / f"{entry.id}.png", _picture(shown))
            sections.append(_section(entry, shown))
    write_atomically(folder / "effects.md", "\n".join(sections))
    return len(entries)


def _section(entry: Effect, shown: Comparison) -> str:
    rows = [
        f"| `{each.name}` | {each.unit} | {neutral_text(each)} | {each.bounds} | {each.prior_width:g} |"
        for each in entry.parameters
    ]
    where = f" {PLACE_TEXTS[entry.place]}" if PLACE_TEXTS[entry.place] else ""
    values = ", ".join(f"{name} {value:.3g}" for name, value in shown.values.items())
    table = "\n".join(
        ("| parameter | unit | neutral | allowed | usual size |", "|---|---|---|---|---|", *rows)
    )
    return (
        f"### `{entry.id}`{where}\n\n{entry.sentence}\n\n{table}\n\n"
        f"![{entry.id}: {shown.channel}, {values}](effects/{entry.id}.png)\n"
    )


def _picture(shown: Comparison) -> bytes:
    buffer = io.BytesIO()
    figure_of(shown).savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()


def figure_of(shown: Comparison) -> Figure:
    """A figure of the channel without and with the effect, and below it their difference."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 2.8), dpi=90, layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    above.plot(shown.time, shown.without, color="0.6", linewidth=3.0)
    above.plot(shown.time, shown.with_effect, color="#c0392b", linewidth=1.0)
    above.set_ylabel(f"{shown.channel}, {shown.unit}", fontsize=8)
    below.axhline(0.0, color="0.6", linewidth=0.8)
    below.plot(shown.time, shown.with_effect - shown.without, color="#c0392b", linewidth=1.0)
    below.set_ylabel("difference", fontsize=8)
    below.set_xlabel("t, s", fontsize=8)
    for axes in (above, below):
        axes.tick_params(labelsize=8)
        axes.margins(x=0)
    return figure
