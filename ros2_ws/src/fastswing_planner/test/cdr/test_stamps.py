"""Stamps: nanoseconds and seconds, there and back, and the one judgement of their age."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastswing_planner.cdr.stamps import (
    NS_PER_SEC,
    StampFault,
    age_sec,
    from_ns,
    from_seconds,
    stamp_fault,
    to_ns,
    to_seconds,
)

NOW = 1_700_000_000_000_000_000
times_ns = st.integers(-(10**18), 4 * 10**18)


@given(times_ns)
def test_nanoseconds_come_back_exactly(time_ns: int) -> None:
    assert to_ns(*from_ns(time_ns)) == time_ns


@given(times_ns)
def test_a_stamp_has_less_than_a_second_of_nanoseconds(time_ns: int) -> None:
    assert 0 <= from_ns(time_ns).nanosec < NS_PER_SEC


@given(st.floats(0.0, 1e6))
def test_a_duration_comes_back_to_the_nanosecond(seconds: float) -> None:
    assert to_seconds(*from_seconds(seconds)) == pytest.approx(seconds, abs=1e-9)


def test_a_duration_just_below_a_second_is_rounded_up_to_it() -> None:
    assert from_seconds(0.9999999999) == (1, 0)


def test_columns_are_converted_as_numbers_are() -> None:
    sec, nanosec = np.array([1, 2]), np.array([5, 7])
    assert to_ns(sec, nanosec).tolist() == [1_000_000_005, 2_000_000_007]
    assert to_seconds(sec, nanosec).tolist() == [1.000000005, 2.000000007]


def test_an_age_counts_from_the_stamp() -> None:
    assert age_sec(NOW - 250_000_000, NOW) == pytest.approx(0.25)
    assert age_sec(NOW + 250_000_000, NOW) == pytest.approx(-0.25)


@pytest.mark.parametrize(
    ("stamp_ns", "fault"),
    [
        (0, StampFault.ZERO),
        (NOW - 1_001_000_000, StampFault.OLD),
        (NOW - 1_000_000_000, None),
        (NOW, None),
        (NOW + 50_000_000, None),
        (NOW + 51_000_000, StampFault.FUTURE),
    ],
)
def test_a_stamp_is_judged(stamp_ns: int, fault: StampFault | None) -> None:
    assert stamp_fault(stamp_ns, NOW, max_age=1.0, max_ahead=0.05) == fault


@given(times_ns.filter(bool), st.floats(0.0, 10.0), st.floats(0.0, 10.0))
def test_a_stamp_is_fine_when_its_age_is_within_both_limits(
    stamp_ns: int, max_age: float, max_ahead: float
) -> None:
    fine = -max_ahead <= age_sec(stamp_ns, NOW) <= max_age
    assert (stamp_fault(stamp_ns, NOW, max_age, max_ahead) is None) == fine
