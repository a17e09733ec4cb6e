"""A muscle model read from an MJCF file."""

from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np

from fastswing_planner.arrays import Matrix, Vector, frozen, unique_known
from fastswing_planner.errors import InvalidRequest, RobotDescriptionError
from fastswing_planner.muscle_model import Payload

_SINGLE_AXIS = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))


def load_mjcf(path: Path) -> mujoco.MjModel:
    """Compile an MJCF file; raises RobotDescriptionError naming the file."""
    try:
        return mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise RobotDescriptionError(f"{path}: not a usable MJCF: {error}") from error


def object_names(model: mujoco.MjModel, kind: mujoco.mjtObj, count: int) -> list[str]:
    """Return the names of all `count` objects of one kind, in the model's order."""
    return [mujoco.mj_id2name(model, kind, index) or "" for index in range(count)]


class MujocoMuscleModel:
    """Kinematics and statics of chosen joints and tendons of a MuJoCo model.

    Implements MuscleModel. Joints that are not chosen stay at the model's reference position.
    """

    def __init__(
        self, model: mujoco.MjModel, joint_names: Sequence[str], muscle_names: Sequence[str]
    ) -> None:
        """Choose joints and muscles by name; raises RobotDescriptionError for names not there."""
        self._model = model
        self._data = mujoco.MjData(model)
        self.joint_names = tuple(joint_names)
        self.muscle_names = tuple(muscle_names)
        all_joints = object_names(model, mujoco.mjtObj.mjOBJ_JOINT, model.njnt)
        all_tendons = object_names(model, mujoco.mjtObj.mjOBJ_TENDON, model.ntendon)
        self._bodies = object_names(model, mujoco.mjtObj.mjOBJ_BODY, model.nbody)
        try:
            joints = np.array(unique_known("joint", self.joint_names, all_joints), dtype=int)
            self._tendons = np.array(unique_known("muscle", self.muscle_names, all_tendons), int)
        except InvalidRequest as error:
            raise RobotDescriptionError(f"the MJCF does not fit: {error}") from error
        for name, joint in zip(self.joint_names, joints, strict=True):
            if int(model.jnt_type[joint]) not in _SINGLE_AXIS:
                raise RobotDescriptionError(f"joint '{name}' is not a hinge or slide joint")
        self._qpos_index = model.jnt_qposadr[joints]
        self._dof_index = model.jnt_dofadr[joints]
        self._chosen_entries = np.ix_(self._tendons, self._dof_index)
        limited = model.jnt_limited[joints].astype(bool)
        self.joint_lower = frozen(np.where(limited, model.jnt_range[joints, 0], -np.inf))
        self.joint_upper = frozen(np.where(limited, model.jnt_range[joints, 1], np.inf))

    def _update(self, joint_position: Vector) -> None:
        self._data.qpos[self._qpos_index] = joint_position
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)

    def lengths(self, joint_position: Vector) -> Vector:
        """Return the muscles' path lengths [m], shape (m,)."""
        self._update(joint_position)
        mujoco.mj_tendon(self._model, self._data)
        return frozen(self._data.ten_length[self._tendons])

    def jacobian(self, joint_position: Vector) -> Matrix:
        """Return G(theta) [m/rad], shape (m, n)."""
        self._update(joint_position)
        mujoco.mj_tendon(self._model, self._data)
        dense = tendon_jacobian(self._model, self._data)
        return frozen(dense[self._chosen_entries])

    def gravity_torque(self, joint_position: Vector, payload: Payload | None = None) -> Vector:
        """Return the joint torque that holds the arm at rest [N m], shape (n,)."""
        self._update(joint_position)
        bias = np.zeros(self._model.nv)
        mujoco.mj_rne(self._model, self._data, 0, bias)
        torque = bias[self._dof_index]
        if payload is not None and payload.mass:
            torque = torque + self._payload_torque(payload)
        return frozen(torque)

    def _payload_torque(self, payload: Payload) -> Vector:
        # tau = -J^T m g: what the joints must add to carry the weight.
        (body,) = unique_known("body", [payload.body], self._bodies)
        rotation = self._data.xmat[body].reshape(3, 3)
        point = self._data.xpos[body] + rotation @ np.array(payload.position)
        jacobian = np.zeros((3, self._model.nv))
        mujoco.mj_jac(self._model, self._data, jacobian, None, point, body)
        weight = payload.mass * self._model.opt.gravity
        return -(jacobian.T @ weight)[self._dof_index]


def tendon_jacobian(model: mujoco.MjModel, data: mujoco.MjData) -> Matrix:
    """Return d length / d dof of all tendons [m/rad], shape (ntendon, nv).

    MuJoCo stores it sparse, one row per tendon (since 3.17; the index arrays are the model's).
    """
    dense = np.zeros((model.ntendon, model.nv))
    mujoco.mju_sparse2dense(
        dense, data.ten_J, model.ten_J_rownnz, model.ten_J_rowadr, model.ten_J_colind
    )
    return dense
