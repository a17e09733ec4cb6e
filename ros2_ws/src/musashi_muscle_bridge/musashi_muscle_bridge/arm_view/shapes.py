"""Where the arm's links and muscles are in space, from its MJCF and the joints' angles."""

from dataclasses import dataclass
from enum import Enum

import mujoco
import numpy as np
from numpy.typing import NDArray

from fastswing_planner.arrays import Matrix, Vector
from fastswing_planner.robot.description import Robot
from fastswing_planner.robot.mjcf_names import object_names, tendon_indices
from fastswing_planner.robot.mujoco_model import load_mjcf
from musashi_muscle_bridge.arm_view.wrapped_path import wrapped_arc

_SHOWN_GROUPS = 3  # MuJoCo's own viewer shows groups 0 to 2 unless asked for more
_PULLEY = -2  # in MuJoCo's wrap_obj: the path goes on somewhere else


class Form(Enum):
    """The form of a solid, filling its size."""

    BOX = "box"
    BALL = "ball"
    CYLINDER = "cylinder"


@dataclass(frozen=True)
class Solid:
    """One link's solid, or a part of it.

    centre    of the solid in its geom's frame [m], shape (3,)
    size      along the geom's axes [m], shape (3,)
    colour    red, green, blue, opacity; 0 to 1
    """

    name: str
    geom: int
    form: Form
    centre: Vector
    size: Vector
    colour: tuple[float, float, float, float]


@dataclass(frozen=True)
class Pose:
    """position [m], shape (3,); orientation w, x, y, z, shape (4,); both in the MJCF's world."""

    position: Vector
    orientation: Vector


Path = tuple[Matrix, ...]
"""The pieces of a muscle's path: points [m], each shape (k, 3). Pulleys part them."""


class ArmShapes:
    """One arm's solids and muscle paths; `move` puts them into a posture.

    solids  of all links, and of what does not move
    """

    def __init__(self, robot: Robot) -> None:
        """Read the robot's MJCF again; raises RobotDescriptionError."""
        self._model = load_mjcf(robot.mjcf)
        self._data = mujoco.MjData(self._model)
        self._robot = robot.model
        self._tendons = tendon_indices(self._model, robot.model.muscle_names)
        self.solids = _solids(self._model)

    def move(self, joint_position: Vector) -> None:
        """Take on a posture [rad], shape (n,)."""
        self._data.qpos[:] = self._robot.full_position(joint_position)
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_comPos(self._model, self._data)
        mujoco.mj_tendon(self._model, self._data)

    def pose(self, solid: Solid) -> Pose:
        """Return where a solid is."""
        rotation = self._data.geom_xmat[solid.geom]
        orientation = np.zeros(4)
        mujoco.mju_mat2Quat(orientation, rotation)
        centre = self._data.geom_xpos[solid.geom] + rotation.reshape(3, 3) @ solid.centre
        return Pose(centre, orientation)

    def paths(self) -> list[Path]:
        """Return each muscle's path, in the robot's order."""
        return [self._path(tendon) for tendon in self._tendons]

    def _path(self, tendon: int) -> Path:
        begin = int(self._data.ten_wrapadr[tendon])
        end = begin + int(self._data.ten_wrapnum[tendon])
        points = self._data.wrap_xpos.reshape(-1, 3)[begin:end]
        objects = self._data.wrap_obj.reshape(-1)[begin:end]
        pieces: list[list[Vector]] = [[]]
        for index, (point, about) in enumerate(zip(points, objects, strict=True)):
            if about == _PULLEY:
                pieces.append([])
                continue
            on_geom = about >= 0 and index > 0 and objects[index - 1] == about
            if on_geom and len(pieces[-1]) > 1:
                pieces[-1] += self._arc(pieces[-1], point, int(about))
            pieces[-1].append(np.array(point))
        return tuple(np.array(piece) for piece in pieces if len(piece) > 1)

    def _arc(self, so_far: list[Vector], end: Vector, geom: int) -> list[Vector]:
        """Return what lies between the last point, where a geom is met, and where it is left."""
        rotation = self._data.geom_xmat[geom].reshape(3, 3)
        centre = self._data.geom_xpos[geom]
        before, begin, end = (
            (point - centre) @ rotation for point in (so_far[-2], so_far[-1], end)
        )
        cylinder = self._model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CYLINDER
        arc = wrapped_arc(before, begin, end, bool(cylinder))
        return list(arc @ rotation.T + centre)


def _solids(model: mujoco.MjModel) -> tuple[Solid, ...]:
    names = object_names(model, mujoco.mjtObj.mjOBJ_GEOM, model.ngeom)
    solids = []
    for geom, name in enumerate(names):
        colour = _colour(model, geom)
        if model.geom_group[geom] < _SHOWN_GROUPS and colour[3] > 0:
            solids += [
                Solid(name or f"geom {geom}", geom, form, np.array(centre), np.array(size), colour)
                for form, centre, size in _forms(model, geom)
            ]
    return tuple(solids)


def _colour(model: mujoco.MjModel, geom: int) -> tuple[float, float, float, float]:
    material = int(model.geom_matid[geom])
    red, green, blue, opacity = (
        model.mat_rgba[material] if material >= 0 else model.geom_rgba[geom]
    ).tolist()
    return red, green, blue, opacity


def _forms(
    model: mujoco.MjModel, geom: int
) -> list[tuple[Form, NDArray[np.float64], NDArray[np.float64]]]:
    """Return form, centre and size [m] of what a geom is made of; planes and fields: nothing."""
    radius, half, _ = size = model.geom_size[geom]
    here = np.zeros(3)
    kind = model.geom_type[geom]
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return [(Form.BOX, here, 2 * size)]
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return [(Form.BALL, here, np.full(3, 2 * radius))]
    if kind == mujoco.mjtGeom.mjGEOM_ELLIPSOID:
        return [(Form.BALL, here, 2 * size)]
    tube = (Form.CYLINDER, here, 2 * np.array([radius, radius, half]))
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        return [tube]
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        ball = np.full(3, 2 * radius)
        return [tube, *((Form.BALL, np.array([0, 0, end]), ball) for end in (half, -half))]
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        # A bone's thousands of triangles, 15 times a second, would be for its looks alone.
        centre, extent = model.geom_aabb[geom].reshape(2, 3)
        return [(Form.BALL, centre, 2 * extent)]
    return []
