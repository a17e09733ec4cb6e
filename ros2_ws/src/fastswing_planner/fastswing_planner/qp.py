"""Quadratic programs, and the solver behind them."""

from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np
import proxsuite

from fastswing_planner.arrays import Matrix, Vector
from fastswing_planner.errors import SolverFailed


@dataclass(frozen=True)
class QuadraticProgram:
    """Minimise x^T P x / 2 + c^T x subject to A x = b and lower <= C x <= upper.

    Shapes: P (n, n) positive semidefinite, c (n,), A (e, n), b (e,), C (i, n), lower, upper (i,).
    """

    P: Matrix
    c: Vector
    A: Matrix
    b: Vector
    C: Matrix
    lower: Vector
    upper: Vector

    def save(self, path: Path) -> None:
        """Write the problem to an `.npz` file, to become a regression test."""
        np.savez(path, **vars(self))

    @staticmethod
    def load(path: Path) -> "QuadraticProgram":
        """Read what `save` wrote."""
        with np.load(path) as arrays:
            return QuadraticProgram(**arrays)


class QpUnsolved(SolverFailed):
    """The solver gave no solution; carries the problem.

    problem    the QuadraticProgram, see its `save`
    undecided  the iteration limit was reached: nothing is known
    """

    def __init__(self, status: str, problem: QuadraticProgram, undecided: bool) -> None:
        super().__init__(f"the QP of {problem.c.size} variables was not solved: {status}")
        self.problem = problem
        self.undecided = undecided


class QpSolver(Protocol):
    """Solves one quadratic program at a time."""

    def solve(self, problem: QuadraticProgram) -> Vector:
        """Return the minimiser, shape (n,). Raises QpUnsolved."""


class ProxSuiteSolver:
    """ProxQP's dense solver, cold-started, with tolerances that were measured to be needed.

    With the default eps of 1e-5 ProxQP reports steps of the swing QP as solved that are off by up
    to 0.9 rad/s; a warm start after an infeasible problem spoils the next.
    """

    max_iterations = 10_000
    max_inner_iterations = 1_500

    def __init__(self) -> None:
        self._workspaces: dict[tuple[int, int, int], proxsuite.proxqp.dense.QP] = {}

    def _workspace(self, problem: QuadraticProgram) -> proxsuite.proxqp.dense.QP:
        size = (problem.c.size, problem.b.size, problem.lower.size)
        if size not in self._workspaces:
            workspace = proxsuite.proxqp.dense.QP(*size)
            settings = workspace.settings
            settings.eps_abs = 1e-9
            settings.eps_rel = 0.0
            settings.check_duality_gap = True
            settings.eps_duality_gap_abs = 1e-7
            settings.eps_duality_gap_rel = 0.0
            # Every problem asked here is feasible; with 1e-12 ProxQP once denied it for a bound of
            # -8e-15 beside zeros.
            settings.eps_primal_inf = 0.0
            settings.max_iter = self.max_iterations
            settings.max_iter_in = self.max_inner_iterations
            settings.initial_guess = proxsuite.proxqp.InitialGuess.NO_INITIAL_GUESS
            self._workspaces[size] = workspace
        return self._workspaces[size]

    def solve(self, problem: QuadraticProgram) -> Vector:
        """Return the minimiser, shape (n,). Raises QpUnsolved."""
        workspace = self._workspace(problem)
        workspace.init(
            problem.P,
            problem.c,
            problem.A if problem.b.size else None,
            problem.b if problem.b.size else None,
            problem.C if problem.lower.size else None,
            problem.lower if problem.lower.size else None,
            problem.upper if problem.lower.size else None,
        )
        workspace.solve()
        status = workspace.results.info.status
        if status != proxsuite.proxqp.QPSolverOutput.PROXQP_SOLVED:
            # The workspace of an unsolved problem spoils the next.
            del self._workspaces[problem.c.size, problem.b.size, problem.lower.size]
            undecided = status == proxsuite.proxqp.QPSolverOutput.PROXQP_MAX_ITER_REACHED
            raise QpUnsolved(str(status).rpartition(".")[2], problem, undecided)
        return np.array(workspace.results.x)
