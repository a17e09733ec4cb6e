"""The solvers behind the quadratic programs, chosen by name."""

from collections.abc import Callable, Mapping
from types import ModuleType

import numpy as np

from fastswing_planner.arrays import Vector
from fastswing_planner.errors import InvalidLimit
from fastswing_planner.qp.problem import QpSolver, QpUnsolved, QuadraticProgram, SolverMissing

# Either may be missing: ROS's own proxsuite is C++ alone (0.6.5), and rosdep knows no daqp.
try:
    import proxsuite
except ImportError:
    proxsuite = None
try:
    import daqp
except ImportError:
    daqp = None

# With a gap of 1e-7 the slow last step of a swing, where the multipliers are small, was off by
# 1e-5 rad. Large numbers leave a gap of rounding errors: a part of their cost.
_GAP = 1e-11
_GAP_OF_COST = 1e-13


class ProxSuiteSolver:
    """ProxQP's dense solver, cold-started, with tolerances that were measured to be needed.

    With the default eps of 1e-5 ProxQP reports steps of the swing QP as solved that are off by up
    to 0.9 rad/s.
    """

    max_iterations = 10_000
    max_inner_iterations = 1_500

    def __init__(self) -> None:
        """Begin; raises SolverMissing."""
        _require("proxsuite", proxsuite)

    def solve(self, problem: QuadraticProgram) -> Vector:
        """Return the minimiser, shape (n,). Raises QpUnsolved."""
        workspace = _proxqp(problem, self.max_iterations, self.max_inner_iterations)
        workspace.solve()
        if not _solved(workspace):
            status = workspace.results.info.status
            undecided = status == proxsuite.proxqp.QPSolverOutput.PROXQP_MAX_ITER_REACHED
            raise QpUnsolved(str(status).rpartition(".")[2], problem, undecided)
        return _finite(np.array(workspace.results.x), problem)

    def series(self) -> QpSolver:
        """Return what solves one series of strictly convex programs without equalities."""
        return _ProxSuiteSeries(self)


class _ProxSuiteSeries:
    """Starts each program at the answer before, with a stiff penalty: fewer iterations.

    Where many constraints are met at once that takes hundreds, and from a far start ProxQP once in
    a thousand times calls an answer solved whose duality gap is not closed. So it is given few
    iterations, its gap is computed again, and a program that fails either is solved cold.
    """

    _STIFF = 1e-6  # ProxQP's own mu_in is 0.1
    _FEW = 12

    def __init__(self, cold: ProxSuiteSolver) -> None:
        self._cold = cold
        self._last: tuple[Vector, Vector] | None = None

    def solve(self, problem: QuadraticProgram) -> Vector:
        few = min(self._FEW, self._cold.max_iterations)
        workspace = _proxqp(problem, few, few, self._STIFF)
        if self._last is None:
            workspace.solve()
        else:
            workspace.settings.initial_guess = proxsuite.proxqp.InitialGuess.WARM_START
            x, multipliers = self._last
            workspace.solve(x, None, multipliers)
        x, multipliers = np.array(workspace.results.x), np.array(workspace.results.z)
        if not (_solved(workspace) and _gap_is_closed(problem, x, multipliers)):
            self._last = None
            return self._cold.solve(problem)
        self._last = x, multipliers
        return x


def _gap_is_closed(problem: QuadraticProgram, x: Vector, multipliers: Vector) -> bool:
    """Return whether cost and dual cost are the same; not if anything is not finite."""
    # x^T P x + c^T x + z^T [upper where z > 0, lower where z < 0] = 0
    slope = problem.P.dot(x) + problem.c
    bounds = np.where(multipliers > 0.0, problem.upper, problem.lower)
    gap = x.dot(slope) + multipliers.dot(bounds)
    return bool(abs(gap) <= _GAP + _GAP_OF_COST * abs(problem.c.dot(x)))


def _proxqp(
    problem: QuadraticProgram,
    max_iterations: int,
    max_inner_iterations: int,
    penalty: float | None = None,
) -> "proxsuite.proxqp.dense.QP":
    """Return a new workspace: one that solved a problem before sometimes does not solve the next.

    penalty  mu of the inequalities; None: ProxQP's own
    """
    workspace = proxsuite.proxqp.dense.QP(problem.c.size, problem.b.size, problem.lower.size)
    settings = workspace.settings
    settings.eps_abs = 1e-9
    settings.eps_rel = 0.0
    settings.check_duality_gap = True
    settings.eps_duality_gap_abs = _GAP
    settings.eps_duality_gap_rel = _GAP_OF_COST
    # Every problem asked here is feasible; with 1e-12 ProxQP once denied it for a bound of
    # -8e-15 beside zeros.
    settings.eps_primal_inf = 0.0
    settings.max_iter = max_iterations
    settings.max_iter_in = max_inner_iterations
    settings.initial_guess = proxsuite.proxqp.InitialGuess.NO_INITIAL_GUESS
    workspace.init(
        problem.P,
        problem.c,
        problem.A if problem.b.size else None,
        problem.b if problem.b.size else None,
        problem.C if problem.lower.size else None,
        problem.lower if problem.lower.size else None,
        problem.upper if problem.lower.size else None,
        compute_preconditioner=False,  # the programs are scaled when they are built
        # A hundredth of ProxQP's own regularisation takes fewer iterations; where there are
        # equalities, some programs then took 100 ms.
        rho=None if problem.b.size else 1e-8,
        mu_in=penalty,
    )
    return workspace


def _solved(workspace: "proxsuite.proxqp.dense.QP") -> bool:
    solved = proxsuite.proxqp.QPSolverOutput.PROXQP_SOLVED
    return bool(workspace.results.info.status == solved)


class DaqpSolver:
    """DAQP, a dual active-set solver: faster than ProxQP on programs of this size.

    Semidefinite costs are solved by its proximal iterations; with its default eta_prox their
    result is off by up to 1e-4 N m.
    """

    _OPTIMAL = 1
    _ITERATION_LIMIT = -4
    _EQUALITY = 5
    _STATUS: Mapping[int, str] = {
        -1: "infeasible",
        -2: "cycling",
        -3: "unbounded",
        -4: "iteration limit",
        -5: "not convex",
        -6: "overdetermined",
        -7: "time limit",
    }

    max_iterations = 10_000

    def __init__(self) -> None:
        """Begin; raises SolverMissing."""
        _require("daqp", daqp)

    def solve(self, problem: QuadraticProgram) -> Vector:
        """Return the minimiser, shape (n,). Raises QpUnsolved."""
        rows, lower, upper = problem.C, problem.lower, problem.upper
        sense = np.zeros(problem.b.size + lower.size, dtype=np.int32)
        if problem.b.size:
            sense[: problem.b.size] = self._EQUALITY
            rows = np.concatenate([problem.A, rows])
            lower, upper = (np.concatenate([problem.b, ends]) for ends in (lower, upper))
        x, _, status, _ = daqp.solve(
            np.ascontiguousarray(problem.P),
            np.array(problem.c),
            np.ascontiguousarray(rows),
            np.ascontiguousarray(upper),
            np.ascontiguousarray(lower),
            sense,
            primal_tol=1e-9,
            eta_prox=1e-9,
            iter_limit=self.max_iterations,
        )
        if status != self._OPTIMAL:
            text = self._STATUS.get(status, f"exit flag {status}")
            raise QpUnsolved(text, problem, undecided=status == self._ITERATION_LIMIT)
        return _finite(np.array(x), problem)


SOLVERS: Mapping[str, Callable[[], QpSolver]] = {
    "proxsuite": ProxSuiteSolver,
    "daqp": DaqpSolver,
}
"""The solvers by name."""

DEFAULT_SOLVER = "daqp" if proxsuite is None and daqp is not None else "proxsuite"
"""ProxSuite, and DAQP where only that is installed; both give the same plans."""


def solver_from(name: str = DEFAULT_SOLVER) -> QpSolver:
    """Return a new solver; raises InvalidLimit listing the choices, SolverMissing."""
    if name not in SOLVERS:
        raise InvalidLimit(f"unknown solver '{name}', choose from: {', '.join(SOLVERS)}")
    return SOLVERS[name]()


def _require(name: str, module: ModuleType | None) -> None:
    if module is None:
        (other,) = SOLVERS.keys() - {name}
        raise SolverMissing(
            f"the solver {name} cannot be imported in Python: install it with `make build` or "
            f"`pip install {name}`, or choose solver {other}"
        )


def _finite(x: Vector, problem: QuadraticProgram) -> Vector:
    if not np.isfinite(x).all():
        raise QpUnsolved("the answer is not finite", problem, undecided=False)
    return x
