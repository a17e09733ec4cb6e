"""An override holds until its lease ends or the next one comes."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastswing_planner.analysis.inhibition_intervals import InhibitionInterval, inhibitions, within
from fastswing_planner.analysis.recording import OverrideSeries

MUSCLES = st.sampled_from([(), ("#9",), ("#9", "#10")])
ROWS = st.lists(st.tuples(st.integers(1, 40), st.integers(1, 60), MUSCLES), max_size=25)


def overrides(rows: Sequence[tuple[float, float, tuple[str, ...]]]) -> OverrideSeries:
    """Return overrides of rows (received, lease, muscles)."""
    received = np.array([row[0] for row in rows])
    return OverrideSeries(
        received, received, np.array([row[1] for row in rows]), tuple(row[2] for row in rows)
    )


def test_renewed_leases_are_one_interval() -> None:
    rows = [(1.0, 0.05, ("#9",)), (1.04, 0.05, ("#9",)), (1.08, 0.05, ("#9",))]
    (found,) = inhibitions(overrides(rows))
    assert (found.start, found.end) == pytest.approx((1.0, 1.13))


def test_an_override_of_nothing_ends_the_one_before() -> None:
    assert inhibitions(overrides([(1.0, 0.5, ("#9",)), (1.2, 0.5, ())])) == [
        InhibitionInterval(1.0, 1.2, ("#9",))
    ]


def test_no_overrides_inhibit_nothing() -> None:
    assert inhibitions(None) == []


@given(ROWS, st.integers(0, 2000))
def test_at_every_moment_the_last_override_within_its_lease_holds(
    rows: list[tuple[int, int, tuple[str, ...]]], moment: int
) -> None:
    # Between the whole numbers, where nothing begins or ends.
    now = moment + 0.5
    times = np.cumsum([row[0] for row in rows]).tolist()
    last = [index for index, time in enumerate(times) if time < now]
    expected: tuple[str, ...] = ()
    if last and now < times[last[-1]] + rows[last[-1]][1]:
        expected = rows[last[-1]][2]
    found = inhibitions(
        overrides([(time, row[1], row[2]) for time, row in zip(times, rows, strict=True)])
    )
    held = [one.muscles for one in found if one.start < now < one.end]
    assert held == ([expected] if expected else [])


def test_intervals_are_cut_at_a_swings_ends() -> None:
    found = [InhibitionInterval(0.0, 1.0, ("a",)), InhibitionInterval(2.0, 3.0, ("b",))]
    assert within(found, 0.5, 2.5) == (
        InhibitionInterval(0.5, 1.0, ("a",)),
        InhibitionInterval(2.0, 2.5, ("b",)),
    )
    assert within(found, 1.0, 2.0) == ()
