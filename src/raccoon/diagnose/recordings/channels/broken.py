"""Channels of a drive that lie: stuck, saturated or impossible. They are left out and said, not explained."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.core.config import RobotConfig
from raccoon.core.readings import BEMF_VOLTS_PER_COUNT
from raccoon.core.sections import CYCLE_RATE
from raccoon.diagnose.drives.log import column_names, is_read
from raccoon.diagnose.findings.bent import without_bent
from raccoon.diagnose.recordings.channels.cut_off import FEWEST, cut_off, without_ends
from raccoon.diagnose.recordings.channels.fillers import command_of, without_fillers
from raccoon.diagnose.recordings.channels.partial import absence
from raccoon.diagnose.recordings.channels.polled import without_held_voltage
from raccoon.diagnose.recordings.channels.sagging import not_sagging
from raccoon.diagnose.recordings.reference.faults import reference_faults
from raccoon.diagnose.result import CauseResult, Diagnosis, Rejected, SensorFault, Verdict

Array = NDArray[np.float64]
Columns = Mapping[str, Array]

COARSE = {"gyro": 8, "bemf": 4, "speed": 4}
"""Different values of a reading that say next to nothing, by its kind: those of a gyro in whole rad/s."""
COARSE_VOLTS, ROUNDED = 0.04, 0.02
"""V from one to the next of a battery's that was rounded, by at least (a controller's are nearer); and part
of that by which those that were not miss its multiples. Where they scatter by less than a step, most of a sag
is inside one. In tenths of a volt a battery of 0.15 ohm had 0.014, and one of 0.05 none; in twentieths one of
0.15 ohm had five times the viscous friction and another scale beside it, each with a probability of 1."""
LEFT_OUT = {
    "stuck": "it is stuck",
    "saturated": "it is cut off",
    "coarse": "it is rounded too coarsely",
    "steady": "it does not sag",
    "rare": "it was read too rarely",
}
"""Faults for which a whole channel is left out, and how that is said."""
JITTER = 0.5
"""Of the usual step, by which steps differ to either side of it where a time is uneven."""
SURE_WHEN_UNEVEN = 1.0
"""Change of a reading, in units of its noise, from which a cause is believed where the time is uneven. Stamps
that are off by up to 2 ms made a gear that loses 2 % of a clean drive, by 0.34."""
OTHER_RATE = 0.16
"""Cycles by which rows may be off whole ones: firmwares that are to run at 200 Hz do so at 174 and more."""
CANNOT_FOLLOW = 0.5
"""Error left over the spread of what was measured from which the simulation does not follow the commands."""
FOLLOWS_BADLY, BADLY = 0.15, 0.03
"""The same, where the error is that part of the battery's voltage as well, which no creeping wheel has. With
any cause, known or not, it was 0.03 at most; commands that were rounded to whole numbers left more."""
SAME = 1e-6
"""Part of the largest reading by which numbers are apart that are not the same one, calculated twice."""
OTHER_ROBOT = 0.25
"""Logarithm of a factor beyond which robot.toml is hardly this robot's."""
OF_THE_ROBOT = (
    "motor.back_emf_constant", "motor.armature_resistance", "drive.inertia", "drive.wheel_radius",
    "drive.track_width",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Sound:
    """Columns without what lies, what that was, and what is strange about the time (uneven: whether its steps
    are)."""

    columns: Columns
    faults: tuple[SensorFault, ...]
    notes: tuple[str, ...]
    uneven: bool = False

    @property
    def left_out(self) -> dict[str, str]:
        """Columns that were recorded and are not used, and why."""
        return {each.channel: LEFT_OUT[each.fault] for each in self.faults if each.fault in LEFT_OUT}


def without_broken(columns: Columns, robot: RobotConfig) -> Sound:
    """Leave out what no simulation should be fitted to."""
    kept, faults = dict(columns), []
    moved = _moves(columns, robot)
    for role, name in column_names(robot).items():
        if name not in kept:
            continue
        values = np.asarray(kept[name], float)
        whole = _stuck(name, role, values, moved) or cut_off(name, role, values)
        whole = whole or _coarse(name, role, values, moved)
        found = [] if whole is None else [whole]
        if whole is None and role == "battery":
            kept[name], whole = without_held_voltage(name, columns["t"], values)
            found, values = [] if whole is None else [whole], kept[name]
        if whole is None:
            command = command_of(role, columns, robot)
            values, cut = (values, []) if role == "battery" else without_ends(name, values)
            kept[name], wrong = without_fillers(name, role, columns["t"], values, command)
            found += [*cut, *wrong]
        faults += found
        if any(each.fault in LEFT_OUT for each in found):
            del kept[name]
    if steady := not_sagging(kept, robot):
        faults.append(steady)
        del kept[steady.channel]
    pose, lost = reference_faults(kept, robot)
    kept |= pose
    about_time = _about_time(columns["t"])
    other_rate = _about_rate(columns["t"], robot.controller.rate_hz)
    return Sound(kept, (*faults, *lost), (*about_time, *other_rate), bool(about_time))


def _moves(columns: Columns, robot: RobotConfig) -> bool:
    """Whether different commands were given at all."""
    ports = (robot.drive.left, robot.drive.right)
    duties = [columns.get(f"motor.{port}.{kind}") for port in ports for kind in ("duty", "voltage")]
    return any(each is not None and np.isfinite(each).any() and np.nanstd(each) > 0.02 for each in duties)


def _stuck(name: str, role: str, values: Array, moved: bool) -> SensorFault | None:
    known = values[np.isfinite(values)]
    if not moved or len(known) < FEWEST or np.ptp(known) > 0.0:
        return None
    where = "read it in every cycle" if role == "battery" else "check plug and wires"
    text = f"{name} reads {float(known[0]):g} all the time although the robot is driven: {where}"
    return SensorFault(name, "stuck", text)


def _coarse(name: str, role: str, values: Array, moved: bool) -> SensorFault | None:
    """Of a robot that stands, a sound gyro has no more values than its noise has steps."""
    known = values[np.isfinite(values)]
    if not moved or len(known) < FEWEST:
        return None
    levels = np.unique(known)
    if not (_rounded(known, levels) if role == "battery" else _few(role, known, levels)):
        return None
    text = f"{name} has {len(levels)} different values only: it is rounded too coarsely"
    return SensorFault(name, "coarse", text)


def _few(role: str, known: Array, levels: Array) -> bool:
    most = COARSE.get(role.partition("_")[0], 0)
    return 1 < len(levels) <= most and len(known) >= 20 * most


def _rounded(known: Array, levels: Array) -> bool:
    """Whether a battery's readings scatter by less than the step to which they were rounded."""
    if len(levels) < 2:
        return False
    step = float(np.diff(levels).min())
    if step < COARSE_VOLTS or float(np.std(known)) > step:
        return False
    return bool(np.abs(levels / step - np.rint(levels / step)).max() < ROUNDED)


def _about_time(time: Array) -> tuple[str, ...]:
    steps = np.diff(time[np.isfinite(time)])
    if len(steps) < FEWEST:
        return ()
    middle = float(np.median(steps))
    low, high = (float(each) for each in np.percentile(steps, [5.0, 95.0]))
    if high - low < JITTER * 2.0 * middle:
        return ()
    return (
        f"t is uneven: steps of {1000 * low:.1f} to {1000 * high:.1f} ms around {1000 * middle:.1f} ms; what "
        "is faster than that cannot be judged",
    )


def _about_rate(time: Array, rate_hz: float) -> tuple[str, ...]:
    """That rows are no whole cycles of the controller: a time by another clock makes another inertia."""
    steps = np.diff(time[np.isfinite(time)])
    if len(steps) < FEWEST:
        return ()
    cycles = float(np.median(steps)) * rate_hz
    # What does not advance, or in another unit, is an error that the log says.
    if cycles <= 0.0 or abs(cycles - max(round(cycles), 1)) < OTHER_RATE:
        return ()
    rate = rate_hz / cycles
    told = "if t is not right"
    if CYCLE_RATE.allows(rate):
        told = f"if t is right, write controller.rate_hz = {rate:.3g}; if it is not"
    return (
        f"t advances by {1000.0 / rate:.3g} ms a row, but the controller runs at {rate_hz:g} Hz: "
        f"{told}, filters, latencies and inertia are found wrong",
    )


def judged_again(found: Diagnosis, columns: Columns, sound: Sound, robot: RobotConfig) -> Diagnosis:
    """A diagnosis with the broken channels in it, and without causes where the simulation does not follow."""
    found = replace(
        found, sensor_faults=(*sound.faults, *found.sensor_faults), notes=(*found.notes, *sound.notes)
    )
    found = _surely(found) if sound.uneven else found
    unchecked = (*_one_side(sound, robot), *_unchecked(found, sound, robot))
    lost = [each.name for each in found.channels if _lost(each.name, each.rmse_after, columns, robot)]
    if not lost:
        both = [each for each in found.causes if each.id in OF_THE_ROBOT and each.where is None]
        return replace(found, notes=(*found.notes, *unchecked, *other_robot(both)))
    reason = f"the recorded motion does not follow the commands ({', '.join(lost)}): nothing is named"
    dropped = tuple(Rejected(each.name, reason) for each in found.causes)
    return replace(
        found, verdict=Verdict.UNKNOWN, causes=(), rejected=(*found.rejected, *dropped), model=None,
        notes=(
            *without_bent(found.notes), *unchecked, f"{reason}; are commands and readings of the same drive?"
        ),
    )  # fmt: skip


def _surely(found: Diagnosis) -> Diagnosis:
    """A diagnosis without causes that uneven time makes as well."""
    dropped = [each for each in found.causes if each.change < SURE_WHEN_UNEVEN]
    if not dropped:
        return found
    kept = tuple(each for each in found.causes if each not in dropped)
    reason = "not judged: t is uneven, which may look like as much of it as was found"
    verdict = found.verdict
    if not any(not each.little for each in kept):
        verdict = Verdict.NOT_IDENTIFIABLE
    elif verdict is Verdict.EXPLAINED:
        verdict = Verdict.PARTLY
    ranked = tuple(replace(each, rank=rank) for rank, each in enumerate(kept, start=1))
    rejected = (*found.rejected, *(Rejected(each.name, reason) for each in dropped))
    return replace(found, verdict=verdict, causes=ranked, rejected=rejected, model=None)


def _unchecked(found: Diagnosis, sound: Sound, robot: RobotConfig) -> tuple[str, ...]:
    """What a diagnosis could not judge because a whole channel is missing: that nothing is named there says
    nothing."""
    notes = []
    for role, name in column_names(robot).items():
        said = absence(name, sound.left_out)
        ids = [each.id for each in found.rejected if each.reason == f"not identifiable: {said}"]
        if ids:
            notes.append(f"not checked, since {said}: {', '.join(ids)}")
        elif (
            role == "battery"
            and found.channels
            and not is_read(sound.columns, name)
            and not _in_volts(sound, robot)
        ):
            notes.append(f"{said}: the battery was checked by the wheels alone")
    return tuple(notes)


def _in_volts(sound: Sound, robot: RobotConfig) -> bool:
    """Whether volts were commanded, which hide the battery; that is said elsewhere."""
    ports = (robot.drive.left, robot.drive.right)
    return not any(is_read(sound.columns, f"motor.{port}.duty") for port in ports)


def _lost(name: str, error: float, columns: Columns, robot: RobotConfig) -> bool:
    if name not in columns or not name.endswith((".bemf", ".speed")):
        return False
    error = math.sqrt(max(error**2 - _counting(columns[name]) ** 2, 0.0))
    share = error / max(float(np.nanstd(columns[name])), 1e-300)
    model = robot.model
    per = BEMF_VOLTS_PER_COUNT if name.endswith(".bemf") else model.left.back_emf_constant.value
    badly = error * per > BADLY * model.battery.open_circuit_voltage.value
    return share > CANNOT_FOLLOW or (badly and share > FOLLOWS_BADLY)


def _counting(values: Array) -> float:
    """Error of a row that was counted in whole ticks from one moment to another, each cut off."""
    apart = np.diff(np.unique(values[np.isfinite(values)]))
    apart = apart[apart > SAME * np.nanmax(np.abs(values))]
    return float(np.percentile(apart, 10.0)) / math.sqrt(6.0) if len(apart) else 0.0


def _one_side(sound: Sound, robot: RobotConfig) -> tuple[str, ...]:
    """Which wheel is not measured, where only one is."""
    missing = {
        port: not any(is_read(sound.columns, f"motor.{port}.{kind}") for kind in ("bemf", "speed"))
        for port in (robot.drive.left, robot.drive.right)
    }
    if all(missing.values()) or not any(missing.values()):
        return ()
    port = next(each for each, gone in missing.items() if gone)
    name = next((each for each in sound.left_out if each.startswith(f"motor.{port}.")), f"motor.{port}.bemf")
    return (f"{absence(name, sound.left_out)}: what only that wheel shows is not checked",)


def other_robot(causes: Sequence[CauseResult]) -> tuple[str, ...]:
    """A question about robot.toml where a factor is so far off that it is hardly this robot's."""
    for each in causes:
        factor = each.parameters["factor"].value
        if abs(math.log(max(factor, 1e-9))) > OTHER_ROBOT:
            percent = 100.0 * (factor - 1.0)
            return (f"{each.name} is off by {percent:+.0f} %: is this robot.toml of this robot?",)
    return ()
