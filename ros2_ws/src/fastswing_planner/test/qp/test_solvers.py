"""Each solver's answers are the minimisers, and what it cannot solve can be kept."""

import subprocess
import sys
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import lsq_linear, minimize

from fastswing_planner.arrays import Vector
from fastswing_planner.errors import InvalidLimit
from fastswing_planner.qp import solvers as qp_solvers
from fastswing_planner.qp.problem import QpUnsolved, QuadraticProgram, series
from fastswing_planner.qp.solvers import (
    DEFAULT_SOLVER,
    SOLVERS,
    DaqpSolver,
    ProxSuiteSolver,
    solver_from,
)

TINY_BOUND = Path(__file__).parents[1] / "data" / "tiny_bound_swing_step.npz"
SEED = st.integers(0, 2**32 - 1)
SOLVER = st.sampled_from(list(SOLVERS))
each_solver = pytest.mark.parametrize("name", SOLVERS)


def hasty(name: str) -> ProxSuiteSolver | DaqpSolver:
    """Return a solver that gives up after one iteration."""
    solver = solver_from(name)
    assert isinstance(solver, ProxSuiteSolver | DaqpSolver)
    solver.max_iterations = 1
    return solver


def random_program(seed: int) -> QuadraticProgram:
    """Return a strictly convex program of 4 variables with a known feasible point."""
    rng = np.random.default_rng(seed)
    root, A, C = rng.normal(size=(4, 4)), rng.normal(size=(1, 4)), rng.normal(size=(5, 4))
    inside = rng.normal(size=4)
    return QuadraticProgram(
        P=root @ root.T + np.eye(4),
        c=3.0 * rng.normal(size=4),
        A=A,
        b=A @ inside,
        C=C,
        lower=C @ inside - rng.uniform(0.0, 1.0, 5),
        upper=C @ inside + rng.uniform(0.0, 1.0, 5),
    )


def cost(problem: QuadraticProgram, x: Vector) -> float:
    return float(x @ problem.P @ x / 2 + problem.c @ x)


def box_program(limit: float) -> QuadraticProgram:
    """Return min (x - 3)^2 / 2 + (y + 3)^2 / 2 in the box of half-width `limit`."""
    return QuadraticProgram(
        P=np.eye(2),
        c=np.array([-3.0, 3.0]),
        A=np.zeros((0, 2)),
        b=np.zeros(0),
        C=np.eye(2),
        lower=np.full(2, -limit),
        upper=np.full(2, limit),
    )


@given(SEED, SOLVER)
def test_the_answer_is_the_minimiser_that_slsqp_finds(seed: int, name: str) -> None:
    problem = random_program(seed)
    oracle = minimize(
        lambda x: cost(problem, x),
        np.zeros(4),
        jac=lambda x: problem.P @ x + problem.c,
        method="SLSQP",
        constraints=[
            {"type": "eq", "fun": lambda x: problem.A @ x - problem.b},
            {"type": "ineq", "fun": lambda x: problem.upper - problem.C @ x},
            {"type": "ineq", "fun": lambda x: problem.C @ x - problem.lower},
        ],
        options={"ftol": 1e-12, "maxiter": 500},
    )
    assert solver_from(name).solve(problem) == pytest.approx(oracle.x, abs=1e-5)


@given(SEED, SOLVER)
def test_the_answer_keeps_every_constraint(seed: int, name: str) -> None:
    problem = random_program(seed)
    x = solver_from(name).solve(problem)
    assert pytest.approx(problem.b, abs=1e-7) == problem.A @ x
    assert np.all(problem.C @ x >= problem.lower - 1e-7)
    assert np.all(problem.C @ x <= problem.upper + 1e-7)


@given(st.lists(SEED, min_size=2, max_size=4), SOLVER)
def test_an_answer_does_not_depend_on_the_problems_before(seeds: list[int], name: str) -> None:
    used = solver_from(name)
    answers = [used.solve(random_program(seed)) for seed in seeds]
    fresh = solver_from(name).solve(random_program(seeds[-1]))
    assert answers[-1] == pytest.approx(fresh, abs=1e-8)


@each_solver
def test_a_program_without_constraints_is_solved(name: str) -> None:
    empty = np.zeros((0, 2))
    problem = QuadraticProgram(
        2.0 * np.eye(2), np.array([-2.0, 4.0]), empty, np.zeros(0), empty, np.zeros(0), np.zeros(0)
    )
    assert solver_from(name).solve(problem) == pytest.approx([1.0, -2.0], abs=1e-7)


@each_solver
def test_a_swing_step_with_a_tiny_bound_is_solved(name: str) -> None:
    # ProxQP denied that this step is feasible: a bound of -8e-15 beside zeros.
    problem = QuadraticProgram.load(TINY_BOUND)
    x = solver_from(name).solve(problem)
    # P is 2 times the identity, so the cost is |x + c / 2|^2; the slack variables s of
    # lower <= s = C x <= upper turn it into a bounded least squares.
    slack = 1e4
    stacked = np.block(
        [[np.eye(5), np.zeros((5, 9))], [slack * problem.C, -slack * np.eye(9)]],
    )
    target = np.concatenate([-problem.c / 2, np.zeros(9)])
    span = np.maximum(problem.upper, problem.lower + 1e-12)
    bounds = (
        np.concatenate([np.full(5, -np.inf), problem.lower]),
        np.concatenate([np.full(5, np.inf), span]),
    )
    oracle = lsq_linear(stacked, target, bounds, method="bvls", tol=1e-14)
    assert x == pytest.approx(oracle.x[:5], abs=1e-6)


def test_a_saved_problem_is_read_back(tmp_path: Path) -> None:
    problem = random_program(7)
    problem.save(tmp_path / "problem.npz")
    again = QuadraticProgram.load(tmp_path / "problem.npz")
    assert {name: value.tolist() for name, value in asdict(again).items()} == {
        name: value.tolist() for name, value in asdict(problem).items()
    }


@each_solver
def test_the_iteration_limit_leaves_the_problem_undecided(name: str) -> None:
    with pytest.raises(QpUnsolved) as caught:
        hasty(name).solve(box_program(1.0))
    assert caught.value.undecided


@pytest.mark.parametrize(
    ("name", "status"),
    [("proxsuite", "PROXQP_MAX_ITER_REACHED"), ("daqp", "iteration limit")],
)
def test_the_iteration_limit_is_said(name: str, status: str) -> None:
    with pytest.raises(QpUnsolved) as caught:
        hasty(name).solve(box_program(1.0))
    assert (
        str(caught.value) == f"the QP of 2 variables was not solved: {status}; try the other solver"
    )


@each_solver
def test_an_unsolved_problem_is_carried_along(name: str) -> None:
    problem = box_program(1.0)
    with pytest.raises(QpUnsolved) as caught:
        hasty(name).solve(problem)
    assert caught.value.problem is problem


@each_solver
def test_an_unsolved_problem_does_not_spoil_the_next_of_a_series(name: str) -> None:
    solver = hasty(name)
    steps = series(solver)
    with pytest.raises(QpUnsolved):
        steps.solve(box_program(1.0))
    solver.max_iterations = 10_000
    assert steps.solve(box_program(2.0)) == pytest.approx([2.0, -2.0], abs=1e-7)


def test_what_a_series_does_not_solve_in_few_iterations_is_solved_cold(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    steps = series(ProxSuiteSolver())
    monkeypatch.setattr(type(steps), "_FEW", 1)
    answers = [steps.solve(box_program(limit)) for limit in (1.0, 2.0)]
    assert answers[0] == pytest.approx([1.0, -1.0], abs=1e-7)
    assert answers[1] == pytest.approx([2.0, -2.0], abs=1e-7)


def test_a_solver_that_knows_no_series_solves_its_programs_one_by_one() -> None:
    solver = DaqpSolver()
    assert series(solver) is solver


@each_solver
def test_an_unsolved_problem_does_not_spoil_the_next(name: str) -> None:
    solver = hasty(name)
    with pytest.raises(QpUnsolved):
        solver.solve(box_program(1.0))
    solver.max_iterations = 10_000
    assert solver.solve(box_program(2.0)) == pytest.approx([2.0, -2.0], abs=1e-7)


def test_daqp_says_that_a_problem_is_infeasible() -> None:
    outside = replace(box_program(1.0), A=np.array([[1.0, 1.0]]), b=np.array([2.5]))
    with pytest.raises(QpUnsolved) as caught:
        DaqpSolver().solve(outside)
    assert (
        str(caught.value)
        == "the QP of 2 variables was not solved: infeasible; try the other solver"
    )
    assert not caught.value.undecided


def test_an_exit_flag_that_daqp_does_not_document_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(qp_solvers.daqp, "solve", lambda *_, **__: ([0.0, 0.0], 0.0, -99, {}))
    with pytest.raises(QpUnsolved) as caught:
        DaqpSolver().solve(box_program(1.0))
    assert (
        str(caught.value)
        == "the QP of 2 variables was not solved: exit flag -99; try the other solver"
    )
    assert not caught.value.undecided


def test_an_answer_that_is_not_finite_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(qp_solvers.daqp, "solve", lambda *_, **__: ([0.0, np.nan], 0.0, 1, {}))
    with pytest.raises(QpUnsolved) as caught:
        DaqpSolver().solve(box_program(1.0))
    assert (
        str(caught.value)
        == "the QP of 2 variables was not solved: the answer is not finite; try the other solver"
    )
    assert not caught.value.undecided


def test_proxsuite_is_the_default() -> None:
    assert DEFAULT_SOLVER == "proxsuite"
    assert isinstance(solver_from(), ProxSuiteSolver)


def run_without(missing: str, program: str) -> str:
    """Return what a program prints in which some modules cannot be imported."""
    blocked = f"import sys; sys.modules.update(dict.fromkeys({missing.split()}))"
    command = [sys.executable, "-c", f"{blocked}\n{program}"]
    return subprocess.run(command, capture_output=True, text=True, check=True, timeout=60).stdout


PRINT_ANSWER = """
import numpy as np
from fastswing_planner.qp.problem import QuadraticProgram
from fastswing_planner.qp.solvers import DEFAULT_SOLVER, solver_from
none = np.zeros((0, 1)), np.zeros(0)
box = QuadraticProgram(np.eye(1), -3 * np.ones(1), *none, np.eye(1), -np.ones(1), np.ones(1))
print(DEFAULT_SOLVER, *solver_from().solve(box))
"""
PRINT_ERROR = """
from fastswing_planner.qp.solvers import solver_from
try:
    solver_from("NAME")
except ImportError as error:
    print(type(error).__name__, error, sep=": ")
"""


def test_daqp_is_the_default_where_proxsuite_has_no_python_bindings() -> None:
    assert run_without("proxsuite", PRINT_ANSWER).split() == ["daqp", "1.0"]


@pytest.mark.parametrize(("missing", "other"), [("proxsuite", "daqp"), ("daqp", "proxsuite")])
def test_a_missing_solver_says_what_to_install_and_what_else_there_is(
    missing: str, other: str
) -> None:
    assert run_without(missing, PRINT_ERROR.replace("NAME", missing)) == (
        f"SolverMissing: the solver {missing} cannot be imported in Python: install it with "
        f"`make build` or `pip install {missing}`, or choose solver {other}\n"
    )


def test_without_any_solver_the_default_is_what_is_missing() -> None:
    printed = run_without("proxsuite daqp", PRINT_ERROR.replace('"NAME"', ""))
    assert printed.startswith("SolverMissing: the solver proxsuite cannot be imported")


def test_an_unknown_solver_lists_the_choices() -> None:
    with pytest.raises(InvalidLimit) as caught:
        solver_from("osqp")
    assert str(caught.value) == "unknown solver 'osqp', choose from: proxsuite, daqp"
