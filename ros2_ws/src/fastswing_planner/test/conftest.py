"""Small arms to test the mathematics on, and the Musashi-like one."""

from collections.abc import Callable
from pathlib import Path

import pytest

from fastswing_planner.robot.description import Robot, load_robot
from fastswing_planner.robot.muscle_model import MuscleModel
from fastswing_planner.testing.arms import LinearArm

DESCRIPTION = "musashi_muscle_bridge/description/musashi_left_arm.yaml"


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
