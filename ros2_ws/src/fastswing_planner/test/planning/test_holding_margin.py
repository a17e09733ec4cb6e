"""A held posture stays held with any added torque up to its margin, and the margin is no less."""

from itertools import product
from math import comb

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

from fastswing_planner.arrays import Matrix, Vector
from fastswing_planner.planning import holding_margin as module
from fastswing_planner.planning.holding_margin import holding_margin
from fastswing_planner.qp.solvers import SOLVERS, solver_from

SEED = st.integers(0, 2**32 - 1)
SOLVER = st.sampled_from(list(SOLVERS))
FEW = settings(max_examples=min(25, settings().max_examples))
LOW, HIGH = 10.0, 200.0


def random_arms(seed: int, muscles: int, joints: int) -> tuple[Matrix, Vector]:
    """Return G [m/rad] and tensions [N] well within their limits."""
    rng = np.random.default_rng(seed)
    return rng.normal(0.0, 0.04, (muscles, joints)), rng.uniform(30.0, 180.0, muscles)


def margin(arms: Matrix, tension: Vector, solver: str = "daqp") -> float:
    """Return the margin of the posture that these tensions hold."""
    low, high = np.full(len(arms), LOW), np.full(len(arms), HIGH)
    return holding_margin(solver_from(solver), arms, -arms.T @ tension, low, high, tension)


def reach(arms: Matrix, tension: Vector, direction: Vector) -> float:
    """Return how much torque [N m] can be added in a direction, by a linear program."""
    # maximise s subject to  -G^T f = -G^T f_held + s u,  f^min <= f <= f^max
    count = len(arms)
    answer = linprog(
        np.append(np.zeros(count), -1.0),
        A_eq=np.hstack([-arms.T, -direction[:, np.newaxis]]),
        b_eq=-arms.T @ tension,
        bounds=[(LOW, HIGH)] * count + [(0.0, None)],
        method="highs",
    )
    assert answer.status == 0
    return float(answer.x[-1])


def nearest_face(arms: Matrix, tension: Vector) -> tuple[float, Vector]:
    """Return the distance [N m] to the boundary and the direction of the nearest point on it.

    The boundary is Qhull's hull of the torques of all corners of the tension limits.
    """
    corners = np.array(list(product((LOW, HIGH), repeat=len(arms))))
    faces = ConvexHull(-corners @ arms).equations  # n^T t + b <= 0 inside
    distances = -(faces[:, :-1] @ (-arms.T @ tension) + faces[:, -1])
    nearest = int(distances.argmin())
    return float(distances[nearest]), faces[nearest, :-1]


SHAPES = st.sampled_from([(3, 1), (4, 2), (6, 3), (10, 5), (5, 5)])


@FEW
@given(SEED, SHAPES)
def test_a_torque_within_the_margin_is_held_in_any_direction(
    seed: int, shape: tuple[int, int]
) -> None:
    arms, tension = random_arms(seed, *shape)
    directions = np.random.default_rng(seed).normal(size=(10, shape[1]))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    reached = min(reach(arms, tension, direction) for direction in directions)
    assert reached >= 0.999 * margin(arms, tension)


@FEW
@given(SEED, st.sampled_from([(4, 2), (6, 3), (8, 4), (9, 5), (5, 5)]))
def test_a_torque_beyond_the_margin_is_not_held_in_some_direction(
    seed: int, shape: tuple[int, int]
) -> None:
    arms, tension = random_arms(seed, *shape)
    distance, direction = nearest_face(arms, tension)
    assert margin(arms, tension) == pytest.approx(distance, abs=1e-7)
    assert reach(arms, tension, direction) <= 1.001 * margin(arms, tension)


def test_the_margin_of_one_joint_is_the_nearer_end() -> None:
    # -G^T f of 0.04 (f_b - f_a) reaches from -7.6 to 7.6 N m; 3 N m are held.
    arms = np.array([[0.04], [-0.04]])
    assert margin(arms, np.array([20.0, 95.0])) == pytest.approx(4.6, abs=1e-9)


def test_the_margin_does_not_depend_on_which_tensions_hold() -> None:
    arms = np.array([[0.04], [-0.04]])
    assert margin(arms, np.array([100.0, 175.0])) == pytest.approx(4.6, abs=1e-9)


def test_a_posture_at_the_boundary_has_no_margin() -> None:
    arms, _ = random_arms(7, 6, 3)
    outward = np.where(arms @ np.ones(3) > 0.0, LOW, HIGH)
    assert margin(arms, outward) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("muscles", [2, 4, 30])
def test_a_joint_that_no_muscle_moves_leaves_no_margin(muscles: int) -> None:
    arms, tension = random_arms(3, muscles, 2)
    arms[:, 1] = 2.0 * arms[:, 0]
    assert margin(arms, tension) == 0.0


def test_fewer_muscles_than_joints_leave_no_margin() -> None:
    assert margin(*random_arms(3, 2, 3)) == 0.0


def test_no_muscles_leave_no_margin() -> None:
    assert margin(np.zeros((0, 2)), np.zeros(0)) == 0.0


# ---- more faces than are enumerated: a lower bound -----------------------------------------------

MANY = (22, 5)


def test_22_muscles_and_5_joints_are_too_many_faces() -> None:
    assert comb(MANY[0], MANY[1] - 1) > module._MOST_FACES


@FEW
@given(SEED, SOLVER)
def test_the_bound_is_a_good_part_of_the_exact_margin_and_no_more(seed: int, solver: str) -> None:
    arms, tension = random_arms(seed, *MANY)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "_MOST_FACES", 10_000)
        exact = margin(arms, tension)
    assert 0.1 * exact < margin(arms, tension, solver) <= 1.000001 * exact


@FEW
@given(SEED)
def test_a_torque_within_the_bound_is_held_in_any_direction(seed: int) -> None:
    arms, tension = random_arms(seed, *MANY)
    directions = np.random.default_rng(seed).normal(size=(5, MANY[1]))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    reached = min(reach(arms, tension, direction) for direction in directions)
    assert reached >= 0.999 * margin(arms, tension)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("arm", [0.0, 1e-17, 1e-9])
def test_a_muscle_without_moment_arm_does_not_change_the_bound(solver: str, arm: float) -> None:
    arms, tension = random_arms(5, *MANY)
    alone = margin(arms, tension, solver)
    for held in (LOW, 100.0, HIGH):
        together = np.vstack([arms, np.full(MANY[1], arm)])
        with_idle = margin(together, np.append(tension, held), solver)
        assert with_idle == pytest.approx(alone, rel=1e-3)
