"""The result of a sweep: how often the program fails, and on which parameters that depends."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from raccoon.sweep.results import Row

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

GROUPS = 5
"""Number of groups of equal size into which the values of a parameter are divided."""
MIN_RARE = 5
"""Least number of failures and of successes for their dependence to be tested; with fewer the distance from
the goal is used."""
NORMAL_QUANTILE = 1.959964
"""Standard deviations to the ends of a 95 % interval."""
SIGNIFICANCE = 0.05
"""Level of significance."""
SHUFFLES = 200
"""Permutations of the outcomes per tested parameter: their least probability, times the number of parameters,
is then a tenth of `SIGNIFICANCE`."""


@dataclass(frozen=True, slots=True)
class Rate:
    """Failures of matches, with the 95 % interval of the true rate (Wilson)."""

    failed: int
    played: int

    @property
    def value(self) -> float:
        """The share that failed; NaN if nothing was played."""
        return self.failed / self.played if self.played else math.nan

    @property
    def interval(self) -> tuple[float, float]:
        """Ends of the interval: the p for which `failed` is 1.96 standard deviations from played * p."""
        n = self.played
        if not n:
            return 0.0, 1.0
        z2 = NORMAL_QUANTILE * NORMAL_QUANTILE
        middle = (self.value + z2 / (2 * n)) / (1 + z2 / n)
        spread = math.sqrt(self.value * (1 - self.value) / n + z2 / (4 * n * n))
        half = NORMAL_QUANTILE / (1 + z2 / n) * spread
        # Where none or all failed an end is 0 or 1 itself, and not but for rounding.
        return middle - half if self.failed else 0.0, middle + half if self.failed < n else 1.0


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """How much of the variation between matches goes with one parameter.

    share: of the variance, explained by the group of `GROUPS` that its value is in, less what chance explains
    (0 to 1; it can be slightly below 0). chance: probability of such a share if nothing had an effect, for
    the best of all tested parameters. groups: (lowest, highest value, mean outcome) of each group.
    """

    name: str
    share: float
    chance: float
    groups: tuple[tuple[float, float, float], ...]

    @property
    def is_clear(self) -> bool:
        """Whether it is significant at 5 %."""
        return self.chance < SIGNIFICANCE


@dataclass(frozen=True, slots=True)
class Summary:
    """rate: of failures. reasons: how often each occurred. sensitivities: all parameters, the strongest
    first. of: what the sensitivities refer to: "failure", or "error" (m)."""

    rate: Rate
    reasons: tuple[tuple[str, int], ...]
    of: str
    sensitivities: tuple[Sensitivity, ...]


def failure_kind(row: Row) -> str:
    """The kind of a failure: its reason without an error's text, which may contain a number."""
    return str(row["reason"]).partition(":")[0]


def summary(rows: Sequence[Row], factors: Sequence[str]) -> Summary:
    """Summarise rows whose columns `factors` were varied."""
    failed = [row["status"] != "ok" for row in rows]
    reasons = Counter(failure_kind(row) for row, bad in zip(rows, failed, strict=True) if bad)
    rate = Rate(sum(failed), len(rows))
    of, outcome = _outcome(rows, failed)
    found = [_sensitivity(rows, name, outcome, len(factors)) for name in factors]
    ranked = sorted((each for each in found if each is not None), key=lambda each: (-each.share, each.name))
    return Summary(rate, tuple(reasons.most_common()), of, tuple(ranked))


def _outcome(rows: Sequence[Row], failed: list[bool]) -> tuple[str, Floats]:
    import numpy as np

    errors = np.array([row["position_error"] for row in rows], dtype=np.float64)
    rare = min(sum(failed), len(failed) - sum(failed)) < MIN_RARE
    if rare and np.isfinite(errors).sum() > GROUPS:
        return "error", errors
    return "failure", np.array(failed, dtype=np.float64)


def _sensitivity(rows: Sequence[Row], name: str, outcome: Floats, tried: int) -> Sensitivity | None:
    """The sensitivity to one factor; None if the values or outcomes are too few or all equal."""
    import numpy as np

    values = np.array([row[name] for row in rows], dtype=np.float64)
    known = np.isfinite(values) & np.isfinite(outcome)
    values, outcome = values[known], outcome[known]
    group = _group_numbers(values)
    count = int(group.max()) + 1 if len(group) else 0
    if count < 2 or len(values) <= count or np.ptp(outcome) == 0.0:
        return None
    share, chance = _explained_variance(group, count, outcome)
    if chance * tried < SIGNIFICANCE:
        chance = max(chance, _permutation_p(group, count, outcome, SHUFFLES * tried))
    parts = [(values[group == each], outcome[group == each]) for each in range(count)]
    shown = tuple((float(v.min()), float(v.max()), float(o.mean())) for v, o in parts)
    return Sensitivity(name, share, min(1.0, chance * tried), shown)


def _group_numbers(values: Floats) -> NDArray[np.int64]:
    """The group number of each value: equal values share a group, otherwise the groups are of equal size."""
    import numpy as np

    different, place = np.unique(values, return_inverse=True)
    if len(different) <= GROUPS:
        return place.astype(np.int64)
    inner = np.quantile(values, np.arange(1, GROUPS) / GROUPS)
    return np.unique(np.searchsorted(inner, values, side="right"), return_inverse=True)[1].astype(np.int64)


def _explained_variance(group: NDArray[np.int64], count: int, outcome: Floats) -> tuple[float, float]:
    """Share of the variance between the groups, corrected for chance (epsilon squared), and the p-value of
    the F test.

    With S the sums of squares, n values and g groups: 1 - (S_within / (n - g)) / (S_all / (n - 1)).
    """
    import numpy as np
    from scipy.special import fdtrc

    size = np.bincount(group, minlength=count)
    mean = np.bincount(group, outcome, count) / size
    total = float(np.sum((outcome - outcome.mean()) ** 2))
    within = float(np.sum((outcome - mean[group]) ** 2))
    n = len(outcome)
    if within <= 1e-12 * total:
        return 1.0, 0.0
    share = 1.0 - (within / (n - count)) / (total / (n - 1))
    ratio = ((total - within) / (count - 1)) / (within / (n - count))
    return share, float(fdtrc(count - 1, n - count, ratio))


def _permutation_p(group: NDArray[np.int64], count: int, outcome: Floats, shuffles: int) -> float:
    """Permutation test: the probability that the groups explain as much of randomly permuted outcomes.

    The F test assumes normal outcomes, and is far too confident for a fault that two of the matches have, or
    for a few failures. For groups of given sizes the explained squares grow with S = sum of (sum of the
    outcomes in a group)^2 / size of the group.
    """
    import numpy as np

    random = np.random.default_rng(0)
    size = np.bincount(group, minlength=count)
    centred = outcome - outcome.mean()

    def explained(outcomes: Floats) -> float:
        return float(np.sum(np.bincount(group, outcomes, count) ** 2 / size))

    least = explained(centred) * (1.0 - 1e-9)  # alike to the last digits is alike
    reached = sum(explained(random.permutation(centred)) >= least for _ in range(shuffles))
    return (1 + reached) / (1 + shuffles)
