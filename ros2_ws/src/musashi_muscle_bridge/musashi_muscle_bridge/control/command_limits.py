"""What may be commanded of a muscle, from the robot's description."""

from dataclasses import dataclass

import numpy as np

from fastswing_planner.arrays import Vector, frozen
from fastswing_planner.robot.description import Robot
from fastswing_planner.robot.muscle_model import MuscleModel


@dataclass(frozen=True)
class CommandLimits:
    """What commands are clamped to; vectors of shape (m,).

    length_min, length_max  [m]
    tension_max             [N] of a tension command
    tension_limit           [N] above it the boards pay out
    current_max             [A] of a current command; less than 0 would wind the wire off its drum
    velocity                [m/s] of re-engaging, and of winding in by a current
    stream_timeout          [s] without a tension or current command until the muscle holds
    max_lease               [s]
    """

    length_min: Vector
    length_max: Vector
    tension_max: Vector
    tension_limit: Vector
    current_max: Vector
    velocity: Vector
    stream_timeout: float
    max_lease: float


_MAX_CORNER_JOINTS = 8  # all corners of the travel up to here, as many drawn ones beyond


def length_range(model: MuscleModel, count: int = 400) -> tuple[Vector, Vector]:
    """Return the shortest and longest path [m] of each muscle, both shape (m,), over the travel.

    count  number of postures sampled, the same ones each time
    """
    low = np.maximum(model.joint_lower, -np.pi)
    high = np.minimum(model.joint_upper, np.pi)
    random = np.random.default_rng(0)
    fractions = random.uniform(size=(count, low.size))
    if low.size <= _MAX_CORNER_JOINTS:
        corners = np.array(np.meshgrid(*[[0.0, 1.0]] * low.size)).T.reshape(-1, low.size)
    else:
        corners = random.integers(0, 2, size=(2**_MAX_CORNER_JOINTS, low.size)).astype(float)
    samples = low + np.vstack([fractions, corners]) * (high - low)
    lengths = np.array([model.lengths(sample) for sample in samples])
    return frozen(lengths.min(axis=0)), frozen(lengths.max(axis=0))


def command_limits(
    robot: Robot, stream_timeout: float, max_lease: float, payout_allowance: float
) -> CommandLimits:
    """Return what commands to a robot are clamped to.

    payout_allowance  [m] of slack beyond the longest path; Method 2 needs some
    """
    shortest, longest = length_range(robot.model)
    return CommandLimits(
        length_min=frozen(shortest - robot.tension_limit / robot.wire_stiffness),
        length_max=frozen(longest + payout_allowance),
        tension_max=robot.limits.tension_max,
        tension_limit=robot.tension_limit,
        current_max=robot.current_limit,
        velocity=robot.limits.velocity,
        stream_timeout=stream_timeout,
        max_lease=max_lease,
    )
