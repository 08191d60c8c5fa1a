"""Scores of sets of causes by the linear model alone, and a local search for the best set.

Around a working point the algebra of `evidence` scores a set in microseconds, so causes are added, dropped
and exchanged until no such step improves the score. A set's score is its log evidence less the gates of its
causes.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from raccoon.diagnose.fit.evidence import Gram
from raccoon.diagnose.fit.linear_model import ColumnGroup
from raccoon.diagnose.select.gates import total_gate
from raccoon.diagnose.select.state import Search

Array = NDArray[np.float64]
MemberSet = frozenset[int]

MAX_CLIMB_STEPS = 12
"""Maximum number of steps of one climb."""


@dataclass(frozen=True, slots=True)
class Member:
    """A possible member of a set: a cause that is active at the working point (group None), or an inactive
    one with the columns of one starting guess. span: its indices in the scorer's Gram matrix."""

    name: str
    span: tuple[int, ...]
    group: ColumnGroup | None
    one_sided: bool


@dataclass(slots=True)
class SetScorer:
    """The linear model with base coordinates eliminated, the possible members of sets, and the scores
    computed so far."""

    gram: Gram
    members: tuple[Member, ...]
    scores: dict[MemberSet, float] = field(default_factory=dict)

    @classmethod
    def of(cls, search: Search) -> SetScorer:
        """A scorer whose members are every active cause, then every variant of every inactive cause."""
        table, causes = search.table, search.problem.causes
        found = [
            Member(name, tuple(span), None, causes[name].one_sided) for name, span in table.active.items()
        ]
        found.extend(
            Member(group.name, tuple(span), group, group.one_sided)
            for group, span in table.inactive
            if group.name in causes
        )
        columns = [i for each in found for i in each.span]
        rest = table.gram.take([*range(table.base_count), *columns]).eliminate_leading(table.base_count)
        members, position = [], 0
        for each in found:
            span = tuple(range(position, position + len(each.span)))
            members.append(Member(each.name, span, each.group, each.one_sided))
            position += len(span)
        return cls(rest, tuple(members))

    def names(self, chosen: MemberSet) -> frozenset[str]:
        """Names of a set's causes."""
        return frozenset(self.members[each].name for each in chosen)

    def solve(self, chosen: MemberSet) -> tuple[Array, float]:
        """Coordinates of the members in their order, and the log evidence, which is -inf if a one-sided
        coordinate is negative."""
        index = [i for each in sorted(chosen) for i in self.members[each].span]
        if not index:
            return np.zeros(0), 0.0
        factor = np.linalg.cholesky(np.eye(len(index)) + self.gram.matrix[np.ix_(index, index)])
        half = np.linalg.solve(factor, self.gram.projection[index])
        mean = np.linalg.solve(factor.T, half)
        if self._has_wrong_sign(chosen, mean):
            return mean, -np.inf
        return mean, float(0.5 * half @ half - np.log(np.diag(factor)).sum())

    def score(self, chosen: MemberSet) -> float:
        """Log evidence of a set less the gates of its causes."""
        if chosen not in self.scores:
            self._score_all([chosen])
        return self.scores[chosen]

    def _score_all(self, sets: Sequence[MemberSet]) -> None:
        """Compute the `score` of each set; sets with the same number of columns are solved at once."""
        by_size: dict[int, list[tuple[MemberSet, list[int]]]] = {}
        for chosen in dict.fromkeys(each for each in sets if each not in self.scores):
            index = [i for each in sorted(chosen) for i in self.members[each].span]
            by_size.setdefault(len(index), []).append((chosen, index))
        for size, group in by_size.items():
            columns = np.array([index for _, index in group], int)
            matrices = np.eye(size) + self.gram.matrix[columns[:, :, None], columns[:, None, :]]
            factors = np.linalg.cholesky(matrices)
            halves = np.linalg.solve(factors, self.gram.projection[columns][..., None])
            means = np.linalg.solve(factors.transpose(0, 2, 1), halves)[..., 0]
            diagonals = np.diagonal(factors, axis1=1, axis2=2)
            found = 0.5 * (halves[..., 0] ** 2).sum(axis=1) - np.log(diagonals).sum(axis=1)
            for (chosen, _), mean, evidence in zip(group, means, found, strict=True):
                score = -np.inf if self._has_wrong_sign(chosen, mean) else float(evidence)
                self.scores[chosen] = score - total_gate([self.members[each].name for each in chosen])

    def _has_wrong_sign(self, chosen: MemberSet, mean: Array) -> bool:
        position = 0
        for each in sorted(chosen):
            if self.members[each].one_sided and mean[position] <= 0.0:
                return True
            position += len(self.members[each].span)
        return False

    def climb(self, chosen: MemberSet) -> None:
        """Hill climbing: take the best step until none improves the score. Every score on the way is kept."""
        for _ in range(MAX_CLIMB_STEPS):
            steps = list(self._steps(chosen))
            self._score_all(steps)
            best = max(steps, key=self.score)
            if self.score(best) <= self.score(chosen):
                return
            chosen = best

    def without_unneeded(self, chosen: MemberSet) -> MemberSet:
        """Backward elimination: the set after members were dropped, one by one, whose removal raises the
        score."""
        while chosen:
            best = max((chosen - {dropped} for dropped in chosen), key=self.score)
            if self.score(best) <= self.score(chosen):
                break
            chosen = best
        return chosen

    def best_sets(self, count: int) -> list[MemberSet]:
        """The best `count` sets among those scored; variants of the same causes count once."""
        found: dict[frozenset[str], MemberSet] = {}
        for each in sorted(self.scores, key=lambda each: -self.scores[each]):
            if np.isfinite(self.scores[each]):
                found.setdefault(self.names(each), each)
            if len(found) >= count:
                break
        return list(found.values())

    def _steps(self, chosen: MemberSet) -> Iterator[MemberSet]:
        """All sets that differ by one member dropped, added or exchanged."""
        for dropped in chosen:
            yield chosen - {dropped}
        for new in range(len(self.members)):
            if new in chosen:
                continue
            if self._can_join(new, chosen):
                yield chosen | {new}
            for dropped in chosen:
                if self._can_join(new, chosen - {dropped}):
                    yield (chosen - {dropped}) | {new}

    def _can_join(self, new: int, chosen: MemberSet) -> bool:
        return overlaps_none(self.members[new].name, self.names(chosen))


def overlaps_none(name: str, others: Collection[str]) -> bool:
    """Whether a cause overlaps none of the others, so that it can be active beside them."""
    return not any(causes_overlap(name, each) for each in others)


def causes_overlap(one: str, other: str) -> bool:
    """Whether two causes are the same effect at overlapping places."""
    if one.partition("@")[0] != other.partition("@")[0]:
        return False
    return one == other or "@" not in one or "@" not in other
