"""The simulated swing goes as fast as the kept muscles allow, and no faster."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize

from fastswing_planner.arrays import BoolVector, Matrix, Vector
from fastswing_planner.errors import SwingBlocked
from fastswing_planner.planning.ramp import velocity_bounds
from fastswing_planner.planning.swing import (
    SwingSettings,
    Trajectory,
    build_swing_step,
    simulate_swing,
)
from fastswing_planner.qp.problem import QuadraticProgram
from fastswing_planner.qp.solvers import ProxSuiteSolver
from fastswing_planner.robot.description import Robot
from fastswing_planner.robot.limits import MuscleLimits, muscle_limits
from fastswing_planner.robot.muscle_model import MuscleModel

ArmBuilder = Callable[..., MuscleModel]
SEED = st.integers(0, 2**32 - 1)
ONE_JOINT = np.array([[0.1], [-0.06]])
FINE = SwingSettings(epsilon=1e-3)


class Idle:
    """Answers that nothing moves."""

    def solve(self, problem: QuadraticProgram) -> Vector:
        return np.zeros(problem.c.size)


def limits_of(model: MuscleModel, acceleration: float = 0.46) -> MuscleLimits:
    return muscle_limits(model.muscle_names, 0.3, acceleration, 10.0, 200.0)


def swing(
    model: MuscleModel,
    start: list[float],
    end: list[float],
    masked: tuple[int, ...] = (),
    acceleration: float = 0.46,
    settings: SwingSettings = FINE,
) -> Trajectory:
    """Simulate a swing with the muscles of the indices `masked` masked."""
    kept = ~np.isin(np.arange(len(model.muscle_names)), masked)
    limits = limits_of(model, acceleration)
    ends = np.array(start), np.array(end)
    return simulate_swing(model, ProxSuiteSolver(), *ends, limits, kept, settings)


def random_step(seed: int) -> tuple[Matrix, Vector, Vector, Vector, Matrix]:
    """Return G (5, 3), remaining, bounds that allow standing still, and W2."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(3, 3))
    return (
        rng.uniform(-0.1, 0.1, (5, 3)),
        rng.normal(size=3),
        -rng.uniform(0.0, 0.009, 5),
        rng.uniform(0.0, 0.009, 5),
        root @ root.T / 3.0 + np.eye(3),
    )


def distance_cost(step: Vector, remaining: Vector, weight: Matrix) -> float:
    return float((remaining - step) @ weight @ (remaining - step))


@given(SEED)
def test_a_step_comes_as_near_as_slsqp(seed: int) -> None:
    jacobian, remaining, lower, upper, weight = random_step(seed)
    step = ProxSuiteSolver().solve(build_swing_step(*random_step(seed)))
    oracle = minimize(
        lambda x: distance_cost(x, remaining, weight),
        np.zeros(3),
        jac=lambda x: -2.0 * weight @ (remaining - x),
        method="SLSQP",
        constraints=[
            {"type": "ineq", "fun": lambda x: 100.0 * (upper - jacobian @ x)},
            {"type": "ineq", "fun": lambda x: 100.0 * (jacobian @ x - lower)},
        ],
        options={"ftol": 1e-14, "maxiter": 500},
    )
    assert step == pytest.approx(oracle.x, abs=1e-4)


@given(SEED)
def test_a_step_stays_within_the_bounds(seed: int) -> None:
    jacobian, _, lower, upper, _ = random_step(seed)
    moved = jacobian @ ProxSuiteSolver().solve(build_swing_step(*random_step(seed)))
    assert np.all((lower - 1e-9 <= moved) & (moved <= upper + 1e-9))


@given(SEED)
def test_the_programs_cost_is_the_weighted_distance(seed: int) -> None:
    _, remaining, _, _, weight = random_step(seed)
    problem = build_swing_step(*random_step(seed))
    x = np.random.default_rng(seed).normal(size=3)
    cost = x @ problem.P @ x / 2 + problem.c @ x
    nowhere = distance_cost(np.zeros(3), remaining, weight)
    assert cost + nowhere == pytest.approx(distance_cost(x, remaining, weight), abs=1e-9)


def steps_by_hand(distance: float, acceleration: float, epsilon: float) -> int:
    """Count the steps of one joint whose faster muscle has a moment arm of 0.1 m.

    After k steps that speed up, the path is alpha dt^2 k (k + 1) / 2; then 0.3 m/s * dt a step.
    """
    count, path = 0, 0.0
    while 0.1 * distance - path >= 0.1 * epsilon:
        count += 1
        path += min(acceleration * 0.03 * count, 0.3) * 0.03
    return count


@pytest.mark.parametrize("distance", [0.02, 0.1, 0.7, 1.3, 2.0, -1.3])
@pytest.mark.parametrize("acceleration", [0.1, 0.46, 5.0, np.inf])
def test_one_joint_takes_the_textbooks_number_of_steps(
    linear_arm: ArmBuilder, distance: float, acceleration: float
) -> None:
    trajectory = swing(linear_arm(ONE_JOINT), [0.0], [distance], acceleration=acceleration)
    assert len(trajectory.time) - 1 == steps_by_hand(abs(distance), acceleration, 1e-3)


def test_without_a_ramp_one_joint_turns_at_the_limit_over_the_arm(linear_arm: ArmBuilder) -> None:
    # 0.3 m/s / 0.1 m = 3 rad/s, so 0.09 rad a step: 1.0 rad in 11.1 steps.
    trajectory = swing(linear_arm(ONE_JOINT), [0.0], [1.0], acceleration=np.inf)
    assert trajectory.joint_velocity[1:12, 0] == pytest.approx([3.0] * 11, abs=1e-6)
    assert trajectory.time_cost == pytest.approx(12 * 0.03)


def test_masking_the_fastest_muscle_leaves_the_next_one_in_charge(linear_arm: ArmBuilder) -> None:
    trajectory = swing(linear_arm(ONE_JOINT), [0.0], [1.0], masked=(0,), acceleration=np.inf)
    # 0.3 m/s / 0.06 m
    assert trajectory.joint_velocity.max() == pytest.approx(5.0, abs=1e-6)


def test_with_all_muscles_masked_one_step_is_enough(linear_arm: ArmBuilder) -> None:
    assert len(swing(linear_arm(ONE_JOINT), [0.0], [1.0], masked=(0, 1)).time) == 2


def test_a_swing_shorter_than_epsilon_takes_no_step(linear_arm: ArmBuilder) -> None:
    assert swing(linear_arm(ONE_JOINT), [0.0], [5e-4]).time_cost == 0.0


def random_swing(arm: ArmBuilder, seed: int) -> tuple[MuscleModel, Trajectory, BoolVector, Vector]:
    """Return an arm of 2 joints and 5 muscles, its swing, the mask and the end."""
    rng = np.random.default_rng(seed)
    model = arm(rng.uniform(-0.1, 0.1, (5, 2)))
    end = rng.uniform(-1.0, 1.0, 2)
    masked = tuple(np.flatnonzero(rng.random(5) < 0.3).tolist())
    trajectory = swing(model, [0.0, 0.0], end.tolist(), masked)
    return model, trajectory, ~np.isin(np.arange(5), masked), end


@given(SEED)
def test_a_swing_ends_within_epsilon_and_not_before(linear_arm: ArmBuilder, seed: int) -> None:
    _, trajectory, _, end = random_swing(linear_arm, seed)
    far = np.linalg.norm(trajectory.joint_position - end, axis=1) >= FINE.epsilon
    assert far.tolist() == [True] * (len(far) - 1) + [False]


@given(SEED)
def test_a_swing_comes_nearer_with_every_step(linear_arm: ArmBuilder, seed: int) -> None:
    _, trajectory, _, end = random_swing(linear_arm, seed)
    assert np.all(np.diff(np.linalg.norm(trajectory.joint_position - end, axis=1)) <= 1e-9)


@given(SEED)
def test_no_kept_muscle_leaves_its_ramp(linear_arm: ArmBuilder, seed: int) -> None:
    model, trajectory, kept, _ = random_swing(linear_arm, seed)
    limits = limits_of(model)
    for before, after in zip(
        trajectory.muscle_velocity[:-1], trajectory.muscle_velocity[1:], strict=True
    ):
        lower, upper = velocity_bounds(before, limits.velocity, limits.acceleration, 0.03)
        assert np.all((lower - 1e-6 <= after)[kept])
        assert np.all((after <= upper + 1e-6)[kept])


@given(SEED)
def test_the_columns_of_a_trajectory_agree(linear_arm: ArmBuilder, seed: int) -> None:
    model, trajectory, _, _ = random_swing(linear_arm, seed)
    turned = np.diff(trajectory.joint_position, axis=0)
    assert trajectory.joint_velocity[1:] * 0.03 == pytest.approx(turned, abs=1e-12)
    assert trajectory.muscle_length[-1] == pytest.approx(
        model.lengths(trajectory.joint_position[-1])
    )
    lengthened = np.diff(trajectory.muscle_length, axis=0)
    assert trajectory.muscle_velocity[1:] * 0.03 == pytest.approx(lengthened, abs=1e-12)


@given(SEED)
def test_time_counts_in_steps_from_zero(linear_arm: ArmBuilder, seed: int) -> None:
    _, trajectory, _, _ = random_swing(linear_arm, seed)
    assert trajectory.time == pytest.approx(0.03 * np.arange(len(trajectory.joint_position)))


def test_the_start_is_at_rest(linear_arm: ArmBuilder) -> None:
    trajectory = swing(linear_arm(ONE_JOINT), [0.2], [1.0])
    assert trajectory.joint_position[0].tolist() == [0.2]
    assert trajectory.joint_velocity[0].tolist() == [0.0]
    assert trajectory.muscle_velocity[0].tolist() == [0.0, 0.0]


def test_a_trajectory_cannot_be_written(linear_arm: ArmBuilder) -> None:
    columns = vars(swing(linear_arm(ONE_JOINT), [0.0], [0.5])).values()
    assert not any(column.flags.writeable for column in columns)


def test_the_weight_lets_one_joint_go_first(linear_arm: ArmBuilder) -> None:
    # One muscle bounds dtheta_0 + dtheta_1: the light joint makes way for the heavy one, so that
    # the unweighted distance grows at first.
    model = linear_arm([[0.1, 0.1]])
    kept, weight = np.ones(1, dtype=bool), np.diag([100.0, 1.0])
    trajectory = simulate_swing(
        model, ProxSuiteSolver(), np.zeros(2), np.ones(2), limits_of(model), kept, FINE, weight
    )
    arrived = (np.abs(trajectory.joint_position - 1.0) < 0.02).argmax(axis=0)
    assert 0 < arrived[0] < arrived[1]


def test_a_swing_of_as_many_steps_as_allowed_is_allowed(musashi: Robot) -> None:
    settings = SwingSettings(max_steps=33)
    start, end = (musashi.postures[name].tolist() for name in ("start", "end"))
    assert len(swing(musashi.model, start, end, settings=settings).time) == 34


def test_a_swing_that_takes_too_long_names_joints_and_muscles(linear_arm: ArmBuilder) -> None:
    with pytest.raises(SwingBlocked) as caught:
        swing(linear_arm(ONE_JOINT), [0.0], [1.0], settings=SwingSettings(max_steps=5))
    # 15 ramp steps of 0.46 * 0.03^2 m, over 0.1 m: 0.0621 rad of 1 rad.
    assert str(caught.value) == (
        "the swing stops short of its end after 5 steps: j0 by +0.938 rad; blocking muscles: m0"
    )


def test_a_swing_without_progress_stops_early(linear_arm: ArmBuilder) -> None:
    model = linear_arm(np.eye(2) / 10.0)
    with pytest.raises(SwingBlocked) as caught:
        simulate_swing(
            model,
            Idle(),
            np.zeros(2),
            np.array([0.5, -0.25]),
            limits_of(model),
            np.ones(2, dtype=bool),
            SwingSettings(),
        )
    assert str(caught.value) == (
        "the swing stops short of its end after 10 steps: "
        "j0 by +0.500 rad, j1 by -0.250 rad; blocking muscles: none"
    )
