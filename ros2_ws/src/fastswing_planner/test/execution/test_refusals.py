"""A swing is refused for muscles that do not obey and for an arm that nobody sees."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastswing_planner.errors import FaultLatched, Interrupted, SwingAborted, SwingStateStale
from fastswing_planner.execution.measurements import MuscleMeasurement
from fastswing_planner.execution.refusals import (
    not_at_start,
    refuse_muscles,
    refuse_stale,
    refuse_stall,
)
from fastswing_planner.execution.settings import ExecutionSettings

times = st.floats(0.0, 1e6)


def muscles(**states: Any) -> MuscleMeasurement:
    return MuscleMeasurement(0.0, np.ones(3), np.zeros(3), np.full(3, 20.0), **states)


@given(times, times)
def test_old_states_are_refused_strictly_above_the_timeout(age: float, timeout: float) -> None:
    if age <= timeout:
        refuse_stale(age, timeout)
        return
    with pytest.raises(SwingStateStale):
        refuse_stale(age, timeout)


@given(times, times)
def test_a_stall_is_refused_strictly_above_the_timeout(stall: float, timeout: float) -> None:
    if stall <= timeout:
        refuse_stall(stall, timeout)
        return
    with pytest.raises(SwingStateStale):
        refuse_stall(stall, timeout)


def test_muscles_that_obey_are_not_refused() -> None:
    refuse_muscles(muscles(holds=4), 4)


@pytest.mark.parametrize("limp", [("#1",), ("#1", "#2")])
def test_muscles_at_zero_current_are_refused_unless_the_inhibitor_may_do_it(
    limp: tuple[str, ...],
) -> None:
    refuse_muscles(muscles(limp=limp), 0, inhibiting=True)
    with pytest.raises(FaultLatched, match="muscles at zero current: #1"):
        refuse_muscles(muscles(limp=limp), 0)


def test_the_inhibitor_never_lets_all_muscles_go() -> None:
    with pytest.raises(FaultLatched):
        refuse_muscles(muscles(limp=("#1", "#2", "#3")), 0, inhibiting=True)


@given(st.integers(0, 9), st.integers(0, 9))
def test_an_arm_that_somebody_held_since_is_refused(before: int, after: int) -> None:
    if before == after:
        return
    with pytest.raises(Interrupted):
        refuse_muscles(muscles(holds=after), before)


@pytest.mark.parametrize("inhibiting", [False, True])
@pytest.mark.parametrize("state", [{"faulty": ("#2",)}, {"driven": ("#2",)}])
def test_faulty_and_driven_muscles_are_always_refused(
    state: dict[str, Any], inhibiting: bool
) -> None:
    with pytest.raises(SwingAborted, match="#2"):
        refuse_muscles(muscles(**state), 0, inhibiting)


def test_an_arm_beside_the_start_is_told_how_far_it_is() -> None:
    error = not_at_start(0.25, ExecutionSettings(start_tolerance=0.08), "rest")
    assert str(error) == (
        "the arm is 0.250 rad from the start posture and must rest within 0.08 rad of it"
    )
