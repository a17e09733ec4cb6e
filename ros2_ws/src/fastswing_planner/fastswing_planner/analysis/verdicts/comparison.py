"""Two groups of repeated swings side by side: medians, spread, and whether they differ."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fastswing_planner.analysis.figures import FIGURES
from fastswing_planner.analysis.measured_swing import MeasuredSwing
from fastswing_planner.analysis.verdicts.rank_sum import holm, least_p_value, rank_sum_p_value

SIGNIFICANT = 0.05
"""A smaller p-value counts as a difference."""
COMPARED = (
    "main_joint_speed",
    "time",
    "time_over_predicted",
    "muscle_speed",
    "tension",
    "state_to_override",
    "state_to_zero",
)


@dataclass(frozen=True)
class Spread:
    """Of one group: values of how many swings, their median and quartiles; NaN without values.

    count  swings whose value is known
    total  all swings
    """

    count: int
    total: int
    median: float
    low: float
    high: float
    least: float
    most: float


@dataclass(frozen=True)
class Difference:
    """One figure of two groups.

    method   the swings compared
    figure   a key of FIGURES
    p_value  of the exact rank-sum test, adjusted for all figures of the method (Holm); NaN if a
             group has no value
    verdict  in words
    """

    method: str
    figure: str
    first: Spread
    second: Spread
    p_value: float
    verdict: str

    @property
    def change(self) -> float:
        """The second median minus the first."""
        return self.second.median - self.first.median


@dataclass(frozen=True)
class Comparison:
    """Two named groups of swings, and the differences of their figures."""

    names: tuple[str, str]
    first: Sequence[MeasuredSwing]
    second: Sequence[MeasuredSwing]
    differences: Sequence[Difference]


def spread(values: Sequence[float]) -> Spread:
    """Summarise values; NaN are left out, but counted in the total."""
    known = np.array([value for value in values if np.isfinite(value)], dtype=float)
    if known.size == 0:
        return Spread(0, len(values), *[np.nan] * 5)
    low, median, high = np.quantile(known, [0.25, 0.5, 0.75]).tolist()
    least, most = float(known.min()), float(known.max())
    return Spread(known.size, len(values), median, low, high, least, most)


def compare(first: Sequence[MeasuredSwing], second: Sequence[MeasuredSwing]) -> list[Difference]:
    """Compare each method that both groups have; if they share none, all swings as one."""
    methods = sorted({swing.method for swing in first} & {swing.method for swing in second})
    if not methods:
        return _differences("all", first, second)
    return [
        difference
        for method in methods
        for difference in _differences(
            method,
            [swing for swing in first if swing.method == method],
            [swing for swing in second if swing.method == method],
        )
    ]


def _differences(
    method: str, first: Sequence[MeasuredSwing], second: Sequence[MeasuredSwing]
) -> list[Difference]:
    found = []
    p_values = []
    for figure in COMPARED:
        of = FIGURES[figure].of
        one, other = ([of(swing) for swing in group] for group in (first, second))
        known = [[value for value in group if np.isfinite(value)] for group in (one, other)]
        if known[0] or known[1]:
            found.append((figure, spread(one), spread(other)))
            p_values.append(rank_sum_p_value(*known))
    tests = int(np.count_nonzero(np.isfinite(p_values)))
    return [
        Difference(
            method, *parts, p_value, _verdict(parts[1].count, parts[2].count, p_value, tests)
        )
        for parts, p_value in zip(found, holm(p_values), strict=True)
    ]


def _verdict(first_count: int, second_count: int, p_value: float, tests: int) -> str:
    """Return in words what the adjusted p-value of one of several tests says."""
    if not first_count or not second_count:
        return "only in one group"
    if p_value < SIGNIFICANT:
        return "different"
    if tests * least_p_value(first_count, second_count) >= SIGNIFICANT:
        return "too few swings to tell"
    return "no difference shown"
