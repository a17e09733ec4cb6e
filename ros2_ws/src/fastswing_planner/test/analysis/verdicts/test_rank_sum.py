"""The rank-sum test against scipy's."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from fastswing_planner.analysis.verdicts.rank_sum import (
    EXACT_COUNT,
    holm,
    least_p_value,
    midranks,
    rank_sum_p_value,
)

TIED = st.lists(st.integers(0, 5).map(float), min_size=1, max_size=6)
SEEDS = st.integers(0, 10_000)


@given(TIED)
def test_equal_values_share_their_rank(values: list[float]) -> None:
    assert midranks(np.array(values)).tolist() == stats.rankdata(values).tolist()


@given(SEEDS, st.integers(1, 9), st.integers(1, 9))
def test_without_ties_it_is_the_exact_test(seed: int, first: int, second: int) -> None:
    values = np.random.default_rng(seed).normal(size=first + second)
    a, b = values[:first].tolist(), values[first:].tolist()
    expected = stats.mannwhitneyu(a, b, method="exact").pvalue
    assert rank_sum_p_value(a, b) == pytest.approx(expected)


@given(TIED, TIED)
def test_with_ties_it_counts_every_way_to_divide_the_values(a: list[float], b: list[float]) -> None:
    ranks = stats.rankdata([*a, *b])
    centre = len(a) * ranks.mean()
    sums = np.array([sum(chosen) for chosen in combinations(ranks.tolist(), len(a))])
    extreme = np.abs(sums - centre) >= abs(ranks[: len(a)].sum() - centre) - 1e-9
    assert rank_sum_p_value(a, b) == pytest.approx(extreme.mean())


@given(TIED, TIED)
def test_the_order_of_the_samples_does_not_matter(a: list[float], b: list[float]) -> None:
    assert rank_sum_p_value(a, b) == pytest.approx(rank_sum_p_value(b, a))


def test_many_values_use_the_normal_approximation() -> None:
    values = np.random.default_rng(3).normal(size=EXACT_COUNT + 30)
    a, b = values[:60], values[60:] + 0.3
    expected = stats.mannwhitneyu(a, b, method="asymptotic", use_continuity=False).pvalue
    assert rank_sum_p_value(a.tolist(), b.tolist()) == pytest.approx(expected)


@given(st.integers(1, 8), st.integers(1, 8))
def test_no_samples_of_these_sizes_have_a_smaller_p_value(first: int, second: int) -> None:
    apart = rank_sum_p_value(list(range(first)), list(range(100, 100 + second)))
    assert apart == pytest.approx(least_p_value(first, second))


def test_of_several_tests_the_smallest_counts_as_many_times_as_there_are_tests() -> None:
    assert holm([0.04, 0.01, 0.03]) == pytest.approx([0.06, 0.03, 0.06])


def test_an_unknown_p_value_is_no_test() -> None:
    assert holm([0.02, np.nan, 0.04]) == pytest.approx([0.04, np.nan, 0.04], nan_ok=True)


@given(st.lists(st.floats(0.0, 1.0), max_size=8))
def test_adjusted_p_values_keep_their_order_and_are_between_bonferronis_and_their_own(
    p_values: list[float],
) -> None:
    adjusted = np.array(holm(p_values))
    assert np.all(adjusted >= p_values)
    assert np.all(adjusted <= np.minimum(1.0, len(p_values) * np.array(p_values)))
    assert np.all(np.diff(adjusted[np.argsort(p_values, kind="stable")]) >= 0.0)


def test_an_empty_sample_has_no_p_value() -> None:
    assert np.isnan(rank_sum_p_value([], [1.0]))
    assert np.isnan(least_p_value(0, 3))
