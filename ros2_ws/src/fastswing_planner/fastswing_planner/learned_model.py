"""A muscle model whose lengths and Jacobian were corrected from recorded swings."""

import hashlib
from pathlib import Path

import mujoco

from fastswing_planner.arrays import Matrix, Vector, frozen
from fastswing_planner.length_correction import LengthCorrection
from fastswing_planner.mujoco_model import MujocoMuscleModel


class LearnedMuscleModel(MujocoMuscleModel):
    """Joints, masses and gravity as in the MJCF, muscle lengths with their correction.

    `lengths` and `jacobian` raise OutOfRange far from the recorded postures.
    """

    correction: LengthCorrection | None = None

    def __init__(
        self, model: mujoco.MjModel, correction: LengthCorrection, keyframe: str = ""
    ) -> None:
        """Choose the joints and muscles that the correction names."""
        super().__init__(model, correction.joint_names, correction.muscle_names, keyframe)
        self.correction = correction

    def lengths(self, joint_position: Vector) -> Vector:
        """Return the muscles' path lengths [m], shape (m,)."""
        plain = super().lengths(joint_position)
        if self.correction is None:  # the MJCF is being checked
            return plain
        return frozen(plain + self.correction.lengths(joint_position))

    def jacobian(self, joint_position: Vector) -> Matrix:
        """Return G(theta) [m/rad], shape (m, n)."""
        plain = super().jacobian(joint_position)
        if self.correction is None:
            return plain
        return frozen(plain + self.correction.jacobian(joint_position))


def mjcf_hash(path: Path) -> str:
    """Return what tells one MJCF file from another; empty if it cannot be read."""
    try:
        return hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError:
        return ""
