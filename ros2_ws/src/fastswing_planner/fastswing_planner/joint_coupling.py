"""Joints that follow others: the `equality/joint` constraints of an MJCF."""

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.polynomial import polynomial

from fastswing_planner.arrays import Matrix, Vector
from fastswing_planner.errors import RobotDescriptionError

_LEFT_OVER = 1e-6


@dataclass(frozen=True, eq=False)
class _Follower:
    """One joint that a polynomial ties to another, or to a constant (leader -1)."""

    joint: int
    leader: int
    coefficients: Vector


class JointCoupling:
    """Extends the positions of n chosen joints to all of a model's.

    Joints that follow a chosen one follow it here too; all others stay at `reference`.
    """

    def __init__(self, model: mujoco.MjModel, joints: Sequence[int], reference: Vector) -> None:
        """Read the model's active joint equalities.

        joints     indices of the chosen joints
        reference  qpos of the joints that are left out, shape (nq,)

        Raises RobotDescriptionError for a chosen joint that cannot be set freely, or if another
        active equality constraint restrains the chosen joints.
        """
        self._model = model
        self._reference = np.array(reference)
        self._qpos_index = model.jnt_qposadr[joints]
        self._dof_index = model.jnt_dofadr[joints]
        followers = _active_followers(model)
        for name, joint in zip(_names(model, joints), joints, strict=True):
            for follower in followers:
                if follower.joint == joint:
                    raise RobotDescriptionError(_follower_text(model, name, follower))
        self._followers = _leaders_first(model, followers)
        self._fixed = np.zeros((model.nv, len(joints)))
        self._fixed[self._dof_index, np.arange(len(joints))] = 1.0
        self.set_positions(mujoco.MjData(model), np.array(model.qpos0[self._qpos_index]))

    def set_positions(self, data: mujoco.MjData, joint_position: Vector) -> Matrix:
        """Write qpos of all joints, and return d qvel / d joint velocity, shape (nv, n).

        joint_position  of the chosen joints [rad, m], shape (n,)
        """
        model, qpos = self._model, data.qpos
        qpos[:] = self._reference
        qpos[self._qpos_index] = joint_position
        if not self._followers:
            return self._fixed
        rates = self._fixed.copy()
        # q - q0 = poly(q_leader - q0_leader)  (MuJoCo's XML reference, equality/joint)
        for follower in self._followers:
            address, dof = model.jnt_qposadr[follower.joint], model.jnt_dofadr[follower.joint]
            offset, slope = follower.coefficients[0], 0.0
            if follower.leader >= 0:
                leader = model.jnt_qposadr[follower.leader]
                away = float(qpos[leader] - model.qpos0[leader])
                offset = polynomial.polyval(away, follower.coefficients)
                slope = polynomial.polyval(away, polynomial.polyder(follower.coefficients))
                rates[dof] = slope * rates[model.jnt_dofadr[follower.leader]]
            qpos[address] = model.qpos0[address] + offset
        return rates


def refuse_restrained_joints(
    model: mujoco.MjModel, coupling: JointCoupling, joint_position: Vector
) -> None:
    """Raise RobotDescriptionError if an equality constraint would resist the chosen joints.

    joint_position  where to look [rad, m], shape (n,)
    """
    data = mujoco.MjData(model)
    rates = coupling.set_positions(data, joint_position)
    kept, model.opt.jacobian = model.opt.jacobian, mujoco.mjtJacobian.mjJAC_DENSE
    mujoco.mj_fwdPosition(model, data)
    model.opt.jacobian = kept
    rows = data.efc_J.reshape(-1, model.nv) @ rates
    for row, kind, equality in zip(rows, data.efc_type, data.efc_id, strict=True):
        if kind == mujoco.mjtConstraint.mjCNSTR_EQUALITY and np.abs(row).max() > _LEFT_OVER:
            name = mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_EQUALITY, equality)
            raise RobotDescriptionError(
                f"the equality constraint '{name or equality}' restrains the chosen joints: "
                "choose joints that move freely, or make the constraint inactive in the MJCF"
            )


def _active_followers(model: mujoco.MjModel) -> list[_Follower]:
    if model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_EQUALITY:
        return []
    return [
        _Follower(
            int(model.eq_obj1id[index]),
            int(model.eq_obj2id[index]),
            np.array(model.eq_data[index, :5]),
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
            names = ", ".join(_names(model, sorted(unplaced)))
            raise RobotDescriptionError(f"the joints {names} follow each other in a circle")
        ordered += ready
        waiting = [follower for follower in waiting if follower not in ready]
    return ordered


def _follower_text(model: mujoco.MjModel, name: str, follower: _Follower) -> str:
    if follower.leader < 0:
        return f"joint '{name}' is locked by an equality constraint: leave it out"
    leader = _names(model, [follower.leader])[0]
    return f"joint '{name}' follows joint '{leader}': choose '{leader}' instead"


def _names(model: mujoco.MjModel, joints: Sequence[int]) -> list[str]:
    return [
        mujoco.mj_id2name(model, mujoco.mjtObj.mjOBJ_JOINT, int(joint)) or str(joint)
        for joint in joints
    ]
