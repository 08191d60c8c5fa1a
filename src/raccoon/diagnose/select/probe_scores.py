"""Scores of probes: the log evidence that each would add to the active causes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.fit.evidence import Gram
from raccoon.diagnose.fit.linear_model import ColumnGroup
from raccoon.diagnose.fit.noise_estimation import WANDER_SHARES
from raccoon.diagnose.fit.wander import wandering_friction_columns
from raccoon.diagnose.select.fit_comparison import MAX_EVENT_LEAD, event_excess
from raccoon.diagnose.select.screening import screen_groups
from raccoon.diagnose.select.state import Search

Array = NDArray[np.float64]

NEAR_BEST_SHARE = 0.7
"""Share of the best probe's lead above which probes are ranked by their unlimited log evidence, since many
events reach the limit of a lead."""
MAX_PROBES_EXAMINED = 3
"""Number of probes, those with most evidence, that are examined closely."""
MIN_PROBE_EVIDENCE = 10.0
"""Log evidence in the linear model from which a probe is examined closely."""


@dataclass(frozen=True, slots=True)
class ProbeScore:
    """A probe and the log evidence that it would add: unlimited (evidence), and with each event's
    contribution limited (lead). min_lead: see `ColumnGroup`."""

    name: str
    evidence: float
    lead: float
    min_lead: float = 0.0

    def exceeds(self, gate: float) -> bool:
        """Whether the lead is above a gate and above min_lead, which ordinary effects reach as well."""
        return self.lead > max(gate, self.min_lead)


def find_best_probe(search: Search) -> ProbeScore:
    """The probe that explains most of the residual, with events limited as in `log_evidence_lead`."""
    found = [ProbeScore("", 0.0, 0.0)]
    # Evidence that a probe gains because it relieves strained base numbers is left out: no cause could be
    # compared with it.
    features = search.problem.features
    max_total_lead = MAX_EVENT_LEAD * len(features.time) / features.event
    likeliest = _rank_probes(search)[:MAX_PROBES_EXAMINED]
    probes = {each.name: each.columns for each in search.probes(search.linear)} if likeliest else {}
    for gain, each in likeliest:
        columns = probes[each.name]
        group = replace(each, columns=columns[list(each.part)] if each.part else columns)
        min_lead = group.min_lead
        if group.over_place:
            gain, limited = (each - group.choice_penalty for each in _evidence_beside_wander(search, group))
        else:
            *residuals, size = _residuals_with_and_without(search, group)
            limited = gain - event_excess(search.problem, *residuals)
            min_lead = min_lead if size < group.usual else group.min_lead_if_larger
        found.append(ProbeScore(group.name, gain, min(limited, max_total_lead), min_lead))
    shown = [each for each in found if each.exceeds(0.0)] or found
    max_lead = max(each.lead for each in shown)
    return max(
        (each for each in shown if each.lead >= NEAR_BEST_SHARE * max_lead), key=lambda each: each.evidence
    )


def _rank_probes(search: Search) -> list[tuple[float, ColumnGroup]]:
    """The probes that are worth a closer examination, whole or only the part that explains most alone, with
    their log evidence less the penalty of choosing that part; best first."""
    known = {*search.problem.causes, *search.unknown}
    best: dict[str, tuple[float, ColumnGroup]] = {}
    for gain, group, _ in screen_groups(search, search.table.with_parts(), hold_bounds=True):
        left = gain - group.choice_penalty
        if group.name in known or left < MIN_PROBE_EVIDENCE:
            continue
        if group.name not in best or left > best[group.name][0]:
            best[group.name] = left, group
    return sorted(best.values(), key=lambda each: -each[0])


def _residuals_with_and_without(search: Search, group: ColumnGroup) -> tuple[Array, Array, float]:
    """Whitened residuals of the linear model with a group and without it, and the norm of the group's
    coordinates."""
    fit = search.fit
    own, target = fit.jacobian[fit.free], fit.target
    every = np.vstack([own, search.whitener(group.columns)])
    mean, _, _ = Gram.of(every.T, target).solve()
    less, _, _ = Gram.of(own.T, target).solve()
    return target - mean @ every, target - less @ own, float(np.linalg.norm(mean[len(own) :]))


def _evidence_beside_wander(search: Search, group: ColumnGroup) -> tuple[float, float]:
    """Log evidence of a probe over the place, unlimited and with events limited, if friction may vary slowly
    as well. Models with and without the probe each use their most likely size of slowly varying friction.

    A place where the robot was only once is a moment, and friction over it is the same as friction that
    varies in time. Both were free when the noise was estimated, and chance decided between them.
    """
    fit = search.fit
    own, slow = (
        fit.jacobian[fit.free],
        search.whitener(wandering_friction_columns(search.problem, search.linear)),
    )
    residuals, evidence = [], []
    for columns in (np.vstack([own, search.whitener(group.columns)]), own):
        every = np.vstack([columns, slow])
        gram = Gram.of(every.T, fit.target)
        wanders = [np.repeat([1.0, share], [len(columns), len(slow)]) for share in WANDER_SHARES]
        sizes = max(wanders, key=lambda each: gram.scaled(each).evidence())
        mean, log_evidence, _ = gram.scaled(sizes).solve()
        residuals.append(fit.target - (mean * sizes) @ every)
        evidence.append(log_evidence)
    gain = evidence[0] - evidence[1]
    return gain, gain - event_excess(search.problem, *residuals)
