"""What the paper prints of its simulation, and how far a description of the arm is from it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastswing_planner.errors import SolverFailed, SwingBlocked
from fastswing_planner.planning.planner import SwingPlanner
from fastswing_planner.planning.request import Method
from fastswing_planner.planning.speed_index import swing_speed_index
from fastswing_planner.planning.swing import SwingSettings, Trajectory, simulate_swing
from fastswing_planner.qp.solvers import ProxSuiteSolver
from fastswing_planner.robot.limits import MuscleLimits
from fastswing_planner.robot.muscle_model import MuscleModel

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]

EPSILON = 0.01
"""[rad] where a simulated swing ends; not in the paper, ours."""

WIRE_STIFFNESS = 7000.0
"""[N/m] of this fit's own springs; those of the emulated arm are fitted later, to other targets."""

JOINTS = ("S-p", "S-r", "S-y", "E-p", "E-y")
MUSCLES = tuple(f"#{number}" for number in range(1, 11))
ELBOW_PITCH = JOINTS.index("E-p")

PEAK = {Method.BASIC: 2.4, Method.INHIBIT: 4.4, Method.ELONGATE: 3.3}
"""Largest |E-p| speed [rad/s] of the paper's simulation."""
STEPS = {Method.BASIC: 33, Method.INHIBIT: 20, Method.ELONGATE: 26}
"""The paper's t_cost of 0.99, 0.60 and 0.78 s in steps of 0.03 s."""
MASKED = {
    Method.BASIC: (),
    Method.INHIBIT: ("#2", "#3", "#9", "#10"),
    Method.ELONGATE: ("#9",),
}

_ARM_SIGNS = (
    ("#1", "S-p", -1),
    ("#3", "S-p", 1),
    ("#9", "S-p", 1),
    ("#9", "E-p", 1),
    ("#10", "E-p", 1),
    ("#6", "E-p", -1),
    ("#8", "E-p", -1),
)
_IMPOSSIBLE = 1e4


@dataclass(frozen=True)
class Arm:
    """One candidate description with its postures [rad], shape (n,)."""

    model: MuscleModel
    limits: MuscleLimits
    start: Vector
    end: Vector


def kept(*masked: str) -> NDArray[np.bool_]:
    """Return the mask of all muscles but the named ones, shape (m,)."""
    return np.array([name not in masked for name in MUSCLES])


def arrival_steps(trajectory: Trajectory, end: Vector) -> float:
    """Return how many steps a swing takes, the last one counted by how much of it was needed."""
    distance = np.linalg.norm(trajectory.joint_position - end, axis=1)
    last_stride = max(float(distance[-3] - distance[-2]), 1e-9)
    return distance.size - 2 + min(float(distance[-2]) / last_stride, 1.0)


def peak_elbow_speed(trajectory: Trajectory) -> float:
    """Return the largest |E-p| speed [rad/s]."""
    return float(np.abs(trajectory.joint_velocity[:, ELBOW_PITCH]).max())


def travel_arms(model: MuscleModel, start: Vector, end: Vector, count: int = 41) -> Matrix:
    """Return G [m/rad] at `count` postures from start to end, shape (count, m, n)."""
    return np.array([model.jacobian(start + part * (end - start)) for part in _parts(count)])


def stiffness_eigenvalues(arm: Arm, posture: Vector, tension: Vector) -> Vector:
    """Return the eigenvalues [N m/rad] of the arm held by springs at `tension`, shape (n,).

    The Hessian of wire and weight energy: G^T K G + sum_i f_i d2l_i + d(gravity torque).
    """
    model, step = arm.model, 1e-4

    def torque(angles: Vector) -> Vector:
        return model.jacobian(angles).T @ tension + model.gravity_torque(angles)

    offsets = step * np.eye(posture.size)
    geometric = np.array(
        [(torque(posture + o) - torque(posture - o)) / (2 * step) for o in offsets]
    )
    jacobian = model.jacobian(posture)
    hessian = WIRE_STIFFNESS * jacobian.T @ jacobian + geometric
    return np.linalg.eigvalsh((hessian + hessian.T) / 2)


def cost(arm: Arm) -> float:
    """Return how far the arm is from the targets; below 1 all of them are met comfortably."""
    planner = SwingPlanner(arm.model, arm.limits, ProxSuiteSolver())
    try:
        missing = planner.hold(arm.start).residual
        if missing > 1e-4:
            return _IMPOSSIBLE * (1 + missing)
        terms = (
            _swing_terms(arm)
            + _holding_terms(arm, planner)
            + _speed_index_terms(arm)
            + _moment_arm_terms(arm)
        )
    except (SwingBlocked, SolverFailed):
        # One candidate of thousands; an answer that is not sure is no reason to prefer it.
        return _IMPOSSIBLE
    return float(np.square(terms).sum())


def _parts(count: int) -> Vector:
    return np.linspace(0.0, 1.0, count)


def _above(value: float, least: float, scale: float) -> float:
    return max(0.0, least - value) / scale


def _below(value: float, most: float, scale: float) -> float:
    return max(0.0, value - most) / scale


def _swing_terms(arm: Arm) -> list[float]:
    """Peaks within a per cent, arrival well inside the right step, no joint near its stop."""
    terms = []
    model, solver = arm.model, ProxSuiteSolver()
    for method, masked in MASKED.items():
        trajectory = simulate_swing(
            model,
            solver,
            arm.start,
            arm.end,
            arm.limits,
            kept(*masked),
            SwingSettings(epsilon=EPSILON),
        )
        terms.append((peak_elbow_speed(trajectory) / PEAK[method] - 1) / 0.005)
        steps = arrival_steps(trajectory, arm.end)
        terms.append(_above(steps, STEPS[method] - 0.7, 0.1))
        terms.append(_below(steps, STEPS[method] - 0.3, 0.1))
        low = trajectory.joint_position.min(axis=0)
        high = trajectory.joint_position.max(axis=0)
        terms.extend(_above(x, 0.1, 0.02) for x in low - model.joint_lower)
        terms.extend(_above(x, 0.1, 0.02) for x in model.joint_upper - high)
        # The shoulder's other axes and the forearm's stay near zero.
        terms.extend(_below(abs(float(x)), 0.1, 0.1) for x in [*low[[1, 2, 4]], *high[[1, 2, 4]]])
    return terms


def _holding_terms(arm: Arm, planner: SwingPlanner) -> list[float]:
    """Everything between home and start holds, gently and stably; #10 is needed once #9 is out."""
    terms = []
    holdings = [(part * arm.start, planner.hold(part * arm.start)) for part in _parts(9)]
    holdings.append((arm.end, planner.hold(arm.end)))
    for posture, holding in holdings:
        terms.append(holding.residual / 1e-3)
        terms.append(_below(float(holding.tension.max()), 70.0, 20.0))
        lowest = stiffness_eigenvalues(arm, posture, holding.tension)[0]
        terms.append(_above(float(lowest), 5.0, 1.0))
    without_9 = planner.hold(arm.start, kept=kept("#9"))
    terms.append(without_9.residual / 1e-3)
    terms.append(_below(float(without_9.tension.max()), 110.0, 10.0))
    without_both = planner.hold(arm.start, kept=kept("#9", "#10"))
    terms.append(_above(without_both.residual, 1.5, 0.1))
    return terms


def _speed_index_terms(arm: Arm) -> list[float]:
    """q[#9] > q[#10] > q[#3] > q[#2] > 0, all others clearly negative."""
    index = swing_speed_index(arm.model, arm.start, arm.end, arm.limits.velocity)
    q = dict(zip(MUSCLES, index, strict=True))
    terms = [_above(q[a] - q[b], 0.015, 0.003) for a, b in (("#9", "#10"), ("#10", "#3"))]
    terms.append(_above(q["#3"] - q["#2"], 0.015, 0.003))
    terms.append(_above(q["#2"], 0.015, 0.003))
    terms.extend(_below(q[a], -0.008, 0.002) for a in ("#1", "#4", "#5", "#6", "#7", "#8"))
    return terms


def _moment_arm_terms(arm: Arm) -> list[float]:
    """Arms of one sign and at least 3 cm over the travel, changing gently."""
    arms = travel_arms(arm.model, arm.start, arm.end)
    terms = []
    for muscle, joint, sign in _ARM_SIGNS:
        values = sign * arms[:, MUSCLES.index(muscle), JOINTS.index(joint)]
        terms.append(_above(float(values.min()), 0.03, 0.005))
        terms.append(_below(float(np.abs(np.diff(values)).max()), 0.004, 0.001))
    return terms
