"""What the robot's motors may do, and which muscles went beyond it."""

from dataclasses import dataclass

import numpy as np

from fastswing_planner.analysis.measured_swing import MeasuredSwing
from fastswing_planner.robot.description import Robot

TOLERANCE = 0.01
"""Share by which a measured speed may exceed a limit that the motor just keeps."""


@dataclass(frozen=True)
class MotorLimit:
    """Of one muscle.

    velocity       [m/s] l_dot^limit of the paper
    tension_max    [N] a plan never asks for more
    tension_limit  [N] above it the boards pay out
    """

    velocity: float
    tension_max: float
    tension_limit: float


MotorLimits = dict[str, MotorLimit]
"""By muscle; empty: the robot is not known."""


def motor_limits(robot: Robot) -> MotorLimits:
    """Return the limits in a robot's description."""
    rows = zip(
        robot.model.muscle_names,
        robot.limits.velocity.tolist(),
        robot.limits.tension_max.tolist(),
        robot.tension_limit.tolist(),
        strict=True,
    )
    return {name: MotorLimit(*values) for name, *values in rows}


def beyond_velocity(swing: MeasuredSwing, limits: MotorLimits) -> tuple[str, ...]:
    """Return the muscles that were faster than their limit."""
    return tuple(
        muscle.name
        for muscle in swing.muscles
        if muscle.name in limits
        and muscle.peak_speed > limits[muscle.name].velocity * (1.0 + TOLERANCE)
    )


def beyond_tension(swing: MeasuredSwing, limits: MotorLimits) -> tuple[str, ...]:
    """Return the muscles that pulled harder than the boards allow."""
    return tuple(
        muscle.name
        for muscle in swing.muscles
        if muscle.name in limits and muscle.peak_tension > limits[muscle.name].tension_limit
    )


def limits_known(swing: MeasuredSwing, limits: MotorLimits) -> bool:
    """Return whether of all its muscles limits and peaks are known, and there are any."""
    return bool(swing.muscles) and all(
        muscle.name in limits and np.isfinite([muscle.peak_speed, muscle.peak_tension]).all()
        for muscle in swing.muscles
    )


def drawn_limits(swing: MeasuredSwing, limits: MotorLimits, figure: str) -> list[float]:
    """Return the different limits of a swing's muscles, rising; `figure` names the limit."""
    values = [getattr(limits[one.name], figure) for one in swing.muscles if one.name in limits]
    return np.unique(np.array(values, dtype=float)).tolist()
