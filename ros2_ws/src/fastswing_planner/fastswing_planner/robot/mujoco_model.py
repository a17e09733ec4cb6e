"""A muscle model read from an MJCF file."""

import struct
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from fastswing_planner.arrays import Matrix, Vector, contiguous, frozen, read_only, unique_known
from fastswing_planner.errors import RobotDescriptionError
from fastswing_planner.robot.joint_coupling import JointCoupling, refuse_restrained_joints
from fastswing_planner.robot.mjcf_names import (
    SINGLE_AXIS,
    joint_indices,
    object_names,
    reference_position,
    tendon_indices,
)
from fastswing_planner.robot.muscle_model import SMALLEST_MOMENT_ARM, Payload

_SHORTEST = 1e-6  # [m]


def load_mjcf(path: Path) -> mujoco.MjModel:
    """Compile an MJCF file; raises RobotDescriptionError naming the file."""
    try:
        return mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise RobotDescriptionError(f"{path}: not a usable MJCF: {error}") from error


def sparse_places(model: mujoco.MjModel) -> NDArray[np.int_]:
    """Return where `ten_J` has each tendon and dof, shape (ntendon, nv); -1: nowhere.

    MuJoCo stores it sparse, one row per tendon (since 3.17), with the model's own indices.
    """
    places = np.full((model.ntendon, model.nv), -1)
    for row, first, count in zip(places, model.ten_J_rowadr, model.ten_J_rownnz, strict=True):
        there = np.arange(first, first + count)
        row[model.ten_J_colind[there]] = there
    return places


class MujocoMuscleModel:
    """Kinematics and statics of chosen joints and tendons of a MuJoCo model.

    Implements MuscleModel. Joints that an equality constraint ties to a chosen joint follow it;
    all others stay where `keyframe` has them, or at zero. Actuators and contacts are ignored;
    springs of joints and tendons and gravity compensation count in `gravity_torque`.

    body_names  names of the bodies that can carry a payload
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        joint_names: Sequence[str],
        muscle_names: Sequence[str],
        keyframe: str = "",
    ) -> None:
        """Choose joints and muscles by name.

        keyframe  of the MJCF, holds the joints that are not chosen; empty: they are at zero

        Raises RobotDescriptionError for a model without tendons, a name that is not there, a
        joint that is not free or that no muscle moves, a muscle without length.
        """
        self._model = model
        self._data = mujoco.MjData(model)
        self._moving = mujoco.MjData(model)  # joints here have speeds
        self._computed = b""
        self.joint_names = tuple(joint_names)
        self.muscle_names = tuple(muscle_names)
        bodies = object_names(model, mujoco.mjtObj.mjOBJ_BODY, model.nbody)
        self.body_names = tuple(name for name in bodies if name)
        self._tendons = contiguous(tendon_indices(model, self.muscle_names))
        joints = joint_indices(model, self.joint_names)
        limited = model.jnt_limited[joints].astype(bool)
        self.joint_lower = frozen(np.where(limited, model.jnt_range[joints, 0], -np.inf))
        self.joint_upper = frozen(np.where(limited, model.jnt_range[joints, 1], np.inf))
        self._dofs = contiguous(model.jnt_dofadr[joints])
        reference = reference_position(model, keyframe)
        self._coupling = JointCoupling(model, joints, reference)
        self._prepare_jacobian()
        self._prepare_muscle_velocity(contiguous(model.jnt_qposadr[joints]), reference)
        postures = self._probe_postures(reference[model.jnt_qposadr[joints]])
        for posture in postures:
            refuse_restrained_joints(model, self._coupling, posture)
        self._refuse_useless_muscles_and_joints(postures)

    def _prepare_jacobian(self) -> None:
        # Views of MuJoCo's memory: looked up once.
        self._qpos, self._path_length = self._data.qpos, self._data.ten_length
        # A model whose tendons move nothing has no element at all; one is taken in any case.
        self._sparse_arms = self._data.ten_J if self._data.ten_J.size else np.zeros(1)
        places = sparse_places(self._model)[self._tendons]
        if not self._coupling.followers:
            places = places[:, self._dofs]
        self._absent, self._places = places < 0, np.maximum(places, 0)
        self._smallest = np.full(
            (len(self.muscle_names), len(self.joint_names)), SMALLEST_MOMENT_ARM
        )
        if not self._coupling.followers:
            self._smallest[self._absent] = np.inf  # whatever stands there is another element's

    def _prepare_muscle_velocity(
        self, qpos_places: NDArray[np.int_] | slice, reference: Vector
    ) -> None:
        moving = self._moving
        moving.qpos[:] = reference
        # struct takes plain numbers quicker than numpy.
        self._moving_qpos, self._moving_qvel = moving.qpos.data, moving.qvel.data
        self._path_speed = moving.ten_velocity
        self._in_a_row: tuple[int, int] | None = None  # where in qpos and qvel [bytes]
        if (
            isinstance(qpos_places, slice)
            and isinstance(self._dofs, slice)
            and not self._coupling.followers
        ):
            size = struct.calcsize("d")
            self._in_a_row = size * qpos_places.start, size * self._dofs.start
        self._put = struct.Struct(f"{len(self.joint_names)}d").pack_into

    def full_position(self, joint_position: Vector) -> Vector:
        """Return MuJoCo's `qpos` of a posture: all joints of the MJCF, shape (nq,)."""
        self._computed = b""
        self._coupling.set_positions(self._qpos, joint_position)
        return frozen(self._data.qpos)

    def held_joints(self) -> dict[str, float]:
        """Return the hinge and slide joints that are left out, and where they stay [rad, m]."""
        qpos = self.full_position(np.zeros(len(self.joint_names)))
        names = object_names(self._model, mujoco.mjtObj.mjOBJ_JOINT, self._model.njnt)
        return {
            name: float(qpos[self._model.jnt_qposadr[joint]])
            for joint, name in enumerate(names)
            if int(self._model.jnt_type[joint]) in SINGLE_AXIS
            and name
            and name not in self.joint_names
            and joint not in self._coupling.followers
        }

    def _update(self, joint_position: Vector) -> Matrix:
        """Compute positions and tendons; return d qvel / d joint velocity, shape (nv, n)."""
        # A swing asks for lengths and Jacobian of each of its postures.
        wanted = np.asarray(joint_position, dtype=float).tobytes()
        if wanted != self._computed:
            self._computed = b""  # whatever raises here leaves nothing computed
            self._rates = self._coupling.set_positions(self._qpos, joint_position)
            mujoco.mj_kinematics(self._model, self._data)
            mujoco.mj_comPos(self._model, self._data)
            mujoco.mj_tendon(self._model, self._data)
            self._computed = wanted
        return self._rates

    def lengths(self, joint_position: Vector) -> Vector:
        """Return the muscles' path lengths [m], shape (m,)."""
        self._update(joint_position)
        return frozen(self._path_length[self._tendons])

    def jacobian(self, joint_position: Vector) -> Matrix:
        """Return G(theta) [m/rad], shape (m, n); exactly 0 where a muscle does not move."""
        rates = self._update(joint_position)
        arms = self._sparse_arms.take(self._places)
        if self._coupling.followers:
            arms[self._absent] = 0.0
            arms = arms @ rates
        arms[np.abs(arms) < self._smallest] = 0.0
        return read_only(arms)

    def muscle_velocity(
        self, joint_position: Sequence[float], joint_velocity: Sequence[float]
    ) -> list[float]:
        """Return dl/dt [m/s] of the m muscles."""
        model, data = self._model, self._moving
        if self._in_a_row is not None:
            positions, velocities = self._in_a_row
            self._put(self._moving_qpos, positions, *joint_position)
            self._put(self._moving_qvel, velocities, *joint_velocity)
        else:
            rates = self._coupling.set_positions(data.qpos, joint_position)
            data.qvel[:] = rates @ joint_velocity
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_tendon(model, data)
        mujoco.mj_fwdVelocity(model, data)
        speeds: list[float] = self._path_speed[self._tendons].tolist()
        return speeds

    def gravity_torque(self, joint_position: Vector, payload: Payload | None = None) -> Vector:
        """Return the joint torque that holds the arm at rest [N m], shape (n,)."""
        rates = self._update(joint_position)
        mujoco.mj_passive(self._model, self._data)
        torque = np.zeros(self._model.nv)
        mujoco.mj_rne(self._model, self._data, 0, torque)
        torque -= self._data.qfrc_passive
        if payload is not None and payload.mass:
            torque += self._payload_torque(payload)
        return frozen(rates.T @ torque)

    def _payload_torque(self, payload: Payload) -> Vector:
        # tau = -J^T m g: what the joints must add to carry the weight.
        unique_known("body", [payload.body], self.body_names)
        body = mujoco.mj_name2id(self._model, mujoco.mjtObj.mjOBJ_BODY, payload.body)
        point = self._data.xpos[body] + self._data.xmat[body].reshape(3, 3) @ np.array(
            payload.position
        )
        jacobian = np.zeros((3, self._model.nv))
        mujoco.mj_jac(self._model, self._data, jacobian, None, point, body)
        weight = payload.mass * self._model.opt.gravity
        return np.asarray(-(jacobian.T @ weight))

    def _probe_postures(self, reference: Vector) -> list[Vector]:
        # One posture may be special: a muscle along a stretched arm has no moment arm just there.
        low = np.where(np.isfinite(self.joint_lower), self.joint_lower, reference - 1.0)
        high = np.where(np.isfinite(self.joint_upper), self.joint_upper, reference + 1.0)
        return [np.clip(reference, low, high), *(low + part * (high - low) for part in (0.3, 0.7))]

    def _refuse_useless_muscles_and_joints(self, postures: Sequence[Vector]) -> None:
        spatial = self._model.wrap_type[self._model.tendon_adr[self._tendons]] != int(
            mujoco.mjtWrap.mjWRAP_JOINT
        )
        lengths = np.array([self.lengths(posture) for posture in postures]).min(axis=0)
        for name, length, has_path in zip(self.muscle_names, lengths, spatial, strict=True):
            if has_path and length < _SHORTEST:
                raise RobotDescriptionError(
                    f"muscle '{name}' has a length of {length:.2g} m: its sites coincide"
                )
        arms = np.abs([self.jacobian(posture) for posture in postures]).max(axis=(0, 1))
        for name, arm in zip(self.joint_names, arms, strict=True):
            if arm == 0.0:
                raise RobotDescriptionError(
                    f"the muscle Jacobian is singular: no chosen muscle moves joint '{name}'; "
                    "leave the joint out or add its muscles"
                )
