"""Joints that follow others: the `equality/joint` constraints of an MJCF."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from fastswing_planner.arrays import Matrix, Vector, contiguous
from fastswing_planner.errors import RobotDescriptionError

_LEFT_OVER = 1e-6  # [m/rad, rad/rad]


@dataclass(frozen=True, eq=False)
class _Follower:
    """One joint that a polynomial ties to another, or to a constant (leader -1)."""

    joint: int
    leader: int
    coefficients: tuple[float, ...]

    def value_and_slope(self, position: float) -> tuple[float, float]:
        value = slope = 0.0
        for coefficient in reversed(self.coefficients):
            slope = slope * position + value
            value = value * position + coefficient
        return value, slope


class JointCoupling:
    """Extends the positions of n chosen joints to all of a model's.

    Joints that follow a chosen one follow it here too; all others stay at `reference`.

    followers  indices of the joints that follow another or are locked
    """

    def __init__(self, model: mujoco.MjModel, joints: Sequence[int], reference: Vector) -> None:
        """Read the model's active joint equalities.

        joints     indices of the chosen joints
        reference  qpos of the joints that are left out, shape (nq,)

        Raises RobotDescriptionError for a chosen joint that follows another or is locked, and for
        joints that follow each other.
        """
        self._model = model
        self._reference = np.array(reference)
        self._qpos_index = contiguous(model.jnt_qposadr[joints])
        self._others_stay = len(joints) < model.nq
        followers = _active_followers(model)
        for follower in followers:
            if follower.joint in joints:
                raise RobotDescriptionError(_not_free(model, follower, joints))
        self._followers = _leaders_first(model, followers)
        self.followers = frozenset(follower.joint for follower in self._followers)
        self._chosen_rates = np.zeros((model.nv, len(joints)))
        self._chosen_rates[model.jnt_dofadr[joints], np.arange(len(joints))] = 1.0
        self._chosen_rates.setflags(write=False)

    def set_positions(self, qpos: Vector, joint_position: Vector | Sequence[float]) -> Matrix:
        """Write the positions of all joints, and return d qvel / d joint velocity, shape (nv, n).

        qpos            MuJoCo's, shape (nq,), written to
        joint_position  of the chosen joints [rad, m], shape (n,)
        """
        model = self._model
        if self._others_stay:
            qpos[:] = self._reference
        qpos[self._qpos_index] = joint_position
        if not self._followers:
            return self._chosen_rates
        rates = self._chosen_rates.copy()
        # q - q0 = poly(q_leader - q0_leader)  (MuJoCo's XML reference, equality/joint)
        for follower in self._followers:
            address, dof = model.jnt_qposadr[follower.joint], model.jnt_dofadr[follower.joint]
            away = 0.0
            if follower.leader >= 0:
                leader = model.jnt_qposadr[follower.leader]
                away = float(qpos[leader] - model.qpos0[leader])
            value, slope = follower.value_and_slope(away)
            qpos[address] = model.qpos0[address] + value
            if follower.leader >= 0:
                rates[dof] = slope * rates[model.jnt_dofadr[follower.leader]]
        return rates


def refuse_restrained_joints(
    model: mujoco.MjModel, coupling: JointCoupling, joint_position: Vector
) -> None:
    """Raise RobotDescriptionError if an equality constraint would resist the chosen joints.

    joint_position  where to look [rad, m], shape (n,)
    """
    data = mujoco.MjData(model)
    rates = coupling.set_positions(data.qpos, joint_position)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    mujoco.mj_flex(model, data)
    mujoco.mj_tendon(model, data)
    mujoco.mj_makeConstraint(model, data)
    resistance = np.abs(_constraint_jacobian(model, data) @ rates).max(axis=1, initial=0.0)
    for row in np.flatnonzero(resistance > _LEFT_OVER):
        if data.efc_type[row] == mujoco.mjtConstraint.mjCNSTR_EQUALITY:
            index = data.efc_id[row]
            name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_EQUALITY, index)
            called = f"'{name}'" if name else f"number {index}"
            raise RobotDescriptionError(
                f"the equality constraint {called} restrains the chosen joints: choose joints "
                "that move freely, or make the constraint inactive in the MJCF"
            )


def _constraint_jacobian(model: mujoco.MjModel, data: mujoco.MjData) -> Matrix:
    if not mujoco.mj_isSparse(model):
        return np.array(data.efc_J).reshape(data.nefc, model.nv)
    dense = np.zeros((data.nefc, model.nv))
    if data.nefc:
        mujoco.mju_sparse2dense(
            dense, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind
        )
    return dense


def _active_followers(model: mujoco.MjModel) -> list[_Follower]:
    if model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_EQUALITY:
        return []
    return [
        _Follower(
            int(model.eq_obj1id[index]),
            int(model.eq_obj2id[index]),
            tuple(model.eq_data[index, :5].tolist()),
        )
        for index in range(model.neq)
        if model.eq_active0[index] and int(model.eq_type[index]) == int(mujoco.mjtEq.mjEQ_JOINT)
    ]


def _leaders_first(model: mujoco.MjModel, followers: list[_Follower]) -> list[_Follower]:
    """Order the followers so that each comes after its leader."""
    ordered: list[_Follower] = []
    waiting = list(followers)
    while waiting:
        unplaced = {follower.joint for follower in waiting}
        ready = [follower for follower in waiting if follower.leader not in unplaced]
        if not ready:
            raise RobotDescriptionError(
                f"the joints {_circle(model, waiting)} follow each other in a circle: make one of "
                "their equality constraints inactive in the MJCF"
            )
        ordered += ready
        waiting = [follower for follower in waiting if follower not in ready]
    return ordered


def _circle(model: mujoco.MjModel, waiting: list[_Follower]) -> str:
    """Return the names of one circle's joints; each of `waiting` leads to one."""
    leaders = {follower.joint: follower.leader for follower in waiting}
    joint = waiting[0].joint
    for _ in waiting:
        joint = leaders[joint]
    members = [joint]
    while (joint := leaders[joint]) != members[0]:
        members.append(joint)
    return ", ".join(_name(model, member) for member in sorted(members))


def _not_free(model: mujoco.MjModel, follower: _Follower, chosen: Sequence[int]) -> str:
    name = _name(model, follower.joint)
    if follower.leader < 0:
        return f"joint '{name}' is locked by an equality constraint: leave it out"
    leader = _name(model, follower.leader)
    if follower.leader in chosen:
        return f"joint '{name}' follows joint '{leader}', which is chosen too: leave '{name}' out"
    return f"joint '{name}' follows joint '{leader}': choose '{leader}' instead"


def _name(model: mujoco.MjModel, joint: int) -> str:
    return mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, joint) or f"number {joint}"
