"""Which muscles restrain a motion, and how much."""

import math
from collections.abc import Sequence

from fastswing_planner.arrays import Matrix, Vector, made_frozen
from fastswing_planner.errors import StartEqualsEnd
from fastswing_planner.muscle_model import SMALLEST_MOMENT_ARM, MuscleModel


def moment_arm(muscle_jacobian: Matrix, direction: Vector) -> Vector:
    """Return r [m/rad], shape (m,): positive = antagonist, negative = agonist.

    muscle_jacobian  G(theta) [m/rad], shape (m, n)
    direction        theta_dot or any vector along it, shape (n,)

    Raises StartEqualsEnd for a zero direction, which has no moment arm.
    """
    norm = math.hypot(*direction.tolist())  # of short vectors a third of numpy's time
    _refuse_zero(norm)
    # r = G(theta) theta_dot / |theta_dot|_2  (eq. 3 of the paper)
    return made_frozen(muscle_jacobian.dot(direction) / norm)


def speed_index(muscle_moment_arm: Vector, velocity_limit: Vector) -> Vector:
    """Return q [s/rad], shape (m,): the larger, the sooner a muscle reaches its speed limit.

    muscle_moment_arm  r [m/rad], shape (m,)
    velocity_limit     l_dot^limit [m/s], shape (m,), positive
    """
    # q = r (/) l_dot^limit  (eq. 4 of the paper)
    return made_frozen(muscle_moment_arm / velocity_limit)


def moving_speed_index(
    lengthening: Sequence[float], speed: float, velocity_limit: Sequence[float]
) -> tuple[float, ...]:
    """Return q [s/rad] of m muscles while the arm moves, as plain numbers; 0 if one does not move.

    lengthening     dl/dt = G(theta) theta_dot [m/s]
    speed           |theta_dot|_2 [rad/s]
    velocity_limit  l_dot^limit [m/s], positive

    Raises StartEqualsEnd for a zero speed.
    """
    _refuse_zero(speed)
    # r = G(theta) theta_dot / |theta_dot|_2,  q = r (/) l_dot^limit  (eq. 3 and 4 of the paper)
    least = SMALLEST_MOMENT_ARM * speed
    pairs = zip(lengthening, velocity_limit, strict=True)
    return tuple(
        [0.0 if -least < rate < least else rate / speed / limit for rate, limit in pairs]
    )


def _refuse_zero(speed: float) -> None:
    if not speed > 0.0:
        raise StartEqualsEnd("the direction of motion is zero, so no moment arm is defined")


def swing_speed_index(
    model: MuscleModel, start: Vector, end: Vector, velocity_limit: Vector
) -> Vector:
    """Return q [s/rad], shape (m,), of the swing from `start` to `end` [rad], both shape (n,)."""
    # q = r((theta_start + theta_end) / 2, theta_end - theta_start) (/) l_dot^limit  (eq. 4)
    muscle_jacobian = model.jacobian((start + end) / 2.0)
    return speed_index(moment_arm(muscle_jacobian, end - start), velocity_limit)
