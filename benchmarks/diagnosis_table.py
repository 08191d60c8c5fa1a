"""The table of the diagnosis: what was asked, and what was measured in the trials that were run."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from diagnosis_trial import POSSIBLE, RELEVANT, expected_class
from raccoon.core.config import RobotConfig
from raccoon.diagnose.experiment.advice import DECISIVE_EVIDENCE
from raccoon.diagnose.findings.cause_results import TURN_CLASSES
from raccoon.diagnose.hypotheses.base_coordinates import MAX_BASE_STDS, base_coordinates
from raccoon.diagnose.hypotheses.coordinates import Coordinate
from raccoon.diagnose.result import MIN_VISIBLE_CHANGE
from raccoon.diagnose.select.refits import SHARED_SCALE_CAUSES, delay_same_reading
from raccoon.sim.effects.effect import effect

Result = dict[str, Any]
Number = tuple[float, float, float, float]
"""Value and deviation that were said, the true one, nominal."""

PRACTICAL = MIN_VISIBLE_CHANGE
"""Rise of the held-out error, or contribution, in units of the noise: from here on of practical size."""
TIE = 0.8
LIKELY = (0.0, 0.5, 0.8, 0.95, 1.01)
"""Edges of the probabilities that are counted together."""
UNKNOWN_NAMES = {
    "cogging": "wheel angle left", "rub": "wheel angle right (friction)", "payload": "time (inertia)",
    "patch": "position", "gyro_speed": "gyro over speed",
    "gyro_side": "gyro over turn rate",
}  # fmt: skip
ENTERED = (0.05, 0.95)
"""Parts of a drive on a rough patch between which a place can show: else there is as good as none of it, or
more friction everywhere, which is what `friction.coulomb` says."""
SIZES = {"cogging": 2.0, "rub": 1.0, "payload": 100.0}
"""From the lowest to the highest of what has such a size, as a report has it, over the hidden number."""


def print_table(results: Sequence[Result]) -> None:
    """Every row, the confusion of single causes, and times."""
    rows = {name: [each for each in results if each["row"] == name] for name in _ROWS}
    _line("case", "asked", "measured")
    _line("---", "---", "---")
    for name, (title, asked, measure) in _ROWS.items():
        _line(title, asked, measure(rows[name]) if rows[name] else "not run")
    single = rows["single"]
    _line("false unknown, known effect", "<= 5 %", percent(map(_called_unknown, single)))
    clean = [percent(map(_called_unknown, rows[name])) for name in _ROWS if name.startswith("clean")]
    _line("false unknown, clean: 40 s, contest, wheel loops, 12 s", "<= 3 %", ", ".join(clean))
    alone = [each for name in _FULL for each in rows[name]]
    _line("names that are right, by reported probability", "", _probabilities(alone))
    _line("reported over true contribution of the first cause", "", _sizes(single))
    _line("parameters", "median <= 2 %, p90 <= 10 %, cover 92-98 %", _parameters(single))
    numbers = {name: [each for it in rows[name] for each in _numbers(it, it["causes"])] for name in _NUMBERED}
    covered = [f"{name} {_cover(each)}" for name, each in numbers.items() if each]
    _line("95 % intervals of all that is named, other rows", "", ", ".join(covered))
    for name in ("single", "two", "several", "fifteen", "everything", "unmeasured"):
        _line(f"gain, {name}", "median >= 0.98, p10 >= 0.95, never < 0", _gain(rows[name]))
    _line("CPU time, single", "median <= 4 s, p90 <= 12 s", _times(single))
    _line("CPU time, 40 s, all rows", "", _times([each for name in _WHOLE for each in rows[name]]))
    for name in ("single", *_DRIVEN, "worst"):
        _confusion(name, rows[name])


def _called_unknown(result: Result) -> bool:
    """Whether something unknown was said to act, with a dependence or by the verdict alone."""
    return bool(result["depends_on"]) or result["verdict"] == "unknown"


def _line(case: str, asked: str, measured: str) -> None:
    print(f"| {case} | {asked} | {measured} |", flush=True)


def percent(flags: Iterable[bool]) -> str:
    """Share of the true ones, how many they are, and of how many."""
    flags = list(flags)
    return f"{100 * np.mean(flags):.1f} % ({sum(flags)} of {len(flags)})" if flags else "not run"


def is_hidden_cause(cause: dict[str, Any], true: Iterable[str]) -> bool:
    """Whether a named cause is one of the true ones, alone or as a class that holds it.

    Both motors' resistance is a class with inertia and friction together, not with one of them.
    """
    members = set(cause["class"])
    if (
        cause["name"] == "motor.armature_resistance"
        and len(members & set(SHARED_SCALE_CAUSES) & set(true)) < 2
    ):
        members -= set(SHARED_SCALE_CAUSES)
    return bool(({cause["name"]} | members) & set(true))


def is_first_right(result: Result) -> bool:
    """Whether the cause that was named first is hidden."""
    return bool(result["causes"]) and is_hidden_cause(result["causes"][0], _names(result))


def is_exactly_right(result: Result) -> bool:
    """Whether all that is hidden was named and nothing else said."""
    causes, true = result["causes"], _names(result)
    return (
        all(is_hidden_cause(each, true) for each in causes)
        and len(causes) == len(true)
        and not result["depends_on"]
    )


def _names(result: Result) -> list[str]:
    return [each for each in result["hidden"] if each.partition("@")[0] != "unknown"]


def _is_first_wrong(result: Result) -> bool:
    return bool(result["causes"]) and not is_first_right(result)


def _single(results: Sequence[Result]) -> str:
    first, wrong = percent(map(is_first_right, results)), percent(map(_is_first_wrong, results))
    missed = [each for each in results if not is_first_right(each) and not each["causes"]]
    said = f"first {first}, wrong {wrong}, exactly {percent(map(is_exactly_right, results))}"
    acting = [is_first_right(each) for each in results if relevant_causes(each)]
    said = f"{said}; where the cause acts: first {percent(acting)}"
    rivals = percent(bool(each["causes"][0]["class"]) for each in results if each["causes"])
    said = f"{said}; named as one of a class {rivals}"
    return f"{said}; misses reported as too small to show {percent(map(is_miss_announced, missed))}"


def _small(results: Sequence[Result]) -> str:
    outside = [each for each in results if not _is_within_tolerance(each)]
    first, wrong = percent(map(is_first_right, outside)), percent(map(_is_first_wrong, outside))
    return f"{_single(results)}; where it is outside robot.toml's tolerance: first {first}, wrong {wrong}"


def _is_within_tolerance(result: Result) -> bool:
    """Whether what is hidden is inside what robot.toml gives with a standard deviation, so no cause."""
    measured = [
        each for each in (_stds_from_nominal(result, name) for name in result["true"]) if each is not None
    ]
    return bool(measured) and measured[0] <= MAX_BASE_STDS


def _stds_from_nominal(result: Result, name: str) -> float | None:
    """Standard deviations of robot.toml by which a hidden cause is off; None where it gives none."""
    widths = {setting: each for each in base_coordinates(RobotConfig()) for setting in each.settings}
    id_, _, where = name.partition("@")
    for parameter, value in result["true"][name].items():
        kind = ("inertia", None, "straight") if id_ == "drive.inertia" else (id_, where or None, parameter)
        found = widths.get(kind) or widths.get((id_, "left", parameter))
        if found is not None:
            return _deviations(found, value, result["nominal"][name][parameter])
    return None


def _deviations(coordinate: Coordinate, value: float, nominal: float) -> float:
    if coordinate.factor:
        return abs(math.log(value / nominal) / math.log(coordinate.value(1.0)))
    return abs(value - nominal) / coordinate.value(1.0)


def is_miss_announced(result: Result) -> bool:
    """Whether a missed cause was said to be invisible, or smaller than what would have shown."""
    reason = _reason(result)
    if reason.startswith(("not visible", "not identifiable", "shows in too few moments")):
        return True
    said = re.search(r"would show (from|below) about ([-+.\de]+)", reason)
    name = next(iter(result["hidden"]))
    if said is None:
        return False
    if not result["true"].get(name):  # a pair, such as a slope: its larger part, in widths, shows first
        widths = {each.name: each.prior_width for each in effect(name.partition("@")[0]).parameters}
        parts = [abs(each) / widths[part] for part, each in result["hidden"][name].items()]
        return bool(max(parts) < float(said[2]) / next(iter(widths.values())))
    parameter, value = next(iter(result["true"][name].items()))
    if parameter == "limit":
        return bool(value > float(said[2]))
    nominal = result["nominal"][name][parameter]
    return bool(abs(value - nominal) * (100.0 if parameter == "factor" else 1.0) < float(said[2]))


def _reason(result: Result) -> str:
    return str(result["rejected"].get(result["cause"], ""))


def _clean(results: Sequence[Result]) -> str:
    named = percent(bool(each["causes"]) for each in results)
    practical = percent(any(c["rise"] > PRACTICAL for c in each["causes"]) for each in results)
    return f"named {named}, of practical size {practical}"


def _two(results: Sequence[Result]) -> str:
    both = percent(set(_names(each)) <= found_causes(each) for each in results)
    spurious = percent(not is_hidden_cause(c, _names(each)) for each in results for c in each["causes"])
    first = percent(map(is_first_right, results))
    exact = percent(map(is_exactly_right, results))
    return f"both {both}, exactly {exact}, first right {first}, spurious names {spurious}"


def found_causes(result: Result) -> set[str]:
    """The hidden causes that were named, each by itself or in a class."""
    names = _names(result)
    said = [{c["name"], *c["class"]} for c in result["causes"] if is_hidden_cause(c, names)]
    return {name for name in names if any(name in each for each in said)}


def relevant_causes(result: Result, kind: str = "alone") -> list[str]:
    """The hidden causes that matter. kind: alone, or beside what the others can imitate."""
    return [name for name, size in result.get(kind, {}).items() if size > RELEVANT]


def _many(results: Sequence[Result]) -> str:
    recall, beside = (
        percent(name in found_causes(each) for each in results for name in relevant_causes(each, kind))
        for kind in ("alone", "beside")
    )
    spurious = percent(not is_hidden_cause(c, _names(each)) for each in results for c in each["causes"])
    recall = f"recall {recall}, without causes that the others imitate {beside}"
    return f"{recall}, spurious {spurious}, {_largest(results)}"


def _largest(results: Sequence[Result]) -> str:
    """How often nothing that is hidden acts more than what was named first: a class is what its hidden
    members are together. Clearly: where nothing else was said to change about as much."""
    shares = [_first_size(each) / max(each["alone"].values()) for each in results]
    exact, tied = (percent(share >= least for share in shares) for least in (1.0, TIE))
    sure = [
        share >= 1.0 for share, each in zip(shares, results, strict=True) if not each.get("as_much", [""])
    ]
    return f"largest first {exact}, within 20 % {tied}, where called clearly first {percent(sure)}"


def _first_size(result: Result) -> float:
    """What the cause that was named first changes, in units of the noise; 0 where it is not hidden."""
    for first in result["causes"][:1]:
        sizes = [result["alone"].get(name, 0.0) for name in (first["name"], *first["class"])]
        return float(max(*sizes, result["together"].get(first["name"], 0.0)))
    return 0.0


def _worst(results: Sequence[Result]) -> str:
    main = [
        each["causes"] and is_hidden_cause(each["causes"][0], [next(iter(each["hidden"]))])
        for each in results
    ]
    largest = [flag for flag, each in zip(main, results, strict=True) if _main_acts_most(each)]
    absent = [bool(each["causes"]) and not _is_really_there(each, each["causes"][0]) for each in results]
    wrong = [
        flag and each["causes"][0]["change"] >= PRACTICAL for flag, each in zip(absent, results, strict=True)
    ]
    false = [
        flag and not _measured(each, each["causes"][0]) for flag, each in zip(wrong, results, strict=True)
    ]
    first = f"main cause first {percent(map(bool, main))}, where it acts most {percent(map(bool, largest))}"
    there = f"not hidden with the reported number either {percent(false)}"
    also = f"with names reported as too small to matter {percent(absent)}, {there}"
    return f"{first}, wrong {percent(wrong)}, {also}; {_many(results)}"


def _measured(result: Result, cause: dict[str, Any]) -> bool:
    """Whether a cause is hidden, with the number that was said: within two of its deviations, where nominal
    is not."""
    return any(
        abs(value - true) <= 2.0 * std < abs(value - nominal)
        for value, std, true, nominal in _numbers(result, [cause])
    )


def _hidden_lag(result: Result, name: str) -> float:
    """s by which a hidden cause delays readings more than is assumed and robot.toml leaves open; 0 where it
    is not hidden."""
    nominal = result["nominal"].get(name, {})
    late = float(sum(value - nominal[key] for key, value in result["true"].get(name, {}).items()))
    own = (
        each.value(MAX_BASE_STDS) for each in base_coordinates(RobotConfig()) if each.settings[0][0] == name
    )
    return math.copysign(max(abs(late) - next(own, 0.0), 0.0), late)


def _is_really_there(result: Result, cause: dict[str, Any]) -> bool:
    """Whether what was named is really there. A class is what its hidden members are together."""
    return (
        is_hidden_cause(cause, _acting_causes(result))
        or result["together"].get(cause["name"], 0.0) > PRACTICAL
    )


def _acting_causes(result: Result) -> list[str]:
    """What is no wrong name in the worst case, where every effect of the catalogue is off by a little.

    The main cause, what changes the recording, and what is really outside robot.toml.
    """
    names = [next(iter(result["hidden"]))]
    names += [name for name, size in result["alone"].items() if size > PRACTICAL]
    return names + [
        name for name in result["true"] if (_stds_from_nominal(result, name) or 0.0) > MAX_BASE_STDS
    ]


def _main_acts_most(result: Result) -> bool:
    """Whether the main cause is practically relevant and none of the background acts more."""
    sizes, main = result["alone"], next(iter(result["hidden"]))
    return bool(sizes[main] > RELEVANT and sizes[main] >= max(sizes.values()))


def _unmeasured(results: Sequence[Result]) -> str:
    """What is said of a robot of which every number is off: whether those that are said alone, and so for
    sure, are."""
    said = [(each, cause) for each in results for cause in each["causes"]]
    sure = [each for result, cause in said if not cause["class"] for each in _numbers(result, [cause])]
    side = percent((value - nominal) * (true - nominal) > 0.0 for value, _, true, nominal in sure)
    alone = percent(not cause["class"] for _, cause in said)
    right = f"on the right side of robot.toml {side}, intervals hold {_cover(sure)}"
    return f"named alone {alone}; of these {right}"


def _unknown(results: Sequence[Result]) -> str:
    blamed = percent(bool(each["causes"]) and not each["depends_on"] for each in results)
    junk = percent(bool(each["causes"]) for each in results)
    low, high = ENTERED
    entered = [each for each in results if each["cause"] != "patch" or low < each.get("patched", 0.5) < high]
    return (
        f"{_flagged(results)}, known cause named instead {blamed}, known cause named at all {junk}; without "
        f"patches that the robot hardly entered or left: {_flagged(entered)}; {_hidden_sizes(results)}"
    )


def _flagged(results: Sequence[Result]) -> str:
    flagged = percent(bool(each["depends_on"]) for each in results)
    right = percent(any(UNKNOWN_NAMES[each["cause"]] in it for it in each["depends_on"]) for each in results)
    return f"flagged {flagged}, right dependence {right}"


def _hidden_sizes(results: Sequence[Result]) -> str:
    """How large cogging, rubbing and loads are said to be over how large they are."""
    ratios = []
    for each in results:
        hidden = next(iter(each["hidden"].values()))
        sizes = each.get("sizes", ())
        if each["cause"] in SIZES and len(sizes) == 1:
            ratios.append(sizes[0] / (SIZES[each["cause"]] * next(iter(hidden.values()))))
    if not ratios:
        return "sizes not kept"
    low, middle, high = np.quantile(ratios, [0.1, 0.5, 0.9])
    return f"reported over true size: median {middle:.2f}, p10 {low:.2f}, p90 {high:.2f}, of {len(ratios)}"


def _twins(results: Sequence[Result]) -> str:
    whole = [
        bool(each["causes"])
        and expected_class(each["cause"]) <= {each["causes"][0]["name"], *each["causes"][0]["class"]}
        for each in results
    ]
    return f"reported as a class {percent(whole)}"


def _advised(results: Sequence[Result]) -> str:
    decided = [each for each in results if each["predicted"] >= DECISIVE_EVIDENCE]
    return (
        f"named first {percent(map(is_first_right, decided))}, wrong {percent(map(_is_first_wrong, decided))}"
    )


def _probabilities(results: Sequence[Result]) -> str:
    """How often the cause that was named is hidden, no class counted, by its probability."""
    said = [(c["probability"], c["name"] in _names(each)) for each in results for c in each["causes"]]
    shares = []
    for low, high in pairwise(LIKELY):
        right = [flag for likely, flag in said if low <= likely < high]
        if right:
            shares.append(f"{low:g} to {min(high, 1.0):g}: {percent(right)}")
    return ", ".join(shares)


def _sizes(results: Sequence[Result]) -> str:
    """What the first cause is said to change beyond what robot.toml leaves open, over the truth."""
    ratios = [
        each["causes"][0]["unabsorbed"] / true for each in results if (true := _first_size(each)) > RELEVANT
    ]
    if not ratios:
        return "not run"
    low, middle, high = np.quantile(ratios, [0.1, 0.5, 0.9])
    return f"median {middle:.3f}, p10 {low:.3f}, p90 {high:.3f}, of {len(ratios)}"


def _parameters(results: Sequence[Result]) -> str:
    numbers = [each for result in results for each in _numbers(result, result["causes"][:1])]
    if not numbers:
        return "none"
    errors = [abs(value - true) / abs(true) for value, _, true, _ in numbers]
    parts = [abs(value - true) / abs(true - nominal) for value, _, true, nominal in numbers]
    middle, high = np.quantile(errors, [0.5, 0.9])
    of_deviation = np.quantile(parts, [0.5, 0.9])
    return (
        f"median {100 * middle:.1f} %, p90 {100 * high:.1f} % (of the deviation: "
        f"{100 * of_deviation[0]:.1f} %, {100 * of_deviation[1]:.1f} %), cover {_cover(numbers)}"
    )


def _numbers(result: Result, causes: Sequence[dict[str, Any]]) -> Iterator[Number]:
    """Of each of these causes that is hidden; where lags are not told apart the true number is their sum, and
    that of one of several twins is none."""
    for cause in causes:
        leading = next(iter(cause["parameters"]))
        if leading not in result["true"].get(cause["name"], {}) or _twins_of(result, cause["name"]):
            continue
        value, std, nominal = cause["parameters"][leading]
        true = result["true"][cause["name"]][leading]
        true += sum(
            _hidden_lag(result, other) for other in cause["class"] if delay_same_reading(cause["name"], other)
        )
        yield value, std, true, nominal if nominal is not None and np.isfinite(nominal) else 0.0


def _twins_of(result: Result, name: str) -> set[str]:
    """What else is hidden of which no drive tells a cause."""
    twins: set[str] = set().union(*(each for each in TURN_CLASSES if name in each))
    return (twins & set(result["hidden"])) - {name}


def _cover(numbers: Iterable[Number]) -> str:
    """How often a number's 95 % interval holds the true one."""
    return percent(abs(value - true) <= 1.96 * std for value, std, true, _ in numbers)


def _gain(results: Sequence[Result]) -> str:
    return f"{_shares(results, '')}; of the median half second: {_shares(results, 'usual_')}"


def _shares(results: Sequence[Result], kind: str) -> str:
    pairs = [(each["gain"][f"{kind}before"], each["gain"][f"{kind}after"]) for each in results]
    shares = [(before - after) / (before - 1.0) for before, after in pairs if before > POSSIBLE]
    if not shares:
        return "not run"
    low, middle = np.quantile(shares, [0.1, 0.5])
    return f"median {middle:.3f}, p10 {low:.3f}, least {min(shares):.3f}, of {len(shares)}"


def _times(results: Sequence[Result]) -> str:
    if not results:
        return "not run"
    middle, high = np.quantile([each["seconds"] for each in results], [0.5, 0.9])
    return f"median {middle:.1f} s, p90 {high:.1f} s"


def _confusion(row: str, results: Sequence[Result]) -> None:
    pairs = Counter(
        (next(iter(each["hidden"])), each["causes"][0]["name"] if each["causes"] else _silence_text(each))
        for each in results
        if not is_first_right(each)
    )
    if not pairs:
        return
    print(f"\n{row}, {len(results)} recordings: hidden cause and first name where they differ\n")
    print("| hidden | named first | times |\n|---|---|---|")
    for (true, said), count in pairs.most_common():
        print(f"| `{true}` | {said} | {count} |")


def _silence_text(result: Result) -> str:
    unknown = ", ".join(result["depends_on"])
    return f"unknown ({unknown})" if unknown else f"nothing ({re.split('[:;(]', _reason(result))[0].strip()})"


_DRIVEN = ("small", "contest", "loop", "short")
"""Rows of one cause that is smaller or shows less."""
_NUMBERED = ("two", "several", "fifteen", "everything", *_DRIVEN, "worst", "advised")
"""Rows whose causes have true numbers, but that of single causes."""
_WHOLE = ("single", "clean", "two", "several", "fifteen", "everything", "unmeasured", "unknown")
"""Rows of 40 s."""
_FULL = ("single", "clean", "two", "several", *_DRIVEN, "advised")
"""Rows in which all that is off is hidden on purpose."""
_ROWS = {
    "single": ("one hidden cause of 31, exciting drive of 40 s",
               "first >= 99 %, wrong <= 0.5 %, exactly >= 97 %", _single),
    "clean": ("clean recordings", "named <= 1 %, of practical size 0", _clean),
    "clean_contest": ("clean, contest driving of 30 s", "", _clean),
    "clean_loop": ("clean, contest driving with wheel loops", "", _clean),
    "clean_short": ("clean, 12 s only", "", _clean),
    "two": ("two hidden causes", "both >= 97 %, exactly >= 93 %", _two),
    "several": ("three to five hidden causes",
                "recall >= 97 %, spurious <= 2 %, largest first >= 92 %", _many),
    "fifteen": ("one of fifteen in full, the other fourteen at 0 to 15 %",
                "recall >= 97 %, spurious <= 2 %, largest first >= 92 %", _many),
    "everything": ("one of 31 in full, all others at 0 to 15 %",
                   "recall >= 97 %, spurious <= 2 %, largest first >= 92 %", _many),
    "small": ("effects at 0.3 of their size", "named >= 88 %, wrong <= 1 %", _small),
    "contest": ("contest driving, 30 s", "first >= 94 %, every miss announced", _single),
    "loop": ("contest driving with wheel loops, 30 s", "first >= 94 %, every miss announced", _single),
    "short": ("12 s only", "first >= 87 %, every miss announced", _single),
    "worst": ("contest, half size, twice the noise, background", ">= 82 %, wrong <= 5 %", _worst),
    "unmeasured": ("an unmeasured robot: all numbers of robot.toml are off", "", _unmeasured),
    "unknown": ("unknown cause", "flagged >= 97 %, right dependence >= 92 %, blamed <= 2 %", _unknown),
    "twins": ("structural twins", "reported as a class, always", _twins),
    "advised": ("after the advised drive of 10 s, predicted evidence >= 30", ">= 95 %", _advised),
}  # fmt: skip
