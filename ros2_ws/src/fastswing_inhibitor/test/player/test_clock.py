"""Bag time runs at its rate, stands still when paused, and never jumps by itself."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastswing_inhibitor.player.clock import ReplayClock
from fastswing_planner.errors import InvalidLimit

RATES = st.floats(0.1, 10.0)
TIMES = st.floats(0.0, 1000.0)
START_NS = 1_700_000_000_000_000_000


def test_it_begins_paused() -> None:
    clock = ReplayClock(START_NS, 1.0)
    assert clock.paused
    assert clock.now_ns(5.0) == START_NS
    assert clock.wait(START_NS + 1, 5.0) == float("inf")


@given(RATES, TIMES, TIMES)
def test_it_runs_at_its_rate(rate: float, begin: float, later: float) -> None:
    clock = ReplayClock(START_NS, rate)
    clock.resume(begin)
    passed = (clock.now_ns(begin + later) - START_NS) * 1e-9
    assert passed == pytest.approx(rate * later, abs=1e-6)


@given(RATES, TIMES, TIMES)
def test_a_pause_takes_no_bag_time(rate: float, running: float, pause: float) -> None:
    clock = ReplayClock(START_NS, rate)
    clock.resume(0.0)
    clock.pause(running)
    before = clock.now_ns(running)
    clock.resume(running + pause)
    assert clock.now_ns(running + pause) == before


@given(RATES, st.integers(0, 10**12))
def test_after_the_wait_it_is_time(rate: float, ahead_ns: int) -> None:
    clock = ReplayClock(START_NS, rate)
    clock.resume(1.0)
    wait = clock.wait(START_NS + ahead_ns, 1.0)
    assert clock.now_ns(1.0 + wait) == pytest.approx(START_NS + ahead_ns, abs=2000 * rate)


def test_resuming_twice_changes_nothing() -> None:
    clock = ReplayClock(START_NS, 2.0)
    clock.resume(1.0)
    clock.resume(3.0)
    assert clock.now_ns(4.0) == START_NS + 6_000_000_000


def test_a_jump_keeps_it_running() -> None:
    clock = ReplayClock(START_NS, 1.0)
    clock.resume(0.0)
    clock.jump(START_NS, 10.0)
    assert not clock.paused
    assert clock.now_ns(11.0) == START_NS + 1_000_000_000


@pytest.mark.parametrize("rate", [0.0, -1.0, float("inf"), float("nan")])
def test_a_rate_that_is_none_is_refused(rate: float) -> None:
    with pytest.raises(InvalidLimit) as caught:
        ReplayClock(START_NS, rate)
    assert str(caught.value) == f"--rate is {rate:g}, expected more than 0"
