"""A muscle model whose lengths and Jacobian were corrected from recorded swings."""

import hashlib
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import mujoco

from fastswing_planner.arrays import Matrix, Vector, frozen
from fastswing_planner.robot.length_correction import LengthCorrection
from fastswing_planner.robot.mujoco_model import MujocoMuscleModel


class LearnedMuscleModel(MujocoMuscleModel):
    """Joints, masses and gravity as in the MJCF, muscle lengths with their correction.

    `lengths`, `jacobian` and `muscle_velocity` raise OutOfRange far from the recorded postures.
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

    def muscle_velocity(
        self, joint_position: Sequence[float], joint_velocity: Sequence[float]
    ) -> list[float]:
        """Return dl/dt [m/s] of the m muscles."""
        corrected: list[float] = self.jacobian(frozen(joint_position)).dot(joint_velocity).tolist()
        return corrected


def mjcf_hash(path: Path) -> str:
    """Return what tells one MJCF, with all that it includes, from another; empty if unreadable."""
    try:
        content = b"".join(part.read_bytes() for part in _with_includes(path))
    except (OSError, ElementTree.ParseError):
        return ""
    return hashlib.sha256(content).hexdigest()


def _with_includes(path: Path) -> list[Path]:
    """Return an MJCF file and those it includes; MuJoCo seeks them from the first one's folder."""
    found = [path]
    for part in found:  # which grows
        for element in ElementTree.parse(part).iter("include"):
            included = path.parent / element.get("file", "")
            if included not in found:
                found.append(included)
    return found
