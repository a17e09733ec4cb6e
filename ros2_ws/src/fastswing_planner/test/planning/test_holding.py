"""Holding a posture: the verdict is a linear program's, the tensions are the least."""

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.optimize import linprog, lsq_linear, minimize

from fastswing_planner.arrays import BoolVector, Matrix, Vector
from fastswing_planner.errors import HoldingUndecided, SolverFailed
from fastswing_planner.planning.holding import build_holding, build_nearest_torque, hold
from fastswing_planner.qp.problem import QpUnsolved, QuadraticProgram
from fastswing_planner.qp.solvers import ProxSuiteSolver
from fastswing_planner.robot.limits import MuscleLimits, muscle_limits

SEED = st.integers(0, 2**32 - 1)
MUSCLES = ("a", "b", "c", "d", "e", "f")
PULLEY = np.array([[0.04], [-0.04]])
BOTH = np.ones(2, dtype=bool)


def paper_limits(count: int) -> MuscleLimits:
    return muscle_limits(MUSCLES[:count], 0.3, 0.46, 10.0, 200.0)


def random_arm(seed: int) -> tuple[Matrix, Vector, BoolVector]:
    """Return G of 6 muscles and 2 joints, a torque that may be held, and a mask."""
    rng = np.random.default_rng(seed)
    jacobian = rng.uniform(-0.06, 0.06, (6, 2))
    kept = rng.random(6) < 0.7
    torque = -jacobian[kept].T @ rng.uniform(10.0, 200.0, int(kept.sum()))
    return jacobian, torque * rng.choice([1.0, 1.5, 3.0]) + rng.uniform(-2.0, 2.0, 2), kept


def missing_torque(jacobian: Matrix, torque: Vector, kept: BoolVector) -> float:
    """Return the least |G^T f + tau| [N m] within the tension limits."""
    if not kept.any():
        return float(np.linalg.norm(torque))
    nearest = lsq_linear(jacobian[kept].T, -torque, (10.0, 200.0), tol=1e-14)
    return float(np.sqrt(2.0 * nearest.cost))


def is_held_says_linprog(jacobian: Matrix, torque: Vector, kept: BoolVector) -> bool:
    arms = jacobian[kept]
    answer = linprog(np.zeros(len(arms)), A_eq=arms.T, b_eq=-torque, bounds=(10.0, 200.0))
    assert answer.status in (0, 2)
    return bool(answer.status == 0)


def least_tension(jacobian: Matrix, torque: Vector, weight: Matrix) -> Vector:
    """Return what SLSQP finds to minimise f^T W1 f while it holds the torque."""
    answer = minimize(
        lambda f: f @ weight @ f / 1e4,
        np.full(len(jacobian), 100.0),
        jac=lambda f: 2.0 * weight @ f / 1e4,
        method="SLSQP",
        bounds=[(10.0, 200.0)] * len(jacobian),
        constraints={"type": "eq", "fun": lambda f: jacobian.T @ f + torque},
        options={"ftol": 1e-13, "maxiter": 500},
    )
    return np.asarray(answer.x)


class Unsolving:
    """Solves as ProxSuite does up to a number of problems, then fails."""

    def __init__(self, undecided: bool, solved: int = 0) -> None:
        self._solver, self._undecided, self._left = ProxSuiteSolver(), undecided, solved

    def solve(self, problem: QuadraticProgram) -> Vector:
        if not self._left:
            raise QpUnsolved("OUT_OF_ORDER", problem, self._undecided)
        self._left -= 1
        return self._solver.solve(problem)


class Sloppy(ProxSuiteSolver):
    """Answers problems with equalities by their lower bounds."""

    def solve(self, problem: QuadraticProgram) -> Vector:
        return problem.lower if problem.b.size else super().solve(problem)


@given(SEED)
def test_the_verdict_is_that_of_a_linear_program(seed: int) -> None:
    jacobian, torque, kept = random_arm(seed)
    assume(kept.any())
    # Between "held" and this far from it, the tolerances of both solvers decide.
    assume(not 1e-7 < missing_torque(jacobian, torque, kept) < 1e-3)
    verdict = hold(ProxSuiteSolver(), jacobian, torque, paper_limits(6), kept).feasible
    assert verdict == is_held_says_linprog(jacobian, torque, kept)


@given(SEED)
def test_the_residual_is_the_distance_to_feasibility(seed: int) -> None:
    jacobian, torque, kept = random_arm(seed)
    holding = hold(ProxSuiteSolver(), jacobian, torque, paper_limits(6), kept)
    missing = missing_torque(jacobian, torque, kept)
    assert holding.residual == pytest.approx(missing, abs=2e-4)


@given(SEED)
def test_the_tensions_are_the_least_that_hold(seed: int) -> None:
    jacobian, torque, kept = random_arm(seed)
    holding = hold(ProxSuiteSolver(), jacobian, torque, paper_limits(6), kept)
    assume(holding.feasible and kept.sum() > 2)
    least = least_tension(jacobian[kept], torque, np.eye(int(kept.sum())))
    assert holding.tension[kept] == pytest.approx(least, abs=0.02)


@given(SEED)
def test_the_weight_decides_who_pulls(seed: int) -> None:
    jacobian, torque, kept = random_arm(seed)
    root = np.random.default_rng(seed).normal(size=(6, 6))
    weight = root @ root.T / 6.0 + np.eye(6)
    holding = hold(ProxSuiteSolver(), jacobian, torque, paper_limits(6), kept, weight)
    assume(holding.feasible and kept.sum() > 2)
    least = least_tension(jacobian[kept], torque, weight[np.ix_(kept, kept)])
    assert holding.tension[kept] == pytest.approx(least, abs=0.02)


@given(SEED)
def test_tensions_stay_within_their_limits(seed: int) -> None:
    jacobian, torque, kept = random_arm(seed)
    tension = hold(ProxSuiteSolver(), jacobian, torque, paper_limits(6), kept).tension
    assert np.all((tension[kept] >= 10.0) & (tension[kept] <= 200.0))


@given(SEED)
def test_a_masked_muscle_carries_no_tension(seed: int) -> None:
    jacobian, torque, kept = random_arm(seed)
    tension = hold(ProxSuiteSolver(), jacobian, torque, paper_limits(6), kept).tension
    assert tension[~kept].tolist() == [0.0] * int((~kept).sum())


@given(SEED)
def test_a_held_posture_is_in_balance(seed: int) -> None:
    jacobian, torque, kept = random_arm(seed)
    holding = hold(ProxSuiteSolver(), jacobian, torque, paper_limits(6), kept)
    assume(holding.feasible)
    assert -jacobian.T @ holding.tension == pytest.approx(torque, abs=2e-4)


def test_a_muscle_pulls_against_its_moment_arm() -> None:
    # tau = -G^T f: 3 N m = 0.04 m (f_b - f_a), and the least f_a is 10 N.
    holding = hold(ProxSuiteSolver(), PULLEY, np.array([3.0]), paper_limits(2), BOTH)
    assert holding.tension == pytest.approx([10.0, 85.0], abs=1e-3)


def test_masking_can_make_a_posture_holdable() -> None:
    # 7.8 N m need 195 N of #b, but with the 10 N that #a pulls at least, 205 N.
    torque, limits = np.array([7.8]), paper_limits(2)
    only_b = np.array([False, True])
    assert not hold(ProxSuiteSolver(), PULLEY, torque, limits, BOTH).feasible
    assert hold(ProxSuiteSolver(), PULLEY, torque, limits, only_b).feasible


def test_without_muscles_only_a_weightless_arm_holds() -> None:
    nobody, limits = ~BOTH, paper_limits(2)
    assert hold(ProxSuiteSolver(), PULLEY, np.zeros(1), limits, nobody).feasible
    assert not hold(ProxSuiteSolver(), PULLEY, np.ones(1), limits, nobody).feasible


def test_without_muscles_the_whole_torque_is_missing() -> None:
    assert hold(ProxSuiteSolver(), PULLEY, np.array([-3.0]), paper_limits(2), ~BOTH).residual == 3.0


@pytest.mark.parametrize("beyond", [0.0, 1e-7, 1e-6, 1e-5, 5e-5])
def test_a_posture_at_the_very_limit_is_held(beyond: float) -> None:
    # 0.04 m (200 N - 10 N) = 7.6 N m is the most; less than 1e-4 N m beyond counts as held.
    torque = np.array([7.6 + beyond])
    assert hold(ProxSuiteSolver(), PULLEY, torque, paper_limits(2), BOTH).feasible


def test_a_joint_without_muscles_and_weight_is_no_obstacle() -> None:
    jacobian, torque = np.array([[0.04, 0.0], [-0.04, 0.0]]), np.array([1.0, 0.0])
    assert hold(ProxSuiteSolver(), jacobian, torque, paper_limits(2), BOTH).feasible


@pytest.mark.parametrize("solved", [0, 1])
def test_an_undecided_problem_is_not_a_no(solved: int) -> None:
    solver = Unsolving(undecided=True, solved=solved)
    with pytest.raises(HoldingUndecided) as caught:
        hold(solver, PULLEY, np.array([3.0]), paper_limits(2), BOTH)
    text = (
        "holding is undecided: the QP of 2 variables was not solved: OUT_OF_ORDER; "
        "try the other solver"
    )
    assert str(caught.value) == text


def test_a_solver_that_denies_is_not_believed() -> None:
    solver = Unsolving(undecided=False, solved=1)
    with pytest.raises(SolverFailed) as caught:
        hold(solver, PULLEY, np.array([3.0]), paper_limits(2), BOTH)
    assert (
        str(caught.value)
        == "the QP of 2 variables was not solved: OUT_OF_ORDER; try the other solver"
    )


def test_an_answer_that_does_not_hold_is_not_believed() -> None:
    with pytest.raises(SolverFailed) as caught:
        hold(Sloppy(), PULLEY, np.array([3.0]), paper_limits(2), BOTH)
    assert str(caught.value) == "the holding QP was reported solved, but misses 3 N m"


@given(SEED)
def test_the_nearest_torque_problem_is_the_squared_residual(seed: int) -> None:
    jacobian, torque, _ = random_arm(seed)
    low, high = np.full(6, 10.0), np.full(6, 200.0)
    problem = build_nearest_torque(jacobian, torque, low, high)
    first, second = np.random.default_rng(seed).uniform(10.0, 200.0, (2, 6))

    def cost(tension: Vector) -> float:
        x = tension / 100.0
        return float(x @ problem.P @ x / 2 + problem.c @ x)

    def residual(tension: Vector) -> float:
        return float(np.sum((jacobian.T @ tension + torque) ** 2))

    # One unit of the scaled cost is (4 N m)^2.
    expected = (residual(first) - residual(second)) / 16.0
    assert cost(first) - cost(second) == pytest.approx(expected, abs=1e-9)


@given(SEED)
def test_the_holding_problems_rows_say_the_balance(seed: int) -> None:
    jacobian, torque, _ = random_arm(seed)
    problem = build_holding(jacobian, torque, np.full(6, 10.0), np.full(6, 200.0), np.eye(6))
    tension = np.random.default_rng(seed).uniform(10.0, 200.0, 6)
    imbalance = 4.0 * (problem.A @ (tension / 100.0) - problem.b)
    assert imbalance == pytest.approx(-jacobian.T @ tension - torque, abs=1e-12)
