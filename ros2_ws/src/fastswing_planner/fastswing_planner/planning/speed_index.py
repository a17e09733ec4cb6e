"""Which muscles restrain a motion, and how much."""

import math
from collections.abc import Sequence

import numpy as np

from fastswing_planner.arrays import Matrix, Vector, read_only
from fastswing_planner.errors import StartEqualsEnd
from fastswing_planner.robot.muscle_model import SMALLEST_MOMENT_ARM, MuscleModel


def moment_arm(muscle_jacobian: Matrix, direction: Vector) -> Vector:
    """Return r [m/rad], shape (m,): positive = antagonist, negative = agonist.

    muscle_jacobian  G(theta) [m/rad], shape (m, n)
    direction        theta_dot or any vector along it, shape (n,)

    Raises StartEqualsEnd for a zero direction, which has no moment arm.
    """
    norm = math.hypot(*direction.tolist())  # of short vectors a third of numpy's time
    _refuse_zero(norm)
    # r = G(theta) theta_dot / |theta_dot|_2  (eq. 3 of the paper)
    return read_only(muscle_jacobian.dot(direction) / norm)


def speed_index(muscle_moment_arm: Vector, velocity_limit: Vector) -> Vector:
    """Return q [s/rad], shape (m,): the larger, the sooner a muscle reaches its speed limit.

    muscle_moment_arm  r [m/rad], shape (m,)
    velocity_limit     l_dot^limit [m/s], shape (m,), positive
    """
    # q = r (/) l_dot^limit  (eq. 4 of the paper)
    return read_only(muscle_moment_arm / velocity_limit)


def unit_direction(direction: Sequence[float], norm: float) -> list[float]:
    """Return theta_dot / |theta_dot|_2, along which muscles lengthen by their moment arms (eq. 3).

    norm  |theta_dot|_2; raises StartEqualsEnd for a zero one
    """
    _refuse_zero(norm)
    return [component / norm for component in direction]


def plain_speed_index(
    muscle_moment_arm: Sequence[float], velocity_limit: Sequence[float]
) -> tuple[float, ...]:
    """Return `speed_index` from and to plain numbers; 0 of a muscle that does not move."""
    # q = r (/) l_dot^limit  (eq. 4 of the paper)
    pairs = zip(muscle_moment_arm, velocity_limit, strict=True)
    least = SMALLEST_MOMENT_ARM
    return tuple([0.0 if -least < arm < least else arm / limit for arm, limit in pairs])


def greatest_moment_arm(threshold: float, velocity_limit: Vector) -> Vector:
    """Return the greatest r [m/rad], shape (m,), at which `plain_speed_index` is not above C.

    threshold       C [s/rad], 0 or a normal number
    velocity_limit  l_dot^limit [m/s], shape (m,), positive and finite
    """
    # r <= C l_dot^limit; rounding may have moved the product by one number.
    arm = threshold * velocity_limit
    arm = np.where(arm / velocity_limit > threshold, np.nextafter(arm, -np.inf), arm)
    above = np.nextafter(arm, np.inf)
    arm = np.where(above / velocity_limit > threshold, arm, above)
    return np.maximum(arm, np.nextafter(SMALLEST_MOMENT_ARM, 0.0))


def _refuse_zero(norm: float) -> None:
    if not norm > 0.0:
        raise StartEqualsEnd("the direction of motion is zero, so no moment arm is defined")


def swing_speed_index(
    model: MuscleModel, start: Vector, end: Vector, velocity_limit: Vector
) -> Vector:
    """Return q [s/rad], shape (m,), of the swing from `start` to `end` [rad], both shape (n,)."""
    # q = r((theta_start + theta_end) / 2, theta_end - theta_start) (/) l_dot^limit  (eq. 4)
    muscle_jacobian = model.jacobian((start + end) / 2.0)
    return speed_index(moment_arm(muscle_jacobian, end - start), velocity_limit)
