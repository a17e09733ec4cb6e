"""The single-shunt ramp is what the paper prints, mirrored for the other direction."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from fastswing_planner.planning.ramp import velocity_bounds

SPEED = st.floats(-0.5, 0.5)
LIMIT = st.floats(0.01, 0.5)
ALPHA = st.floats(0.01, 50.0)
STEP = st.floats(0.001, 0.1)


def bounds(velocity: float, limit: float, alpha: float, time_step: float) -> tuple[float, float]:
    lower, upper = velocity_bounds(
        np.array([velocity]), np.array([limit]), np.array([alpha]), time_step
    )
    return float(lower[0]), float(upper[0])


@given(SPEED, LIMIT, ALPHA, STEP)
def test_stopping_is_always_allowed(v: float, limit: float, alpha: float, dt: float) -> None:
    lower, upper = bounds(v, limit, alpha, dt)
    assert lower <= 0.0 <= upper


@given(SPEED, LIMIT, ALPHA, STEP)
def test_no_bound_is_beyond_the_limit(v: float, limit: float, alpha: float, dt: float) -> None:
    lower, upper = bounds(v, limit, alpha, dt)
    assert -limit <= lower
    assert upper <= limit


@given(SPEED, LIMIT, ALPHA, STEP)
def test_the_other_direction_is_a_mirror(v: float, limit: float, alpha: float, dt: float) -> None:
    lower, upper = bounds(v, limit, alpha, dt)
    assert bounds(-v, limit, alpha, dt) == (-upper, -lower)


@given(st.floats(1e-6, 0.5), LIMIT, ALPHA, STEP)
def test_a_lengthening_muscle_gains_as_in_equation_8(
    v: float, limit: float, alpha: float, dt: float
) -> None:
    assert bounds(v, limit, alpha, dt)[1] == min(v + alpha * dt, limit)


@given(st.floats(1e-6, 0.5), st.floats(0.01, 0.4), STEP)
def test_a_lengthening_muscle_slows_as_in_equation_9(v: float, alpha: float, dt: float) -> None:
    # alpha dt stays below the limit, as in the paper, where eq. 9 needs no cut at -limit.
    assert bounds(v, 0.5, alpha, dt)[0] == min(v - alpha * dt, 0.0)


@given(LIMIT, ALPHA, STEP)
def test_at_rest_both_directions_gain_the_same(limit: float, alpha: float, dt: float) -> None:
    gain = min(alpha * dt, limit)
    assert bounds(0.0, limit, alpha, dt) == (-gain, gain)


@given(st.floats(-0.5, 0.5), LIMIT, STEP)
def test_an_infinite_acceleration_is_no_ramp(v: float, limit: float, dt: float) -> None:
    assert bounds(v, limit, math.inf, dt) == (-limit, limit)


@given(st.floats(-0.3, 0.3), ALPHA, STEP)
def test_a_speed_within_the_limit_may_be_kept(v: float, alpha: float, dt: float) -> None:
    lower, upper = bounds(v, 0.3, alpha, dt)
    assert lower <= v <= upper


@given(SPEED, LIMIT, ALPHA, ALPHA, STEP)
def test_more_acceleration_never_narrows_the_bounds(
    v: float, limit: float, alpha: float, more: float, dt: float
) -> None:
    lower, upper = bounds(v, limit, alpha, dt)
    wider_lower, wider_upper = bounds(v, limit, alpha + more, dt)
    assert wider_lower <= lower
    assert wider_upper >= upper


@given(st.lists(SPEED, min_size=1, max_size=6))
def test_muscles_do_not_bound_each_other(speeds: list[float]) -> None:
    limit, alpha = np.full(len(speeds), 0.3), np.full(len(speeds), 0.46)
    lower, upper = velocity_bounds(np.array(speeds), limit, alpha, 0.03)
    assert list(zip(lower, upper, strict=True)) == [bounds(v, 0.3, 0.46, 0.03) for v in speeds]


def test_the_papers_first_step_gains_alpha_times_dt() -> None:
    assert bounds(0.0, 0.30, 0.46, 0.03) == (-0.0138, 0.0138)
