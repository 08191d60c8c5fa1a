"""Sets of causes by algebra: what one step at a time would miss."""

from __future__ import annotations

import numpy as np
import pytest

from raccoon.diagnose.fit.evidence import Gram
from raccoon.diagnose.select.gates import EVIDENCE_GATE
from raccoon.diagnose.select.set_scoring import Member, SetScorer, causes_overlap


def sets_of(columns: np.ndarray, target: np.ndarray, *one_sided: int) -> SetScorer:
    """Each column a cause named after its place."""
    members = tuple(Member(f"cause{i}", (i,), None, i in one_sided) for i in range(columns.shape[1]))
    return SetScorer(Gram.of(columns, target), members)


def imitated(seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Causes 0 and 1 act; cause 2 is their sum and something else, so alone it explains most."""
    rng = np.random.default_rng(seed)
    right = rng.standard_normal((400, 2))
    wrong = right.sum(axis=1) + 0.9 * rng.standard_normal(400)
    other = rng.standard_normal((400, 4))
    columns = np.column_stack([right, wrong, other])
    return columns, columns[:, 0] + columns[:, 1] + 0.5 * rng.standard_normal(400)


def test_a_set_is_scored_by_its_evidence_less_its_gates() -> None:
    columns, target = imitated(1)
    sets = sets_of(columns, target)
    chosen = frozenset({0, 3})
    _, evidence, _ = sets.gram.take([0, 3]).solve()
    assert sets.solve(chosen)[1] == pytest.approx(evidence)
    assert sets.score(chosen) == pytest.approx(evidence - 2 * EVIDENCE_GATE)
    assert sets.solve(frozenset())[1] == 0.0


@pytest.mark.parametrize("start", [frozenset(), frozenset({2}), frozenset({2, 5})])
def test_climbing_replaces_one_that_imitates_two(start: frozenset[int]) -> None:
    sets = sets_of(*imitated(2))
    alone = max(range(7), key=lambda i: sets.score(frozenset({i})))
    assert alone == 2
    sets.climb(start)
    assert sets.best_sets(1) == [frozenset({0, 1})]


def test_sets_that_are_solved_at_once_have_the_scores_of_each_alone() -> None:
    columns, target = imitated(5)
    once, alone = (sets_of(columns, target, 0, 4, 6) for _ in range(2))
    once.climb(frozenset({2}))
    assert len({len(each) for each in once.scores}) > 2
    for chosen, score in once.scores.items():
        assert alone.score(chosen) == pytest.approx(score, rel=1e-12)


def test_a_one_sided_cause_must_have_its_sign() -> None:
    columns, target = imitated(3)
    sets = sets_of(columns, -target, 0, 1)
    assert sets.score(frozenset({0})) == -np.inf
    assert all(not {0, 1} & each for each in sets.best_sets(5))


def test_dropping_leaves_what_is_worth_its_gate() -> None:
    sets = sets_of(*imitated(4))
    assert sets.without_unneeded(frozenset({0, 1, 3, 4, 5})) == frozenset({0, 1})


def test_variants_of_the_same_causes_count_once() -> None:
    columns, target = imitated(5)
    twice = np.column_stack([columns, columns[:, 0]])
    sets = sets_of(twice, target)
    sets.members = (*sets.members[:-1], Member("cause0", (7,), None, False))
    sets.climb(frozenset())
    names = [sets.names(each) for each in sets.best_sets(10)]
    assert len(names) == len(set(names))
    assert not any({0, 7} <= each for each in sets.scores)


def test_places_overlap_where_one_holds_the_other() -> None:
    assert causes_overlap("bemf.scale", "bemf.scale@left")
    assert causes_overlap("bemf.scale@left", "bemf.scale@left")
    assert not causes_overlap("bemf.scale@right", "bemf.scale@left")
    assert not causes_overlap("bemf.scale", "bemf.offset")
