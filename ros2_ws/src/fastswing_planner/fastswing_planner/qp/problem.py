"""Quadratic programs, and what solves them."""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np

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
        np.savez(path, **asdict(self))

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
        super().__init__(
            f"the QP of {problem.c.size} variables was not solved: {status}; try the other solver"
        )
        self.problem = problem
        self.undecided = undecided


class SolverMissing(SolverFailed, ImportError):
    """A solver that is not installed."""


class QpSolver(Protocol):
    """Solves one quadratic program at a time."""

    def solve(self, problem: QuadraticProgram) -> Vector:
        """Return the minimiser, shape (n,). Raises QpUnsolved."""


@runtime_checkable
class SeriesSolver(QpSolver, Protocol):
    """A solver that is faster where it knows that each program resembles the one before."""

    def series(self) -> QpSolver:
        """Return what solves one series of strictly convex programs without equalities."""


def series(solver: QpSolver) -> QpSolver:
    """Return what solves one series of such programs: `solver` itself if it has nothing better."""
    return solver.series() if isinstance(solver, SeriesSolver) else solver
