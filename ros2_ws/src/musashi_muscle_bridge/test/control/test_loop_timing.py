"""Rate, jitter and lateness of a loop, from the times at which its periods begin."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from musashi_muscle_bridge.control.loop_timing import LoopTiming, Schedule

PERIOD = 0.01

delays = st.lists(st.floats(0.0, 20 * PERIOD), max_size=50)


def run(timing: LoopTiming, periods: list[float], start: float = 5.0) -> None:
    now = start
    timing.begin(now)
    for period in periods:
        now += period
        timing.begin(now)


def test_before_the_first_window_has_ended_nothing_is_told() -> None:
    timing = LoopTiming(PERIOD)
    run(timing, [PERIOD] * 50)
    assert timing.latest.rate == 0.0


def test_a_regular_loop_has_its_rate_and_no_jitter() -> None:
    timing = LoopTiming(PERIOD)
    run(timing, [PERIOD] * 101)
    assert timing.latest.rate == pytest.approx(100.0)
    assert timing.latest.jitter == pytest.approx(0.0, abs=1e-9)


def test_jitter_is_the_deviation_of_the_periods() -> None:
    timing = LoopTiming(PERIOD)
    run(timing, [0.008, 0.012] * 51)
    assert timing.latest.jitter == pytest.approx(0.002, rel=0.01)
    assert timing.latest.longest == pytest.approx(0.012)


@pytest.mark.parametrize(("period", "late"), [(0.0149, 0), (0.0151, 1)])
def test_a_period_half_as_long_again_is_late(period: float, late: int) -> None:
    timing = LoopTiming(PERIOD)
    run(timing, [PERIOD, period, PERIOD])
    assert timing.late == late


def test_a_window_tells_the_mean_round_trip() -> None:
    timing = LoopTiming(PERIOD)
    timing.answered(0.001)
    timing.answered(0.003)
    run(timing, [PERIOD] * 101)
    assert timing.latest.round_trip == pytest.approx(0.002)


def test_a_window_without_an_answer_has_no_round_trip() -> None:
    timing = LoopTiming(PERIOD)
    run(timing, [PERIOD] * 101)
    assert math.isnan(timing.latest.round_trip)


def test_each_window_starts_anew() -> None:
    timing = LoopTiming(PERIOD)
    run(timing, [0.5, 0.6] + [PERIOD] * 101)
    assert timing.latest.longest == pytest.approx(PERIOD)


# Deadlines.


def begins(delays: list[float]) -> tuple[list[float], list[float], Schedule]:
    """Return when periods began that take so long, their deadlines, and the schedule [s]."""
    schedule = Schedule(5.0, PERIOD)
    now, began, deadlines = 5.0, [5.0], [5.0]
    for delay in delays:
        now += delay
        now += schedule.next(now)
        began.append(now)
        deadlines.append(schedule.deadline)
    return began, deadlines, schedule


@given(delays)
def test_every_period_begins_or_is_counted_as_skipped(delays: list[float]) -> None:
    _, deadlines, schedule = begins(delays)
    whole = (deadlines[-1] - deadlines[0]) / PERIOD
    assert whole == pytest.approx(len(delays) + schedule.skipped, abs=1e-6)


@given(delays)
def test_no_period_begins_before_its_deadline_or_a_period_after_it(delays: list[float]) -> None:
    began, deadlines, _ = begins(delays)
    for begin, deadline in zip(began, deadlines, strict=True):
        assert -1e-9 < begin - deadline < PERIOD + 1e-9


@given(st.lists(st.floats(0.0, 0.99 * PERIOD)))
def test_a_loop_that_is_in_time_skips_nothing(delays: list[float]) -> None:
    assert begins(delays)[2].skipped == 0


@pytest.mark.parametrize(("delay", "skipped"), [(1.5, 0), (2.5, 1), (7.5, 6)])
def test_as_many_periods_are_skipped_as_were_over_before_they_began(
    delay: float, skipped: int
) -> None:
    assert begins([delay * PERIOD])[2].skipped == skipped
