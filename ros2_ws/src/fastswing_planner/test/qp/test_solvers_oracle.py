"""The planner's three programs: scipy's solvers find the same, and the KKT conditions hold."""

import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear, nnls

from fastswing_planner.arrays import Matrix, Vector
from fastswing_planner.planning.holding import build_holding, build_nearest_torque
from fastswing_planner.planning.swing import build_swing_step
from fastswing_planner.qp.problem import QuadraticProgram, series
from fastswing_planner.qp.solvers import SOLVERS, ProxSuiteSolver, solver_from

SEED = st.integers(0, 2**32 - 1)
SOLVER = st.sampled_from(list(SOLVERS))
MUSCLES, JOINTS = 10, 5
LOW, HIGH = np.full(MUSCLES, 10.0), np.full(MUSCLES, 200.0)
NEAR_BOUND = 1e-7
MANY = settings(max_examples=5 * settings().max_examples)
TIMED = min(500, 10 * settings().max_examples)
SLOWEST = 0.050  # [s]


def random_weight(rng: np.random.Generator, size: int) -> Matrix:
    """Return a symmetric weight with eigenvalues from 0.1 to 1."""
    turned = np.linalg.qr(rng.normal(size=(size, size)))[0]
    return np.asarray(turned * rng.uniform(0.1, 1.0, size) @ turned.T)


def random_arms(rng: np.random.Generator) -> Matrix:
    return rng.normal(0.0, 0.04, (MUSCLES, JOINTS))


def nearest_torque(seed: int) -> QuadraticProgram:
    """Return the first program of a posture that may be held."""
    rng = np.random.default_rng(seed)
    arms = random_arms(rng)
    torque = -arms.T @ rng.uniform(LOW, HIGH) + rng.normal(0.0, 3.0, JOINTS)
    return build_nearest_torque(arms, torque, LOW, HIGH)


def holding(seed: int) -> QuadraticProgram:
    """Return QP 1 of a posture that can be held."""
    rng = np.random.default_rng(seed)
    arms = random_arms(rng)
    weight = random_weight(rng, MUSCLES)
    return build_holding(arms, -arms.T @ rng.uniform(LOW, HIGH), LOW, HIGH, weight)


def swing_step(seed: int) -> QuadraticProgram:
    """Return QP 2 of a step, from far away to almost there; some muscles must not move one way."""
    rng = np.random.default_rng(seed)
    left = rng.normal(size=JOINTS) * 10.0 ** rng.uniform(-2.0, 0.5)
    lower, upper = rng.uniform(0.0, 0.009, (2, MUSCLES)) * (rng.random((2, MUSCLES)) < 0.9)
    return build_swing_step(random_arms(rng), left, -lower, upper, random_weight(rng, JOINTS))


PROGRAMS = {"nearest torque": nearest_torque, "holding": holding, "swing step": swing_step}
PROGRAM = st.sampled_from(list(PROGRAMS))


def kkt_residuals(problem: QuadraticProgram, x: Vector) -> tuple[float, float]:
    """Return by how much x misses the constraints, and the best multipliers miss stationarity.

    The multipliers of inequalities that x does not meet are zero, so the slackness is exact.
    """
    reached = problem.C @ x
    outside = np.concatenate(
        [np.abs(problem.A @ x - problem.b), problem.lower - reached, reached - problem.upper]
    )
    downward = -problem.C[reached < problem.lower + NEAR_BOUND]
    upward = problem.C[reached > problem.upper - NEAR_BOUND]
    # P x + c + A^T y + C^T z = 0, y of any sign, z >= 0 upward and <= 0 downward
    columns = np.vstack([problem.A, -problem.A, upward, downward]).T
    slope = problem.P @ x + problem.c
    missing = nnls(columns, -slope)[1] if columns.size else float(np.linalg.norm(slope))
    return float(outside.max()), float(missing)


def least_norm(A: Matrix, low: Vector, high: Vector) -> Vector:
    """Return the x of least |x| with low <= A x <= high: least distance programming by NNLS."""
    stacked = np.vstack([np.hstack([A.T, -A.T]), np.concatenate([low, -high])])
    target = np.append(np.zeros(A.shape[1]), 1.0)
    residual = stacked @ nnls(stacked, target)[0] - target
    return np.asarray(-residual[:-1] / residual[-1])


def minimiser_by_nnls(problem: QuadraticProgram) -> Vector:
    """Return the minimiser of a strictly convex program."""
    # With P = R^T R and z = R x + R^-T c the cost is |z|^2 / 2.
    root = np.linalg.cholesky(problem.P).T
    shift = np.linalg.solve(root.T, problem.c)
    rows = np.linalg.solve(root.T, np.vstack([problem.A, problem.C]).T).T
    low = np.concatenate([problem.b, problem.lower]) + rows @ shift
    high = np.concatenate([problem.b, problem.upper]) + rows @ shift
    return np.asarray(np.linalg.solve(root, least_norm(rows, low, high) - shift))


@MANY
@given(SEED, PROGRAM, SOLVER)
def test_the_answer_satisfies_the_kkt_conditions(seed: int, program: str, solver: str) -> None:
    problem = PROGRAMS[program](seed)
    outside, missing = kkt_residuals(problem, solver_from(solver).solve(problem))
    assert outside < 1e-8
    assert missing < 1e-6


@MANY
@given(SEED, st.sampled_from(["holding", "swing step"]), SOLVER)
def test_the_answer_is_the_minimiser_that_nnls_finds(seed: int, program: str, solver: str) -> None:
    problem = PROGRAMS[program](seed)
    answer = solver_from(solver).solve(problem)
    assert answer == pytest.approx(minimiser_by_nnls(problem), abs=1e-6)


@MANY
@given(SEED, SOLVER)
def test_the_nearest_torque_is_the_one_that_bounded_least_squares_reach(
    seed: int, solver: str
) -> None:
    problem = nearest_torque(seed)
    # P = 2 B B^T and c = 2 B t: the cost is |B^T f + t|^2, and B^T f is unique.
    values, vectors = np.linalg.eigh(problem.P / 2.0)
    reach = (vectors[:, -JOINTS:] * np.sqrt(values[-JOINTS:])).T
    target = np.linalg.lstsq(reach.T, -problem.c / 2.0, rcond=None)[0]
    oracle = lsq_linear(reach, target, (problem.lower, problem.upper), method="bvls", tol=1e-14)
    answer = solver_from(solver).solve(problem)
    assert reach @ answer == pytest.approx(reach @ oracle.x, abs=1e-6)


@MANY
@given(st.lists(SEED, min_size=2, max_size=4), SOLVER)
def test_each_step_of_a_series_is_the_minimiser_that_nnls_finds(
    seeds: list[int], solver: str
) -> None:
    steps = series(solver_from(solver))
    for problem in map(swing_step, seeds):
        answer = steps.solve(problem)
        outside, missing = kkt_residuals(problem, answer)
        assert outside < 1e-8
        assert missing < 1e-6
        assert answer == pytest.approx(minimiser_by_nnls(problem), abs=1e-6)


@MANY
@given(SEED)
def test_a_series_of_steps_that_meet_parallel_bounds_is_solved(seed: int) -> None:
    rng = np.random.default_rng(seed)
    arms = np.repeat(random_arms(rng), 4, axis=0)  # each muscle four times
    bound = np.repeat(rng.uniform(0.001, 0.009, MUSCLES), 4)
    steps, remaining = series(ProxSuiteSolver()), rng.normal(size=JOINTS)
    for _ in range(5):
        problem = build_swing_step(arms, remaining, -bound, bound, np.eye(JOINTS))
        answer = steps.solve(problem)
        assert answer == pytest.approx(minimiser_by_nnls(problem), abs=1e-6)
        remaining = remaining - answer


@MANY
@given(SEED, st.sampled_from(["holding", "swing step"]))
def test_both_solvers_find_the_same(seed: int, program: str) -> None:
    problem = PROGRAMS[program](seed)
    first, second = (solver_from(name).solve(problem) for name in SOLVERS)
    assert first == pytest.approx(second, abs=1e-6)


@pytest.mark.parametrize("name", SOLVERS)
@pytest.mark.parametrize("program", PROGRAMS)
def test_no_solve_takes_more_than_50_ms(program: str, name: str) -> None:
    solver = solver_from(name)

    def cpu_time(problem: QuadraticProgram) -> float:
        begin = time.thread_time()
        solver.solve(problem)
        return time.thread_time() - begin

    def best_of_three(problem: QuadraticProgram) -> float:
        took = cpu_time(problem)
        return took if took < SLOWEST else min(took, cpu_time(problem), cpu_time(problem))

    slowest = max(best_of_three(PROGRAMS[program](seed)) for seed in range(TIMED))
    print(f"{program}, {name}: slowest solve {1e3 * slowest:.2f} ms")
    assert slowest < SLOWEST
