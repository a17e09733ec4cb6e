"""What the mathematics needs to know of an arm."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from fastswing_planner.arrays import Matrix, Vector

SMALLEST_MOMENT_ARM = 1e-9
"""[m/rad] Less is round-off: such a muscle does not move."""


@dataclass(frozen=True)
class Payload:
    """A point mass held by a body.

    mass      [kg]
    body      name of the body that carries it
    position  [m] in that body's frame, shape (3,)
    """

    mass: float
    body: str
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)


class MuscleModel(Protocol):
    """Kinematics and statics of n joints and m muscles.

    A model need not be safe to call from several threads at once.
    """

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the n joints."""

    @property
    def muscle_names(self) -> tuple[str, ...]:
        """Names of the m muscles."""

    @property
    def joint_lower(self) -> Vector:
        """Lower end of each joint's range [rad], shape (n,); -inf if unlimited."""

    @property
    def joint_upper(self) -> Vector:
        """Upper end of each joint's range [rad], shape (n,); inf if unlimited."""

    def lengths(self, joint_position: Vector) -> Vector:
        """Return l = h(theta) (eq. 1 of the paper) [m], shape (m,)."""

    def jacobian(self, joint_position: Vector) -> Matrix:
        """Return G(theta), dl = G dtheta (eq. 2 of the paper) [m/rad], shape (m, n)."""

    def muscle_velocity(
        self, joint_position: Sequence[float], joint_velocity: Sequence[float]
    ) -> list[float]:
        """Return dl/dt = G(theta) dtheta/dt (eq. 2 of the paper) [m/s] of the m muscles.

        One that does not move may show round-off. Plain numbers in and out: at the rate of the
        inhibitor, numpy costs more than it saves.
        """

    def gravity_torque(self, joint_position: Vector, payload: Payload | None = None) -> Vector:
        """Return the joint torque [N m] that holds the arm at rest, shape (n,).

        This is tau^nec of eq. 6 of the paper. Raises UnknownName for the payload's body.
        """
