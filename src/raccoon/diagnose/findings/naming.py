"""From coordinates to words: parameters with their uncertainty, rank, rivals, what was rejected and why."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from raccoon.diagnose.drives.log import Log
from raccoon.diagnose.findings.bent import bent_numbers
from raccoon.diagnose.findings.gain import HeldOut, contributions
from raccoon.diagnose.findings.known_together import together_told
from raccoon.diagnose.findings.spread import Spread, number_in
from raccoon.diagnose.fit.problem import Problem
from raccoon.diagnose.hypotheses.cause_catalogue import OF_TURNS
from raccoon.diagnose.hypotheses.coordinates import FORMS, WIDTH_FACTOR, Cause
from raccoon.diagnose.hypotheses.form_errors import form_error, least_error
from raccoon.diagnose.reports.manoeuvre_words import manoeuvre_for
from raccoon.diagnose.reports.wording import explanation
from raccoon.diagnose.result import CauseResult, Gain, ParameterResult, Rejected
from raccoon.diagnose.select.detection_limits import VISIBLE, visibility, would_show
from raccoon.diagnose.select.gates import gate
from raccoon.diagnose.select.refits import LAGS, SCALE, SMOOTHS, delay_alike
from raccoon.diagnose.select.rivals import CLOSE, odds, of_a_fault, only_beside
from raccoon.diagnose.select.search import NOTHING
from raccoon.diagnose.select.state import Search
from raccoon.sim.effects.effect import Effect
from raccoon.sim.effects.parameters import SIDES

TWINS = (frozenset(OF_TURNS),)
"""Whole-robot causes that nothing on board tells apart."""

ONE_CLASS = (*TWINS, frozenset(SCALE))
"""Causes that no drive tells apart: without a current reading, more resistance of both motors is also the
same as less inertia and friction together."""
ON_THE_BENCH = (
    f"no drive tells {', '.join(SCALE[:-1])} and {SCALE[-1]} apart: measure the winding of an unplugged "
    "motor with an ohmmeter, or weigh the robot, and write that into robot.toml with its std"
)
"""What to do about them: power steps, which show each of the four, show all of them at once."""
NOT_IDENTIFIABLE = "not identifiable"
OF_THE_CHIP = (
    "A gyro whose chip filters at 41 Hz, as the Wombat's firmware sets it, looks the same, and is no fault."
)

NEEDS = {
    "gyro": (
        "imu.gyro_bias", "imu.gyro_scale", "imu.gyro_drift", "imu.latency", "drive.track_width",
        "drive.wheel_radius", "drive.wheel_eccentricity", "drive.backlash", "drive.wheel_slip",
    ),
    "battery": ("battery.open_circuit_voltage", "battery.internal_resistance", "battery.discharge"),
}  # fmt: skip
"""Effects that show in a channel that may be missing, some of them hardly elsewhere."""
READING = "bemf."
"""Effects of a wheel's reading: without it there is nothing that they act on."""


def named_causes(search: Search, judged: HeldOut, spread: Spread) -> tuple[CauseResult, ...]:
    """The causes of the final set: what matters first, and of that what is expected to change most that
    robot.toml's deviations cannot absorb."""
    found = []
    for name, size in contributions(search).items():
        cause = search.problem.causes[name]
        values = parameters(search, cause, spread)
        gain = Gain(judged.without[name], judged.size_after, judged.share(name))
        rivals = confounded(search, cause)
        likely = probability(search, name, rivals, values)
        values = beside_rivals(search, cause, values)
        told = _told(search.problem, cause, values, rivals) + together_told(search, cause, spread)
        found.append(
            CauseResult(
                cause.id, cause.where, 0, values, gain, likely, rivals, told, size.change, size.unabsorbed,
                only_beside(search, name, rivals),
            )
        )  # fmt: skip
    found.sort(key=lambda each: (each.little, -each.unabsorbed * of_a_fault(search, each.name)))
    return tuple(replace(each, rank=rank) for rank, each in enumerate(found, start=1))


def _told(problem: Problem, cause: Cause, values: dict[str, ParameterResult], rivals: tuple[str, ...]) -> str:
    """The cause in a sentence. A lag is the sum of itself and of what it is not told from, but of a lag that
    robot.toml leaves open: that has a number of its own."""
    if cause.own is not None:
        return cause.own.told({name: each.value for name, each in values.items()})
    said = explanation(cause.id, cause.where, values)
    tried = [each for each in rivals if each in problem.causes]
    both = [each for each in tried if delay_alike(cause.name, each) and not _has_number(problem, each)]
    if both:
        said += f" With {' or '.join(both)} beside it this is the sum of their times."
    return f"{said} {OF_THE_CHIP}" if SMOOTHS in rivals else said


def _has_number(problem: Problem, name: str) -> bool:
    """Whether robot.toml has a number, which it leaves open, of what a cause moves."""
    return any(problem.neutral[problem.base[each].settings[0]] for each in problem.left_open(name))


def parameters(search: Search, cause: Cause, spread: Spread) -> dict[str, ParameterResult]:
    """The effect's parameters at the fit, with what the form of any model is off by."""
    found = {}
    for each in cause.effect.parameters:
        if each.name == FORMS.get(cause.id):
            continue
        key = (cause.id, cause.places[0], each.name)
        value = spread.number(key)
        nominal = search.problem.neutral[key]
        form = form_error(cause.id) * abs(value - nominal if math.isfinite(nominal) else value)
        least = least_error(cause.id, len(search.fit.point.active)) * WIDTH_FACTOR * each.prior_width
        std = math.hypot(spread.std(key), form, least)
        found[each.name] = ParameterResult(value, std, each.unit, float(nominal))
    return found


def beside_rivals(
    search: Search, cause: Cause, values: Mapping[str, ParameterResult]
) -> dict[str, ParameterResult]:
    """A cause's numbers, less sure by what they are where a rival of another cause stands in its place.

    Were K_E of both motors as assumed, and track and inertia others, friction would be other as well: as far
    as that may be so, its number is known no better than the two differ. (Where the cause itself has rivals,
    its number is what it is if it is there.)
    """
    here = search.problem.settings(search.fit.point)
    others = [
        [(odds(each), each.settings) for each in tried if each.lead < CLOSE and each.settings is not None]
        for name, tried in search.rivals.items()
        if name != cause.name and name in search.fit.point.active
    ]
    wider = {}
    for name, value in values.items():
        key, square = (cause.id, cause.places[0], name), value.std**2
        for tried in others:
            total = 1.0 + sum(its for its, _ in tried)
            moved = ((its, number_in(there, key) - number_in(here, key)) for its, there in tried)
            square += sum(its / total * by**2 for its, by in moved if math.isfinite(by))
        wider[name] = replace(value, std=math.sqrt(square))
    return wider


def confounded(search: Search, cause: Cause) -> tuple[str, ...]:
    """Causes that explain this recording as well in its place, and those that no drive tells from one of
    them."""
    close = [each.name for each in search.rivals.get(cause.name, []) if each.lead < CLOSE or each.beside]
    close = [each for each in close if each not in search.fit.point.active]
    asked = frozenset(search.problem.causes)  # a reference has decided some
    for twins in (each & asked for each in TWINS):
        if cause.name in twins:
            close.extend(sorted(twins - {cause.name, *close}))
        elif twins & set(close):
            close.extend(sorted(twins - {*close, *search.fit.point.active}))
    if cause.name == "motor.armature_resistance":
        close.extend(each for each in SCALE if each not in (cause.id, *search.fit.point.active))
    return tuple(dict.fromkeys(close))


def probability(
    search: Search, name: str, rivals: tuple[str, ...], values: Mapping[str, ParameterResult]
) -> float:
    """Posterior probability of the cause against dropping it and against its rivals, equal prior odds.

    No model has a robot's form quite right, which makes a lead over a rival say less than it seems to, and a
    lead over nothing no more than the cause's number does with its standard deviation: beside a large latency
    a slip of 0.15 +- 0.25 ms led by 19. (What has rivals is there even where its own number is not known.)
    """
    tried = search.rivals.get(name, [])
    its = {each.name: odds(each) for each in tried if not each.beside}
    beside = only_beside(search, name, rivals)
    away = math.inf if rivals else deviations(search.problem.causes[name].effect, values)
    against = math.exp(-min(search.gains.get(name, 50.0), 0.5 * away**2, 700.0))
    against += sum(its.get(each, 1.0) for each in rivals if each not in beside)
    return 1.0 / (1.0 + against)


def deviations(effect: Effect, values: Mapping[str, ParameterResult]) -> float:
    """By how many of its standard deviations a cause is away from what was assumed: of its numbers that one
    which is farthest, where it says how large the cause is and not of what kind."""
    sizes = [each.name for each in effect.parameters if each.neutral is not None]
    told = [each for name, each in values.items() if name in (*sizes, effect.parameters[0].name)]
    return max(
        (abs(each.value - each.nominal) / each.std for each in told if each.std > 0.0), default=math.inf
    )


def rejections(search: Search, log: Log, seen: Mapping[str, float]) -> tuple[Rejected, ...]:
    """Why each other effect of the catalogue is not named; sides are not listed apart. seen: `seen_in`."""
    active = {search.problem.causes[name].id for name in search.fit.point.active}
    stands_for, found = _stands_for(search), []
    for id_ in dict.fromkeys(each.id for each in search.problem.causes.values()):
        if id_ in active:
            continue
        if id_ in stands_for:
            reason = f"looks much like {stands_for[id_]}, and may be there in its place"
        else:
            reason = _reason(search, log, id_, seen.get(id_, 0.0))
        found.append(Rejected(id_, reason))
    return tuple(found)


def _stands_for(search: Search) -> dict[str, str]:
    """Effects that are no cause, by the one that was named where they may be it, or by the gyro's filter."""
    smooths = any(key[0] == SMOOTHS for each in search.problem.base for key in each.settings)
    found = {id_: SMOOTHS for id_ in LAGS[0] if smooths and id_ != SMOOTHS}
    for name in search.fit.point.active:
        for rival in confounded(search, search.problem.causes[name]):
            found.setdefault(rival.partition("@")[0], name)
    return found


def seen_in(search: Search, log: Log) -> dict[str, float]:
    """How visible each effect is, by id, of a wheel's reading where there is one: what a side without it
    shows, which is nothing, says nothing of the other."""
    silent = _silent(log)
    if not silent:
        return visibility(search)
    causes = {
        name: each
        for name, each in search.problem.causes.items()
        if not (each.id.startswith(READING) and each.where in silent)
    }
    return visibility(replace(search, problem=replace(search.problem, causes=causes)))


def _silent(log: Log) -> list[str]:
    """The sides whose back-EMF is not in the log."""
    return [side for side in SIDES if log.channel(f"{READING[:-1]}_{side}") is None]


def _reason(search: Search, log: Log, id_: str, visible: float) -> str:
    silent = _silent(log) if id_.startswith(READING) else []
    if len(silent) == len(SIDES):
        roles = " or ".join(f"bemf_{side}" for side in silent)
        return f"{NOT_IDENTIFIABLE}: there is no {roles} reading in this recording"
    if silent:
        usual = _usual_reason(search, id_, visible)
        other = next(side for side in SIDES if side not in silent)
        return (
            f"{NOT_IDENTIFIABLE} at the {silent[0]}: there is no bemf_{silent[0]} reading in this recording; "
            f"at the {other}: {usual}"
        )
    own = search.problem.causes.get(id_)
    needed = [role for role, ids in NEEDS.items() if id_ in ids and visible < VISIBLE]
    if own is not None and own.own is not None:
        needed.extend(own.own.needs)
    for role in needed:
        if log.channel(role) is None:
            return f"{NOT_IDENTIFIABLE}: there is no {role} reading in this recording"
    return _usual_reason(search, id_, visible)


def _usual_reason(search: Search, id_: str, visible: float) -> str:
    """Of an effect whose channels are all there."""
    cause = next(each for each in search.problem.causes.values() if each.id == id_)
    shows = would_show(cause, visible, gate(id_, alone=not search.fit.point.active))
    if visible < VISIBLE:
        return f"not visible in this recording: a usual deviation would not show{shows}"
    for name, reason in search.failed.items():
        if name.partition("@")[0] == id_:
            return f"{reason}{shows}"
    bent = " and ".join(text for each, text in bent_numbers(search) if each == id_)
    return f"too little to be told from chance: {bent}" if bent else f"{NOTHING}{shows}"


def suggestions(
    search: Search, causes: tuple[CauseResult, ...], log: Log, seen: Mapping[str, float]
) -> tuple[str, ...]:
    """Manoeuvres that separate what is confounded and show what this recording could not. seen: `seen_in`."""
    commands = [_telling(search, each.name, each.confounded_with) for each in causes]
    alike = [each for each in causes if _one_scale(each)]
    commands += [ON_THE_BENCH for _ in alike]
    wanted = [each.id for each in causes if each.confounded_with and each not in alike]
    hidden = sorted((power, id_) for id_, power in seen.items() if power < VISIBLE)
    gone = {id_ for id_ in seen if id_.startswith(READING) and len(_silent(log)) == len(SIDES)}
    gone |= {id_ for role, ids in NEEDS.items() if log.channel(role) is None for id_ in ids}
    wanted.extend(id_ for _, id_ in hidden if id_ not in gone)
    texts = [text for text in (*commands, *map(manoeuvre_for, wanted)) if text is not None]
    return tuple(dict.fromkeys(texts))[:3]


def _one_scale(cause: CauseResult) -> bool:
    """Whether all that a cause is not told from is what no drive tells it from."""
    return bool(cause.confounded_with) and {cause.name, *cause.confounded_with} <= set(SCALE)


def _telling(search: Search, name: str, rivals: tuple[str, ...]) -> str | None:
    """How to drive what tells a cause from its nearest rival; None where it has none, where no drive tells
    them apart, and for an effect that is a team's own."""
    separable = (
        each.name
        for each in search.rivals.get(name, [])
        if each.name in rivals
        and each.name in search.problem.causes
        and not each.together
        and not any({name, each.name} <= alike for alike in ONE_CLASS)
    )
    nearest = next(separable, None)
    if nearest is None or any(search.problem.causes[each].own is not None for each in (name, nearest)):
        return None
    command = f"raccoon excite --cause {name} --rival {nearest} --record again.jsonl"
    return f"{command}: what tells {name} from {nearest} best on this robot"
