"""Muscle models that are computed by hand, in place of an MJCF."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from fastswing_planner.arrays import Matrix, Vector, frozen
from fastswing_planner.errors import UnknownName
from fastswing_planner.robot.muscle_model import Payload


class BentArm:
    """An arm given by two functions, whose weight is the same in every posture.

    Implements MuscleModel. Joints are j0, j1, ..., muscles m0, m1, ...; a payload on the body
    `hand`, the only one, adds mass * 1 N m/kg to each joint.
    """

    def __init__(
        self,
        lengths: Callable[[Vector], ArrayLike],
        jacobian: Callable[[Vector], ArrayLike],
        joint_count: int,
        joint_range: float = np.inf,
        torque: ArrayLike = 0.0,
    ) -> None:
        """Take theta [rad], shape (n,), to the muscles' lengths and their derivative.

        lengths      returns l [m], shape (m,)
        jacobian     returns dl / dtheta [m/rad], shape (m, n); it is not checked against `lengths`
        joint_count  n
        joint_range  [rad] each joint moves so far to both sides of zero
        torque       [N m] that holds the arm at rest, one for all joints or shape (n,)
        """
        self._lengths, self._jacobian = lengths, jacobian
        self._torque = frozen(np.broadcast_to(torque, joint_count))
        muscle_count = np.size(lengths(np.zeros(joint_count)))
        self.joint_names = tuple(f"j{index}" for index in range(joint_count))
        self.muscle_names = tuple(f"m{index}" for index in range(muscle_count))
        self.joint_lower = frozen(np.full(joint_count, -joint_range))
        self.joint_upper = frozen(np.full(joint_count, joint_range))

    def lengths(self, joint_position: Vector) -> Vector:
        """Return the muscles' lengths [m], shape (m,)."""
        return frozen(self._lengths(joint_position))

    def jacobian(self, joint_position: Vector) -> Matrix:
        """Return G(theta) [m/rad], shape (m, n)."""
        return frozen(self._jacobian(joint_position))

    def muscle_velocity(
        self, joint_position: Sequence[float], joint_velocity: Sequence[float]
    ) -> list[float]:
        """Return dl/dt [m/s] of the m muscles."""
        speeds: list[float] = self.jacobian(np.array(joint_position)).dot(joint_velocity).tolist()
        return speeds

    def gravity_torque(self, joint_position: Vector, payload: Payload | None = None) -> Vector:
        """Return the joint torque [N m] that holds the arm at rest, shape (n,).

        Raises UnknownName for a payload on another body than `hand`.
        """
        if payload is not None and payload.body != "hand":
            raise UnknownName(f"unknown body '{payload.body}', choose from: hand")
        return frozen(self._torque + (0.0 if payload is None else payload.mass))


class LinearArm(BentArm):
    """A BentArm with constant moment arms: muscle lengths are l = G theta."""

    def __init__(
        self, muscle_jacobian: ArrayLike, joint_range: float = np.inf, torque: ArrayLike = 0.0
    ) -> None:
        """Take G [m/rad], shape (m, n); the rest as in BentArm."""
        constant = frozen(muscle_jacobian)
        super().__init__(
            lambda joint_position: constant @ joint_position,
            lambda joint_position: constant,
            constant.shape[1],
            joint_range,
            torque,
        )
