"""Rates, gaps and losses of a topic."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastswing_planner.analysis.recording import TopicTimes
from fastswing_planner.analysis.timing import TopicTiming, topic_timing

GRID = np.arange(200) / 100.0


def timing(received: Any, **values: Any) -> TopicTiming:
    times = np.asarray(received, dtype=float)
    return topic_timing(TopicTimes("/a", "t/msg/T", times, **{"steady": True, **values}))


def test_a_regular_topic_has_its_rate_and_no_gap() -> None:
    found = timing(GRID)
    assert (found.count, found.rate, found.gaps) == (200, pytest.approx(100.0), ())


def test_a_pause_of_more_than_three_periods_is_a_gap() -> None:
    found = timing(np.delete(GRID, [50, 51, 52]))
    (gap,) = found.gaps
    assert (gap.start, gap.length) == pytest.approx((0.49, 0.04))
    assert found.missing == 3


@given(st.sets(st.integers(1, 198), max_size=60))
def test_what_is_missing_is_what_was_taken_out_in_runs_of_three_or_more(lost: set[int]) -> None:
    found = timing(np.delete(GRID, sorted(lost)))
    runs, run = [], 0
    for place in range(200):
        run = run + 1 if place in lost else 0
        if place + 1 not in lost and run:
            runs.append(run)
    assert found.missing == sum(run for run in runs if run >= 3)


def test_stamps_count_where_there_are_any() -> None:
    late = GRID + np.random.default_rng(1).uniform(0.0, 0.05, GRID.size)
    assert timing(late, stamp=GRID).longest == pytest.approx(0.01)


def test_pauses_of_a_topic_that_comes_as_needed_are_no_gaps() -> None:
    assert timing([0.0, 0.1, 5.0, 5.1] * 5, steady=False).gaps == ()


@pytest.mark.parametrize(("count", "steady"), [(9, False), (10, True)])
def test_of_few_messages_nobody_can_tell_a_gap(count: int, steady: bool) -> None:
    assert timing(GRID[:count]).steady == steady


def test_a_clock_that_runs_backwards_is_counted_and_does_not_spoil_the_rate() -> None:
    found = timing(np.concatenate([GRID, GRID]))
    assert (found.jumps, found.rate) == (1, pytest.approx(100.0))


def test_stamps_that_run_backwards_by_a_millisecond_are_no_jump() -> None:
    time = GRID.copy()
    time[50] = time[49] - 0.001
    assert timing(time).jumps == 0


def test_numbers_missing_in_the_publishers_count_were_dropped() -> None:
    assert timing(GRID[:4], sequence=np.array([7, 8, 11, 12])).dropped == 2


def test_a_publisher_that_began_anew_dropped_nothing() -> None:
    assert timing(GRID[:5], sequence=np.array([7, 8, 1, 2, 3])).dropped == 0


def test_of_several_publishers_nobody_knows_what_was_dropped() -> None:
    assert timing(GRID[:10], sequence=np.array([1, 500] * 5)).dropped is None


@pytest.mark.parametrize("sequence", [None, np.zeros(4, dtype=np.int64)])
def test_without_a_count_nobody_knows_what_was_dropped(sequence: Any) -> None:
    assert timing(GRID[:4], sequence=sequence).dropped is None


@pytest.mark.parametrize("count", [0, 1])
def test_of_hardly_any_message_there_is_no_rate(count: int) -> None:
    found = timing(GRID[:count])
    assert np.isnan([found.rate, found.period, found.longest]).all()
