"""The kinematic swing (QP 2, eq. 7 of the paper)."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fastswing_planner.arrays import BoolVector, Matrix, Vector, contiguous, frozen, frozen_flags
from fastswing_planner.errors import InvalidLimit, NotFinite, SwingBlocked
from fastswing_planner.planning.ramp import ramp_bounds
from fastswing_planner.qp.problem import QpSolver, QuadraticProgram, series
from fastswing_planner.robot.limits import MuscleLimits
from fastswing_planner.robot.muscle_model import MuscleModel

# The QP's rows are scaled by this, which brings their numbers near one.
_ARM_UNIT = 0.04  # [m/rad]

_ACTIVE = 1e-6  # [m/s] from a bound
_STUCK_STEPS = 10
_STUCK_PROGRESS = 1e-8  # [rad] over _STUCK_STEPS
SETTING_RANGES = {
    "time_step": (1e-3, 1.0, "s"),
    "epsilon": (1e-4, 1.0, "rad"),
    "max_steps": (1, 100_000, ""),
}
"""Lowest and highest value of each of the SwingSettings, and its unit."""


@dataclass(frozen=True)
class SwingSettings:
    """How a swing is simulated.

    time_step  dt [s]; 0.03 in the paper
    epsilon    [rad] the swing ends when |theta - theta_end|_2 is below it; not in the paper
    max_steps  a longer swing is an error
    """

    time_step: float = 0.03
    epsilon: float = 0.01
    max_steps: int = 400

    def __post_init__(self) -> None:
        """Raise NotFinite or InvalidLimit for a value that makes no sense."""
        for name, (low, high, unit) in SETTING_RANGES.items():
            value = getattr(self, name)
            if value != value or abs(value) == np.inf:  # also for whole numbers of any size
                raise NotFinite(f"{name} is {value}, expected a finite number")
            if not low <= value <= high:
                shown = f"{value:g}" if isinstance(value, float) else f"{value}"
                raise InvalidLimit(
                    f"{name} is {shown} {unit}".rstrip() + f", must be {low:g} to {high:g}"
                )


@dataclass(frozen=True)
class Trajectory:
    """A simulated swing of k steps; row 0 is the start posture at rest.

    time             [s] shape (k + 1,)
    joint_position   [rad] shape (k + 1, n)
    joint_velocity   [rad/s] shape (k + 1, n), mean over the step that ends here
    muscle_length    [m] shape (k + 1, m)
    muscle_velocity  [m/s] shape (k + 1, m), mean over the step that ends here
    at_limit         kept muscles whose speed bound holds the step back, shape (k + 1, m)
    """

    time: Vector
    joint_position: Matrix
    joint_velocity: Matrix
    muscle_length: Matrix
    muscle_velocity: Matrix
    at_limit: NDArray[np.bool_]

    @property
    def time_cost(self) -> float:
        """t^cost of the paper [s]."""
        return float(self.time[-1])


def build_swing_step(
    muscle_jacobian: Matrix, remaining: Vector, lower: Vector, upper: Vector, weight: Matrix
) -> QuadraticProgram:
    """Build QP 2 for one step, with scaled rows.

    muscle_jacobian  G(theta) [m/rad] of the kept muscles, shape (k, n)
    remaining        theta_end - theta [rad], shape (n,)
    lower, upper     bounds of the kept muscles' displacement [m] in this step, shape (k,)
    weight           W2, shape (n, n), symmetric positive definite
    """
    # minimise (theta_end - theta - dtheta)^T W2 (theta_end - theta - dtheta)
    # subject to  l_dot^min dt <= G(theta) dtheta <= l_dot^max dt  (eq. 7, bounds of eqs. 8 and 9)
    cost = 2.0 * weight
    return QuadraticProgram(
        P=cost,
        c=-cost.dot(remaining),
        A=cost[:0],
        b=remaining[:0],
        C=muscle_jacobian / _ARM_UNIT,
        lower=lower / _ARM_UNIT,
        upper=upper / _ARM_UNIT,
    )


def simulate_swing(
    model: MuscleModel,
    solver: QpSolver,
    start: Vector,
    end: Vector,
    limits: MuscleLimits,
    kept: BoolVector,
    settings: SwingSettings,
    weight: Matrix | None = None,
    like: Trajectory | None = None,
) -> Trajectory:
    """Simulate how fast the kept muscles let the arm come from `start` to `end`.

    start, end  [rad] shape (n,)
    kept        the mask m of the paper as booleans, shape (m,); masked muscles bound nothing
    weight      W2, shape (n, n); identity if None
    like        the same swing with more muscles kept: what both share is not simulated again

    Raises SwingBlocked, naming joints and muscles, if the swing stops short of its end.
    """
    dt, chosen = settings.time_step, contiguous(np.flatnonzero(kept))
    gain, fastest = limits.acceleration * dt, limits.velocity
    slowest = -fastest
    weight = np.eye(start.size) if weight is None else weight
    steps = series(solver)
    positions, lengths, velocities = _at_rest(model, start) if like is None else _shared(like, kept)
    remaining, velocity = end - positions[-1], velocities[-1]
    progress = [_weighted_norm(end - position, weight) for position in positions]
    while math.sqrt(remaining.dot(remaining)) >= settings.epsilon:
        stuck = (
            len(positions) > _STUCK_STEPS
            and progress[-1 - _STUCK_STEPS] - progress[-1] < _STUCK_PROGRESS
        )
        if stuck or len(positions) > settings.max_steps:
            met = _limits_met(np.array(velocities), gain, fastest) & kept
            raise SwingBlocked(_blocked_text(model, remaining, met[-1], len(positions) - 1))
        muscle_jacobian = model.jacobian(positions[-1])
        low, high = ramp_bounds(velocity, gain, slowest, fastest)
        arms, least, most = muscle_jacobian[chosen], low[chosen] * dt, high[chosen] * dt
        step = steps.solve(build_swing_step(arms, remaining, least, most, weight))
        # theta <- theta + dtheta
        position, velocity = positions[-1] + step, muscle_jacobian.dot(step) / dt
        remaining = end - position
        positions.append(position)
        lengths.append(model.lengths(position))
        velocities.append(velocity)
        progress.append(_weighted_norm(remaining, weight))
    at_rest = np.zeros((1, start.size))
    muscle_velocity = frozen(velocities)
    return Trajectory(
        time=frozen(dt * np.arange(len(positions))),
        joint_position=frozen(positions),
        joint_velocity=frozen(np.concatenate([at_rest, np.diff(positions, axis=0) / dt])),
        muscle_length=frozen(lengths),
        muscle_velocity=muscle_velocity,
        at_limit=frozen_flags(_limits_met(muscle_velocity, gain, fastest) & kept),
    )


_Rows = tuple[list[Vector], list[Vector], list[Vector]]
"""Of a Trajectory: joint positions, muscle lengths and velocities."""


def _at_rest(model: MuscleModel, start: Vector) -> _Rows:
    length = model.lengths(start)
    return [start], [length], [np.zeros(length.size)]


def _limits_met(velocities: Matrix, gain: Vector, fastest: Vector) -> NDArray[np.bool_]:
    """Return which muscles end a step at a bound of their speed, shape (k + 1, m)."""
    low, high = ramp_bounds(velocities[:-1], gain, -fastest, fastest)
    met = (velocities[1:] <= low + _ACTIVE) | (velocities[1:] >= high - _ACTIVE)
    return np.concatenate([np.zeros((1, fastest.size), dtype=bool), met])


def shared_step_count(like: Trajectory, kept: BoolVector) -> int:
    """Return how many rows of a swing stay when it keeps no other muscles than `kept`.

    They end before the first step that one of the others held back: QP 2 is strictly convex, so
    without bounds that are not met its minimum is the same.
    """
    held_back = like.at_limit[:, ~kept].any(axis=1)
    return int(np.argmax(held_back)) if held_back.any() else held_back.size


def _shared(like: Trajectory, kept: BoolVector) -> _Rows:
    count = shared_step_count(like, kept)
    columns = (like.joint_position, like.muscle_length, like.muscle_velocity)
    positions, lengths, velocities = (list(column[:count]) for column in columns)
    return positions, lengths, velocities


def _weighted_norm(remaining: Vector, weight: Matrix) -> float:
    """Return the root of what QP 2 minimises: no step may raise it."""
    return math.sqrt(remaining.dot(weight.dot(remaining)))


def _blocked_text(
    model: MuscleModel, remaining: Vector, at_limit: BoolVector, step_count: int
) -> str:
    joints = [
        f"{name} by {value:+.3f} rad"
        for name, value in zip(model.joint_names, remaining, strict=True)
        if abs(value) > 1e-3
    ]
    muscles = [name for name, blocks in zip(model.muscle_names, at_limit, strict=True) if blocks]
    return (
        f"the swing stops short of its end after {step_count} steps: "
        f"{', '.join(joints) or 'all joints by less than 0.001 rad'}; "
        f"blocking muscles: {', '.join(muscles) or 'none'}"
    )
