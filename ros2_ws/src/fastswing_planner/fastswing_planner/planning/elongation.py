"""How far to pay out the masked muscles before the swing."""

import numpy as np

from fastswing_planner.arrays import BoolVector, Matrix, Vector, frozen
from fastswing_planner.planning.ramp import velocity_bounds
from fastswing_planner.planning.swing import Trajectory
from fastswing_planner.robot.limits import MuscleLimits


def fastest_payout(limits: MuscleLimits, step_count: int, time_step: float) -> Matrix:
    """Return how far each muscle can pay out from rest [m], shape (step_count + 1, m)."""
    velocity = np.zeros(limits.velocity.size)
    payout = [np.zeros(limits.velocity.size)]
    for _ in range(step_count):
        _, velocity = velocity_bounds(velocity, limits.velocity, limits.acceleration, time_step)
        payout.append(payout[-1] + velocity * time_step)
    return np.array(payout)


def elongation(trajectory: Trajectory, limits: MuscleLimits, kept: BoolVector) -> Vector:
    """Return dl^elongate [m], shape (m,): never negative, 0 for kept muscles.

    It is the largest amount by which a masked muscle's simulated length runs ahead of the
    fastest payout from rest (section III-B of the paper, last paragraph).
    """
    if kept.all():
        return frozen(np.zeros(kept.size))
    step_count = trajectory.time.size - 1
    time_step = float(trajectory.time[1]) if step_count else 0.0
    needed = trajectory.muscle_length - trajectory.muscle_length[0]
    ahead = needed - fastest_payout(limits, step_count, time_step)
    return frozen(np.where(kept, 0.0, np.maximum(ahead.max(axis=0), 0.0)))
