"""A muscle model whose lengths and Jacobian were corrected from recorded swings."""

import hashlib
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

from fastswing_planner.arrays import Matrix, Vector, frozen, read_only
from fastswing_planner.robot.length_correction import LengthCorrection
from fastswing_planner.robot.mujoco_model import MujocoMuscleModel
from fastswing_planner.robot.muscle_model import Payload


class LearnedMuscleModel:
    """Joints, masses and gravity as in the MJCF, muscle lengths with their correction.

    Implements MuscleModel. `lengths`, `jacobian` and `muscle_velocity` raise OutOfRange far from
    the recorded postures.

    plain       the MJCF's own model, without correction
    correction  of the same joints and muscles, in the same order
    """

    def __init__(self, plain: MujocoMuscleModel, correction: LengthCorrection) -> None:
        self.plain, self.correction = plain, correction
        self.joint_names, self.muscle_names = plain.joint_names, plain.muscle_names
        self.joint_lower, self.joint_upper = plain.joint_lower, plain.joint_upper
        self.body_names = plain.body_names

    def lengths(self, joint_position: Vector) -> Vector:
        """Return the muscles' path lengths [m], shape (m,)."""
        return read_only(
            self.plain.lengths(joint_position) + self.correction.lengths(joint_position)
        )

    def jacobian(self, joint_position: Vector) -> Matrix:
        """Return G(theta) [m/rad], shape (m, n)."""
        return read_only(
            self.plain.jacobian(joint_position) + self.correction.jacobian(joint_position)
        )

    def muscle_velocity(
        self, joint_position: Sequence[float], joint_velocity: Sequence[float]
    ) -> list[float]:
        """Return dl/dt [m/s] of the m muscles."""
        corrected: list[float] = self.jacobian(frozen(joint_position)).dot(joint_velocity).tolist()
        return corrected

    def gravity_torque(self, joint_position: Vector, payload: Payload | None = None) -> Vector:
        """Return the joint torque that holds the arm at rest [N m], shape (n,)."""
        return self.plain.gravity_torque(joint_position, payload)

    def full_position(self, joint_position: Vector) -> Vector:
        """Return MuJoCo's `qpos` of a posture: all joints of the MJCF, shape (nq,)."""
        return self.plain.full_position(joint_position)

    def held_joints(self) -> dict[str, float]:
        """Return the hinge and slide joints that are left out, and where they stay [rad, m]."""
        return self.plain.held_joints()


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
