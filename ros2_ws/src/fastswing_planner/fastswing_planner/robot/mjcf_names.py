"""What is in a MuJoCo model, by name."""

from collections.abc import Sequence

import mujoco
import numpy as np

from fastswing_planner.arrays import Vector, unique_known
from fastswing_planner.errors import InvalidRequest, RobotDescriptionError

SINGLE_AXIS = (int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE))


def object_names(model: mujoco.MjModel, kind: mujoco.mjtObj, count: int) -> list[str]:
    """Return the names of all `count` objects of one kind, in the model's order; "" if unnamed."""
    return [mujoco.mj_id2name(model, kind, index) or "" for index in range(count)]


def joint_indices(model: mujoco.MjModel, names: Sequence[str]) -> list[int]:
    """Return the indices of the named hinge and slide joints.

    Raises RobotDescriptionError for no name, an unknown or repeated one, another joint type, or a
    range in the wrong order.
    """
    index = _indices(model, "joint", names, mujoco.mjtObj.mjOBJ_JOINT, model.njnt)
    for name, joint in zip(names, index, strict=True):
        if int(model.jnt_type[joint]) not in SINGLE_AXIS:
            raise RobotDescriptionError(f"joint '{name}' is not a hinge or slide joint")
        low, high = model.jnt_range[joint]
        if low > high:  # MuJoCo takes that for no range at all
            raise RobotDescriptionError(
                f"joint '{name}' has the range {low:g} to {high:g} in the MJCF, the lower end "
                "comes first"
            )
    return index


def tendon_indices(model: mujoco.MjModel, names: Sequence[str]) -> list[int]:
    """Return the indices of the named tendons; raises RobotDescriptionError as `joint_indices`."""
    if not model.ntendon:
        raise RobotDescriptionError("the MJCF has no tendons: give each muscle a <tendon>")
    return _indices(model, "muscle", names, mujoco.mjtObj.mjOBJ_TENDON, model.ntendon)


def reference_position(model: mujoco.MjModel, keyframe: str) -> Vector:
    """Return qpos [rad, m] of a keyframe, or with every single-axis joint at zero, shape (nq,).

    Raises RobotDescriptionError for an unknown keyframe.
    """
    if keyframe:
        names = object_names(model, mujoco.mjtObj.mjOBJ_KEY, model.nkey)
        if keyframe not in names:
            choices = ", ".join(filter(None, names)) or "none: the MJCF names no keyframe"
            raise RobotDescriptionError(f"unknown keyframe '{keyframe}', choose from: {choices}")
        return np.array(model.key_qpos[names.index(keyframe)])
    reference = np.array(model.qpos0)
    reference[model.jnt_qposadr[np.isin(model.jnt_type, SINGLE_AXIS)]] = 0.0
    return reference


def _indices(
    model: mujoco.MjModel, what: str, names: Sequence[str], kind: mujoco.mjtObj, count: int
) -> list[int]:
    if not names:
        raise RobotDescriptionError(f"no {what} is chosen: name at least one")
    valid = object_names(model, kind, count)
    try:
        unique_known(what, names, [name for name in valid if name])
    except InvalidRequest as error:
        raise RobotDescriptionError(f"the MJCF does not fit: {error}") from error
    return [valid.index(name) for name in names]
