"""Small arms to test the mathematics on, and the Musashi-like one."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import ArrayLike

from fastswing_planner.arrays import Matrix, Vector, frozen
from fastswing_planner.errors import UnknownName
from fastswing_planner.robot.description import Robot, load_robot
from fastswing_planner.robot.muscle_model import MuscleModel, Payload

DESCRIPTION = "musashi_muscle_bridge/description/musashi_left_arm.yaml"


class LinearArm:
    """An arm whose muscle lengths are l = G theta and whose weight is the same in every posture.

    Joints are j0, j1, ..., muscles m0, m1, ...; a payload pulls each joint with mass * 1 N m/kg.
    """

    def __init__(
        self, muscle_jacobian: ArrayLike, joint_range: float = np.inf, torque: ArrayLike = 0.0
    ) -> None:
        self._jacobian = frozen(muscle_jacobian)
        muscle_count, joint_count = self._jacobian.shape
        self._torque = frozen(np.broadcast_to(torque, joint_count))
        self.joint_names = tuple(f"j{index}" for index in range(joint_count))
        self.muscle_names = tuple(f"m{index}" for index in range(muscle_count))
        self.joint_lower = frozen(np.full(joint_count, -joint_range))
        self.joint_upper = frozen(np.full(joint_count, joint_range))

    def lengths(self, joint_position: Vector) -> Vector:
        return frozen(self._jacobian @ joint_position)

    def jacobian(self, joint_position: Vector) -> Matrix:
        return self._jacobian

    def muscle_velocity(
        self, joint_position: Sequence[float], joint_velocity: Sequence[float]
    ) -> list[float]:
        speeds: list[float] = self.jacobian(np.array(joint_position)).dot(joint_velocity).tolist()
        return speeds

    def gravity_torque(self, joint_position: Vector, payload: Payload | None = None) -> Vector:
        if payload is not None and payload.body != "hand":
            raise UnknownName(f"unknown body '{payload.body}', choose from: hand")
        return frozen(self._torque + (0.0 if payload is None else payload.mass))


@pytest.fixture(scope="session")
def linear_arm() -> Callable[..., MuscleModel]:
    """Build a LinearArm from its G [m/rad], its joints' range [rad] and its weight [N m]."""
    return LinearArm


@pytest.fixture(scope="session")
def description_path() -> Path:
    """Return where the Musashi-like arm is described."""
    return Path(__file__).parents[2] / DESCRIPTION


@pytest.fixture(scope="session")
def musashi(description_path: Path) -> Robot:
    """Load the Musashi-like left arm."""
    return load_robot(description_path)
