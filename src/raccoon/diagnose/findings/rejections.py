"""Reasons why causes were not named: not visible, not identifiable, no channel that shows them, or too
little."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from raccoon.diagnose.drives.log import Log
from raccoon.diagnose.findings.cause_results import confounded_causes
from raccoon.diagnose.findings.deviations import large_deviations
from raccoon.diagnose.result import Rejected
from raccoon.diagnose.select.detection_limits import (
    MIN_VISIBLE_EVIDENCE,
    describe_detection_limit,
    evidence_per_width,
)
from raccoon.diagnose.select.gates import gate
from raccoon.diagnose.select.refits import GYRO_LOW_PASS, LAG_FAMILIES
from raccoon.diagnose.select.search import EXPLAINS_NOTHING
from raccoon.diagnose.select.state import Search
from raccoon.sim.effects.parameters import SIDES

NOT_IDENTIFIABLE = "not identifiable"
EFFECTS_BY_CHANNEL = {
    "gyro": (
        "imu.gyro_bias", "imu.gyro_scale", "imu.gyro_drift", "imu.latency", "drive.track_width",
        "drive.wheel_radius", "drive.wheel_eccentricity", "drive.backlash", "drive.wheel_slip",
    ),
    "battery": ("battery.open_circuit_voltage", "battery.internal_resistance", "battery.discharge"),
}  # fmt: skip
"""Effects that show in a channel that may be missing, some of them hardly in any other."""
BEMF_PREFIX = "bemf."
"""Prefix of effects on a wheel's back-EMF reading, which do nothing without that reading."""


def explain_rejections(search: Search, log: Log, visible: Mapping[str, float]) -> tuple[Rejected, ...]:
    """The reason why each other effect of the catalogue is not named; sides are not listed separately.
    visible: see `effect_visibility`."""
    active = {search.problem.causes[name].id for name in search.fit.point.active}
    named_instead, found = _named_instead(search), []
    for id_ in dict.fromkeys(each.id for each in search.problem.causes.values()):
        if id_ in active:
            continue
        if id_ in named_instead:
            reason = f"looks much like {named_instead[id_]} and may be the true cause instead"
        else:
            reason = _rejection_reason(search, log, id_, visible.get(id_, 0.0))
        found.append(Rejected(id_, reason))
    return tuple(found)


def _named_instead(search: Search) -> dict[str, str]:
    """Effects that were not named, each with the named one that may be this one, or with the gyro's
    low-pass."""
    smooths = any(key[0] == GYRO_LOW_PASS for each in search.problem.base for key in each.settings)
    found = {id_: GYRO_LOW_PASS for id_ in LAG_FAMILIES[0] if smooths and id_ != GYRO_LOW_PASS}
    for name in search.fit.point.active:
        for rival in confounded_causes(search, search.problem.causes[name]):
            found.setdefault(rival.partition("@")[0], name)
    return found


def effect_visibility(search: Search, log: Log) -> dict[str, float]:
    """Visibility of each effect in the log, by id: see `evidence_per_width`. Effects on the back-EMF of a
    side without that reading do not count."""
    silent = sides_without_bemf(log)
    if not silent:
        return evidence_per_width(search)
    causes = {
        name: each
        for name, each in search.problem.causes.items()
        if not (each.id.startswith(BEMF_PREFIX) and each.where in silent)
    }
    return evidence_per_width(replace(search, problem=replace(search.problem, causes=causes)))


def sides_without_bemf(log: Log) -> list[str]:
    """The sides whose back-EMF is not in the log."""
    return [side for side in SIDES if log.channel(f"{BEMF_PREFIX[:-1]}_{side}") is None]


def _rejection_reason(search: Search, log: Log, id_: str, visible: float) -> str:
    silent = sides_without_bemf(log) if id_.startswith(BEMF_PREFIX) else []
    if len(silent) == len(SIDES):
        roles = " or ".join(f"bemf_{side}" for side in silent)
        return f"{NOT_IDENTIFIABLE}: there is no {roles} reading in this recording"
    if silent:
        usual = _general_reason(search, id_, visible)
        other = next(side for side in SIDES if side not in silent)
        return (
            f"{NOT_IDENTIFIABLE} at the {silent[0]}: there is no bemf_{silent[0]} reading in this recording; "
            f"at the {other}: {usual}"
        )
    own = search.problem.causes.get(id_)
    needed = [
        role for role, ids in EFFECTS_BY_CHANNEL.items() if id_ in ids and visible < MIN_VISIBLE_EVIDENCE
    ]
    if own is not None and own.own is not None:
        needed.extend(own.own.needs)
    for role in needed:
        if log.channel(role) is None:
            return f"{NOT_IDENTIFIABLE}: there is no {role} reading in this recording"
    return _general_reason(search, id_, visible)


def _general_reason(search: Search, id_: str, visible: float) -> str:
    """The reason for an effect whose channels were all recorded."""
    cause = next(each for each in search.problem.causes.values() if each.id == id_)
    shows = describe_detection_limit(cause, visible, gate(id_, alone=not search.fit.point.active))
    if visible < MIN_VISIBLE_EVIDENCE:
        return f"not visible in this recording: a usual deviation would not show{shows}"
    for name, reason in search.rejections.items():
        if name.partition("@")[0] == id_:
            return f"{reason}{shows}"
    bent = " and ".join(text for each, text in large_deviations(search) if each == id_)
    return f"too little to be told from chance: {bent}" if bent else f"{EXPLAINS_NOTHING}{shows}"
