"""Which muscle tensions hold the arm at rest (QP 1, eq. 6 of the paper)."""

from dataclasses import dataclass

import numpy as np

from fastswing_planner.arrays import BoolVector, Matrix, Vector, frozen
from fastswing_planner.errors import HoldingUndecided, SolverFailed
from fastswing_planner.qp.problem import QpSolver, QpUnsolved, QuadraticProgram
from fastswing_planner.robot.limits import MuscleLimits

# The QPs are solved in these units, in which all their numbers are near one.
_TENSION_UNIT = 100.0  # [N]
_ARM_UNIT = 0.04  # [m/rad]
_TORQUE_UNIT = _TENSION_UNIT * _ARM_UNIT  # [N m]

RESIDUAL_TOLERANCE = 1e-4
"""Torque error [N m] below which a posture counts as held."""


@dataclass(frozen=True)
class Holding:
    """Whether and how a posture is held.

    feasible  the posture can be held within the tension limits
    residual  [N m] norm of the torque that is missing: the distance to feasibility
    tension   [N] shape (m,), 0 for masked muscles; the nearest attempt if not feasible
    """

    feasible: bool
    residual: float
    tension: Vector


def build_nearest_torque(
    muscle_jacobian: Matrix, torque: Vector, tension_min: Vector, tension_max: Vector
) -> QuadraticProgram:
    """Build the bounded least squares that is always feasible, in scaled units.

    muscle_jacobian  G [m/rad] of the kept muscles, shape (k, n)
    torque           tau^nec [N m], shape (n,)
    """
    # minimise |G^T f + tau^nec|^2  subject to  f^min <= f <= f^max
    count = tension_min.size
    arms = muscle_jacobian / _ARM_UNIT
    return QuadraticProgram(
        P=2.0 * arms @ arms.T,
        c=2.0 * arms @ (torque / _TORQUE_UNIT),
        A=np.zeros((0, count)),
        b=np.zeros(0),
        C=np.eye(count),
        lower=tension_min / _TENSION_UNIT,
        upper=tension_max / _TENSION_UNIT,
    )


def build_holding(
    muscle_jacobian: Matrix,
    torque: Vector,
    tension_min: Vector,
    tension_max: Vector,
    weight: Matrix,
) -> QuadraticProgram:
    """Build QP 1 for the kept muscles, in scaled units.

    weight  W1, shape (k, k), symmetric positive definite; other arguments as above
    """
    # minimise f^T W1 f  subject to  tau^nec = -G^T(theta_start) f,  f^min <= f <= f^max  (eq. 6)
    count = tension_min.size
    return QuadraticProgram(
        P=2.0 * weight,
        c=np.zeros(count),
        A=-muscle_jacobian.T / _ARM_UNIT,
        b=torque / _TORQUE_UNIT,
        C=np.eye(count),
        lower=tension_min / _TENSION_UNIT,
        upper=tension_max / _TENSION_UNIT,
    )


def _solve(solver: QpSolver, problem: QuadraticProgram) -> Vector:
    try:
        return solver.solve(problem) * _TENSION_UNIT
    except QpUnsolved as error:
        if error.undecided:
            raise HoldingUndecided(f"holding is undecided: {error}") from error
        raise


def hold(
    solver: QpSolver,
    muscle_jacobian: Matrix,
    torque: Vector,
    limits: MuscleLimits,
    kept: BoolVector,
    weight: Matrix | None = None,
) -> Holding:
    """Find the least tensions of the kept muscles that hold a posture.

    muscle_jacobian  G(theta) [m/rad], shape (m, n)
    torque           tau^nec [N m], shape (n,)
    kept             the mask m of the paper as booleans, shape (m,)
    weight           W1, shape (m, m); identity if None

    Raises HoldingUndecided at the solver's iteration limit, SolverFailed if the solver's answer
    does not hold up; never reports either as infeasible.
    """
    arms = muscle_jacobian[kept]
    low, high = limits.tension_min[kept], limits.tension_max[kept]
    tension = np.zeros(kept.size)
    if not kept.any():
        residual = float(np.linalg.norm(torque))
        return Holding(residual <= RESIDUAL_TOLERANCE, residual, frozen(tension))
    tension[kept] = np.clip(
        _solve(solver, build_nearest_torque(arms, torque, low, high)), low, high
    )
    residual = float(np.linalg.norm(muscle_jacobian.T @ tension + torque))
    if residual > RESIDUAL_TOLERANCE:
        return Holding(False, residual, frozen(tension))
    # Within the tolerance, but perhaps not exactly: ask for what is reached.
    reachable = -arms.T @ tension[kept]
    kept_weight = np.eye(int(kept.sum())) if weight is None else weight[np.ix_(kept, kept)]
    tension[kept] = np.clip(
        _solve(solver, build_holding(arms, reachable, low, high, kept_weight)), low, high
    )
    check = float(np.linalg.norm(muscle_jacobian.T @ tension + torque))
    if check > 10.0 * RESIDUAL_TOLERANCE:
        raise SolverFailed(f"the holding QP was reported solved, but misses {check:.2g} N m")
    return Holding(True, residual, frozen(tension))
