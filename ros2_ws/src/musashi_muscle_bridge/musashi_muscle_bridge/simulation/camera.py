"""Pictures of the arm, made without a screen."""

import importlib
import os
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from fastswing_planner.arrays import Vector
from fastswing_planner.errors import PlannerError
from fastswing_planner.robot.description import Robot
from fastswing_planner.robot.mujoco_model import load_mjcf

Picture = NDArray[np.uint8]
_PLATFORMS = ("egl", "osmesa")


class VideoError(PlannerError):
    """A video cannot be made."""


class Camera:
    """Takes pictures of postures, in memory."""

    def __init__(self, robot: Robot, width: int = 640, height: int = 720) -> None:
        """Open OpenGL without a screen; raises VideoError if this machine has none.

        width, height  [pixel]
        """
        self._mjcf = load_mjcf(robot.mjcf)
        visual = self._mjcf.vis.global_
        visual.offwidth, visual.offheight = width, height
        self._size = width, height
        self._data = mujoco.MjData(self._mjcf)
        self._model = robot.model
        self._gl = _offscreen_context(width, height)
        self._gl.make_current()
        self._context = mujoco.MjrContext(self._mjcf, mujoco.mjtFontScale.mjFONTSCALE_100)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self._scene = mujoco.MjvScene(self._mjcf, maxgeom=10_000)
        # Shadows take most of the time where a processor renders.
        self._scene.flags[mujoco.mjtRndFlag.mjRND_SHADOW] = 0
        self._view = mujoco.MjvCamera()
        mujoco.mjv_defaultFreeCamera(self._mjcf, self._view)
        self._view.azimuth, self._view.elevation = 125.0, -10.0

    def picture(self, joint_position: Vector) -> Picture:
        """Return the arm in a posture [rad], shape (n,), as shape (height, width, 3)."""
        self._data.qpos[:] = self._model.full_position(joint_position)
        mujoco.mj_forward(self._mjcf, self._data)
        self._gl.make_current()
        mujoco.mjv_updateScene(
            self._mjcf,
            self._data,
            mujoco.MjvOption(),
            None,
            self._view,
            mujoco.mjtCatBit.mjCAT_ALL,
            self._scene,
        )
        width, height = self._size
        pixels = np.empty((height, width, 3), dtype=np.uint8)
        area = mujoco.MjrRect(0, 0, width, height)
        mujoco.mjr_render(area, self._scene, self._context)
        mujoco.mjr_readPixels(pixels, None, area, self._context)
        return pixels[::-1]

    def close(self) -> None:
        """Give OpenGL's memory back."""
        self._context.free()
        self._gl.free()


def _offscreen_context(width: int, height: int) -> Any:
    chosen = os.environ.get("MUJOCO_GL", "").lower()
    platforms = (chosen,) if chosen in _PLATFORMS else _PLATFORMS
    reasons = []
    for platform in platforms:
        try:
            # MuJoCo's own modules; importing one decides what PyOpenGL looks for.
            return importlib.import_module(f"mujoco.{platform}").GLContext(width, height)
        except Exception as error:  # whatever OpenGL, its loader or its driver think of
            text = str(error).splitlines() or [type(error).__name__]
            reasons.append(f"{platform}: {text[0]}")
            os.environ.pop("PYOPENGL_PLATFORM", None)
    raise VideoError(
        f"no OpenGL without a screen here ({'; '.join(reasons)}): install libegl1 and "
        "libgl1-mesa-dri, or libosmesa6"
    )
