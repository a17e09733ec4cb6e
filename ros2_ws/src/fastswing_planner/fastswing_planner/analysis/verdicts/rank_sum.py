"""Are two small samples different? The exact rank-sum test (Wilcoxon, Mann and Whitney)."""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fastswing_planner.arrays import Vector

EXACT_COUNT = 100
"""Up to so many values in both samples together the test is exact."""


def midranks(values: Vector) -> Vector:
    """Return the rank of each value, 1 for the smallest; equal ones share their mean rank.

    values  shape (k,)
    """
    order = np.sort(values)
    below = np.searchsorted(order, values, side="left")
    up_to = np.searchsorted(order, values, side="right")
    ranks: Vector = (below + up_to + 1) / 2.0
    return ranks


def rank_sum_p_value(first: Sequence[float], second: Sequence[float]) -> float:
    """Return the two-sided p-value of "both are drawn from one distribution".

    Up to EXACT_COUNT values it is exact, ties included: the share of all ways to divide the values
    into two samples of these sizes that put the rank sum at least as far from its mean. Beyond, the
    rank sum's normal approximation. NaN if a sample is empty.
    """
    if not first or not second:
        return math.nan
    ranks = midranks(np.array([*first, *second], dtype=float))
    if ranks.size > EXACT_COUNT:
        return _normal_p_value(ranks, len(first))
    # Twice the midranks are integers.
    return _exact_p_value(np.rint(2.0 * ranks).astype(int), len(first))


def _exact_p_value(ranks: NDArray[np.int64], size: int) -> float:
    """Count the ways to choose `size` of integer `ranks` by their sum."""
    total = int(ranks.sum())
    # ways[c, s]: how many choices of c values have the rank sum s.
    ways = np.zeros((size + 1, total + 1))
    ways[0, 0] = 1.0
    for rank in ranks.tolist():
        ways[1:, rank:] += ways[:-1, : total + 1 - rank].copy()
    # Distances from the mean rank sum, size * total / count, times count: integers.
    distance = np.abs(ranks.size * np.arange(total + 1) - size * total)
    observed = abs(ranks.size * int(ranks[:size].sum()) - size * total)
    return float(ways[size, distance >= observed].sum() / ways[size].sum())


def _normal_p_value(ranks: Vector, size: int) -> float:
    count = ranks.size
    mean = size * (count + 1) / 2.0
    deviation = math.sqrt(
        size * (count - size) / count * float(np.var(ranks)) * count / (count - 1)
    )
    if deviation == 0.0:
        return 1.0
    return math.erfc(abs(float(ranks[:size].sum()) - mean) / deviation / math.sqrt(2.0))


def holm(p_values: Sequence[float]) -> list[float]:
    """Return p-values adjusted for being several tests, by Holm's method; NaN stays and is no test.

    Each, from the smallest on, is multiplied by the number of tests that are left, and is not less
    than the one before. If nothing differs, the chance that any is below a level is at most it.
    """
    known = [(value, place) for place, value in enumerate(p_values) if not math.isnan(value)]
    adjusted = list(p_values)
    least = 0.0
    for done, (p_value, place) in enumerate(sorted(known)):
        least = max(least, min(1.0, (len(known) - done) * p_value))
        adjusted[place] = least
    return adjusted


def least_p_value(first_count: int, second_count: int) -> float:
    """Return the smallest p-value that samples of these sizes can have; NaN if one is empty."""
    if not first_count or not second_count:
        return math.nan
    return min(1.0, 2.0 / math.comb(first_count + second_count, first_count))
