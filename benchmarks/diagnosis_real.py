"""Every figure that the diagnosis reaches on recordings of real machines, beside what is asked.

    python benchmarks/diagnosis_real.py [emps] [motors] [geometry] [steps] [tophats] [--pages FOLDER]

RACCOON_SHARED_DATA names the folder of the recordings (default: shared/data beside the project). Nothing is
drawn at random. --pages writes the HTML reports and the pictures of the documentation.
"""

from __future__ import annotations

import argparse
import csv
import os
from collections import Counter
from collections.abc import Callable
from pathlib import Path

import numpy as np

from raccoon.core.config import RobotConfig
from raccoon.diagnose.fleet.summary import fleet_of
from raccoon.diagnose.recordings.diagnosis import diagnose_recording
from raccoon.diagnose.recordings.geometry.diagnosis import diagnose_geometry
from raccoon.diagnose.reports.html import save_html
from raccoon.diagnose.reports.html_fleet import save_fleet_html
from raccoon.diagnose.reports.pictures import curve_figure
from raccoon.diagnose.result import Diagnosis, Verdict
from raccoon.model.reflectance import light_of
from raccoon.trace.loading import Run, load_run, load_runs

DATA = Path(os.environ.get("RACCOON_SHARED_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))
ROBOT = RobotConfig()
RADIUS = 0.03
"""m, the radius by which the reader turns the rim speed of these wheels into rad/s."""
Pages = Path | None


def line(what: str, asked: str, measured: str, good: bool) -> None:
    """One row: what, asked, measured, and whether it holds."""
    print(f"{what:58s} {asked:>23s} {measured:>36s}  {'ok' if good else 'MISSED'}")


def diagnosed(run: Run, holdout: Run | None = None) -> Diagnosis:
    """The diagnosis of a loaded run."""
    other = None if holdout is None else holdout.recording.columns
    robot = run.robot or ROBOT
    return diagnose_recording(run.recording.columns, robot, holdout=other, device=run.recording.device)


def emps(pages: Pages) -> None:
    """A motor and a ball screw whose viscous friction differs by direction."""
    train, pulses = (load_run(DATA / "emps" / f"{name}.mat") for name in ("DATA_EMPS", "DATA_EMPS_PULSES"))
    found = diagnosed(train, pulses)
    names = [each.name for each in found.causes]
    line(
        "EMPS: causes",
        "direction_dependent only",
        ", ".join(names),
        names == ["friction.direction_dependent"],
    )
    number = found.causes[0].parameters["viscous_asymmetry"]
    text = f"{number.value:.4f} +- {number.std:.4f}"
    line("EMPS: viscous asymmetry (published -0.181)", "-0.21 .. -0.17", text, -0.21 <= number.value <= -0.17)
    before, after = (1000.0 * each for each in (found.channels[0].rmse_before, found.channels[0].rmse_after))
    line(
        "EMPS: 1 s simulations, other recording, mm",
        "<= 1.40 (was 2.061)",
        f"{before:.3f} -> {after:.3f}",
        after <= 1.4,
    )
    alone = diagnosed(train)
    before, after = (1000.0 * each for each in (alone.channels[0].rmse_before, alone.channels[0].rmse_after))
    line("EMPS: the same recording, later part, mm", "", f"{before:.3f} -> {after:.3f}", after < before)
    print(
        f"  left on the pulses: {100 * found.unexplained.share:.0f} % of the error's power, by "
        f"{', '.join(found.unexplained.depends_on)}"
    )
    print(f"  time: {found.seconds:.1f} s")
    _page(pages, "emps", found, "a motor and a ball screw")


def motors(pages: Pages) -> None:
    """22 robots with two motors each: voltage steps, current, speed, battery."""
    runs = {path.name: load_run(path) for path in sorted((DATA / "fleet-steps").glob("*.csv"))}
    found = {name: diagnosed(run) for name, run in runs.items()}
    wheels = [(each, side) for each in found.values() for side in ("left", "right")]
    rubbing = sum(
        any(c.where == side and c.id.startswith("friction.") for c in each.causes) for each, side in wheels
    )
    share = 100.0 * rubbing / len(wheels)
    line(
        "fleet: wheels with friction", ">= 95 %", f"{rubbing} of {len(wheels)} ({share:.0f} %)", share >= 95.0
    )
    pairs = [
        (RADIUS * c.rmse_before, RADIUS * c.rmse_after)
        for each in found.values()
        for c in each.channels
        if c.name.endswith(".speed")
    ]
    before, after = (float(each) for each in np.median(np.array(pairs), axis=0))
    line("fleet: held-out RMSE, median, m/s", "<= 0.055", f"{before:.3f} -> {after:.4f}", after <= 0.055)
    sag = [
        c.parameters["resistance"].value
        for e in found.values()
        for c in e.causes
        if c.id.startswith("battery.")
    ]
    middle = float(np.median(sag))
    low, high = min(sag), max(sag)
    text = f"{middle:.3f} ({low:.2f} .. {high:.2f}, {len(sag)} robots)"
    line("fleet: battery resistance, median, ohm", "0.09 .. 0.15", text, 0.09 <= middle <= 0.15)
    branch = sum(any("RC" in r.reason for r in each.rejected) for each in found.values())
    added = sum(any("RC" in c.id for c in each.causes) for each in found.values())
    line(
        "fleet: RC branch added / refused by name",
        "on few",
        f"{added} / {branch} of {len(found)}",
        added == 0,
    )
    faults = [
        f"{name[6:8]}: {f.channel} {f.fault}" for name, each in found.items() for f in each.sensor_faults
    ]
    line("fleet: broken sensors", "said", f"{len(faults)}", bool(faults))
    for each in faults:
        print(f"  robot {each}")
    print(f"  causes: {dict(Counter(c.name for each in found.values() for c in each.causes))}")
    print(f"  time: {np.median([each.seconds for each in found.values()]):.1f} s a robot")
    if pages is not None:
        save_fleet_html(fleet_of(found), pages / "diagnosis-fleet.html")
    _page(pages, "motors", found["robot-09.csv"], "two motors and their battery")


def geometry(pages: Pages) -> None:
    """102 drives with motion capture: wheel radius and track width."""
    runs = load_runs(DATA / "optiodom")
    robot = runs[0].robot or ROBOT
    odd, even = ([each.recording.columns for each in runs if _odd(each) is want] for want in (True, False))
    found = diagnose_geometry(odd, robot, holdout=even)
    names = sorted(each.name for each in found.causes)
    line("optiodom: causes", "radius and track", ", ".join(names), len(names) == 2)
    before, after = (1000.0 * each for each in (found.channels[0].rmse_before, found.channels[0].rmse_after))
    line("optiodom: position on even runs, mm", "<= 8.1", f"{before:.1f} -> {after:.2f}", after <= 8.1)
    before, after = (
        float(np.degrees(each)) for each in (found.channels[1].rmse_before, found.channels[1].rmse_after)
    )
    line("optiodom: heading on even runs, deg", "<= 1.5", f"{before:.2f} -> {after:.2f}", after <= 1.5)
    for name, each in found.identified.items():
        print(f"  {name}: {1000 * each.value:.3f} +- {1000 * each.std:.3f} mm")
    single = [diagnosed(each) for each in runs]
    refused = sum(each.verdict is Verdict.NOT_IDENTIFIABLE for each in single)
    one_way = sum(any("one turning direction" in r.reason for r in each.rejected) for each in single)
    text = f"{refused} of {len(single)} ({one_way} for one direction)"
    line("optiodom: single runs refused", "one direction: all", text, refused == len(single))
    _page(pages, "geometry", found, "102 drives with motion capture")


def _odd(run: Run) -> bool:
    return int(run.name.rpartition("-")[2]) % 2 == 1


def steps(pages: Pages) -> None:
    """Single power steps of a real Wombat's motors."""
    found = {
        path.stem: diagnosed(load_run(path)) for path in sorted((DATA / "wombat-motor-steps").glob("*.csv"))
    }
    dead = [
        each.identified["dead time at 10 %"].value for name, each in found.items() if name.endswith("_10")
    ]
    text = ", ".join(f"{each:.3f}" for each in dead)
    line(
        "wombat steps: dead time at 10 %, s", "0.24 .. 0.27", text, all(0.24 <= each <= 0.27 for each in dead)
    )
    keeps = [
        each.identified["filter keeps of a sample"].value
        for each in found.values()
        if any(fault.fault == "stale" for fault in each.sensor_faults)
    ]
    text = f"{min(keeps):.3f} .. {max(keeps):.3f} in {len(keeps)}"
    line(
        "wombat steps: filter, of stale starts",
        "0.2, 8 files",
        text,
        all(abs(each - 0.2) < 0.01 for each in keeps),
    )
    repeats = [each.identified["repeated samples"].value for each in found.values()]
    text = f"{100 * min(repeats):.0f} .. {100 * max(repeats):.0f} %"
    line("wombat steps: repeated samples", "4 .. 43 %", text, min(repeats) > 0.03 and max(repeats) < 0.45)
    claimed = sum(len(each.causes) for each in found.values())
    line("wombat steps: motor constants claimed", "none", str(claimed), claimed == 0)
    _page(pages, "steps", found["motor_1_cmd_15"], "a power step of a Wombat's motor")


def tophats(_: Pages) -> None:
    """Levels of real tophats: what the light of white and black says about calibrations."""
    with (DATA / "tophat-calibrations" / "white-black-pairs.csv").open() as file:
        pairs = [(float(row["white_tresh"]), float(row["black_tresh"])) for row in csv.DictReader(file)]
    good = [pair for pair in pairs if min(pair) > 0.0]
    line(
        "tophats: failed calibrations (zeros)", "4", str(len(pairs) - len(good)), len(pairs) - len(good) == 4
    )
    white, black = (np.array([light_of(pair[side]) for pair in good]) for side in (0, 1))
    print(
        f"  median light over white {np.median(white):.2f}, over black {np.median(black):.3f} (1 halves a "
        "reading)"
    )
    print(f"  their ratio: {np.percentile(white / black, [5, 50, 95]).round(2)}")


def _page(pages: Pages, name: str, found: Diagnosis, title: str) -> None:
    if pages is None:
        return
    save_html(found, pages / f"diagnosis-{name}.html", title)
    if found.curves:
        curve_figure(found.curves[0], found).savefig(pages / f"diagnosis-{name}.png", dpi=80)


PARTS: dict[str, tuple[Callable[[Pages], None], str]] = {
    "emps": (emps, "emps"),
    "motors": (motors, "fleet-steps"),
    "geometry": (geometry, "optiodom"),
    "steps": (steps, "wombat-motor-steps"),
    "tophats": (tophats, "tophat-calibrations"),
}


def main() -> None:
    """Run the chosen parts, or all."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("parts", nargs="*", help=f"of {', '.join(PARTS)}; default: all")
    parser.add_argument("--pages", type=Path, help="folder for reports and pictures")
    args = parser.parse_args()
    if unknown := set(args.parts) - set(PARTS):
        parser.error(f"unknown parts: {', '.join(sorted(unknown))}")
    if args.pages is not None:
        args.pages.mkdir(parents=True, exist_ok=True)
    print(f"{'':58s} {'asked':>23s} {'measured':>36s}")
    for name in args.parts or PARTS:
        part, folder = PARTS[name]
        if (DATA / folder).exists():
            part(args.pages)
        else:
            print(f"{name}: skipped, no recordings at {DATA / folder}")


if __name__ == "__main__":
    main()
