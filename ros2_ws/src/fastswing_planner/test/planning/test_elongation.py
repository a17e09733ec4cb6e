"""What a masked muscle is paid out before the swing is what it cannot pay out during it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fastswing_planner.arrays import BoolVector, Matrix, frozen
from fastswing_planner.planning.elongation import elongation, fastest_payout
from fastswing_planner.planning.swing import Trajectory
from fastswing_planner.robot.limits import MuscleLimits, muscle_limits

MUSCLES = ("a", "b", "c")
TIME_STEP = 0.03
SEED = st.integers(0, 2**32 - 1)


def swing_of(lengths: Matrix) -> Trajectory:
    """Return a trajectory with these muscle lengths [m], shape (k + 1, m)."""
    count = len(lengths)
    return Trajectory(
        time=frozen(TIME_STEP * np.arange(count)),
        joint_position=np.zeros((count, 1)),
        joint_velocity=np.zeros((count, 1)),
        muscle_length=lengths,
        muscle_velocity=np.zeros_like(lengths),
        at_limit=np.zeros(lengths.shape, dtype=bool),
    )


def random_case(seed: int) -> tuple[Trajectory, MuscleLimits, BoolVector]:
    """Return a swing of up to 20 steps, some muscles faster than they can pay out."""
    rng = np.random.default_rng(seed)
    steps = rng.normal(0.005, 0.02, (int(rng.integers(0, 21)), 3))
    lengths = np.vstack([rng.uniform(0.1, 0.3, 3), steps]).cumsum(axis=0)
    limits = muscle_limits(MUSCLES, rng.uniform(0.1, 0.4, 3), rng.uniform(0.2, 20.0, 3), 10, 200)
    return swing_of(lengths), limits, rng.random(3) < 0.4


def elongation_by_hand(lengths: list[float], limit: float, alpha: float) -> float:
    """Follow one muscle step by step: how far its path runs ahead of the fastest payout."""
    speed = paid_out = largest = 0.0
    for length in lengths[1:]:
        speed = min(speed + alpha * TIME_STEP, limit)
        paid_out += speed * TIME_STEP
        largest = max(largest, length - lengths[0] - paid_out)
    return largest


@given(SEED)
def test_it_is_what_following_each_muscle_by_hand_gives(seed: int) -> None:
    trajectory, limits, kept = random_case(seed)
    expected = [
        0.0 if keep else elongation_by_hand(column.tolist(), float(speed), float(alpha))
        for keep, column, speed, alpha in zip(
            kept, trajectory.muscle_length.T, limits.velocity, limits.acceleration, strict=True
        )
    ]
    assert elongation(trajectory, limits, kept) == pytest.approx(expected, abs=1e-12)


@given(SEED)
def test_it_is_never_negative(seed: int) -> None:
    assert np.all(elongation(*random_case(seed)) >= 0.0)


@given(SEED)
def test_it_is_zero_for_kept_muscles(seed: int) -> None:
    trajectory, limits, kept = random_case(seed)
    assert not elongation(trajectory, limits, kept)[kept].any()


@given(SEED)
def test_it_suffices_at_every_step_of_the_swing(seed: int) -> None:
    trajectory, limits, _ = random_case(seed)
    ahead = elongation(trajectory, limits, np.zeros(3, dtype=bool))
    payout = fastest_payout(limits, len(trajectory.time) - 1, TIME_STEP)
    needed = trajectory.muscle_length - trajectory.muscle_length[0]
    assert np.all(ahead + payout >= needed - 1e-12)


def test_a_muscle_that_shortens_needs_none() -> None:
    lengths = np.outer(np.linspace(0.3, 0.1, 11), np.ones(3))
    limits = muscle_limits(MUSCLES, 0.3, 0.46, 10, 200)
    none_kept = np.zeros(3, dtype=bool)
    assert elongation(swing_of(lengths), limits, none_kept).tolist() == [0.0, 0.0, 0.0]


def test_a_swing_of_no_step_needs_none() -> None:
    limits = muscle_limits(MUSCLES, 0.3, 0.46, 10, 200)
    none_kept = np.zeros(3, dtype=bool)
    assert elongation(swing_of(np.full((1, 3), 0.2)), limits, none_kept).tolist() == [0.0] * 3


def test_the_lead_counts_even_if_the_muscle_returns() -> None:
    # 0.1 m ahead in one step, of which the payout makes 0.03 s * 0.0138 m/s; then back.
    lengths = np.array([[0.2] * 3, [0.3] * 3, [0.2] * 3])
    limits = muscle_limits(MUSCLES, 0.3, 0.46, 10, 200)
    needed = elongation(swing_of(lengths), limits, np.zeros(3, dtype=bool))
    assert needed == pytest.approx([0.1 - 0.03 * 0.0138] * 3)


def test_the_fastest_payout_is_the_ramps_closed_form() -> None:
    # Speeding up for 0.30 / 0.0138 = 21.7 steps: the sum of the first k speeds is
    # alpha dt k (k + 1) / 2 up to step 21, then each step adds 0.3 m/s.
    limits = muscle_limits(("a",), 0.30, 0.46, 10, 200)
    expected = [
        0.03 * (0.0138 * min(k, 21) * (min(k, 21) + 1) / 2 + 0.30 * max(k - 21, 0))
        for k in range(41)
    ]
    assert fastest_payout(limits, 40, 0.03)[:, 0] == pytest.approx(expected, abs=1e-12)
