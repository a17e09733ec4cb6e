"""Draws the fitted arm and its moment arms for docs/musashi_model.md.

Run `python fit/musashi_pictures.py` after the fit. MuJoCo renders without a screen or a graphics
card through EGL; set MUJOCO_GL for another way.
"""

import os

os.environ.setdefault("MUJOCO_GL", "egl")

import matplotlib as mpl
import mujoco
import numpy as np
from kinematic_fit import REPOSITORY, ROBOT_YAML
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from numpy.typing import NDArray
from swing_targets import ELBOW_PITCH, EPSILON, JOINTS, MUSCLES, PEAK, travel_arms

from fastswing_planner.planning.planner import SwingPlanner
from fastswing_planner.planning.request import SwingRequest
from fastswing_planner.planning.swing import SwingSettings
from fastswing_planner.qp.solvers import ProxSuiteSolver
from fastswing_planner.robot.description import Robot, load_robot
from fastswing_planner.robot.mujoco_model import load_mjcf

IMAGES = REPOSITORY / "docs/images"
SHOWN_POSTURES = ("home", "start", "end")
# Width and height of one posture's picture [pixel].
_WIDTH, _HEIGHT = 760, 1000
_COLOURS = ("tab:blue", "tab:red", "tab:green")


def main() -> None:
    """Write the pictures into docs/images."""
    mpl.use("Agg")
    robot = load_robot(ROBOT_YAML)
    IMAGES.mkdir(parents=True, exist_ok=True)
    draw_arm(robot)
    draw_moment_arms(robot)
    draw_swings(robot)
    print("written: docs/images/musashi_{arm,moment_arms,swings}.png")


def draw_arm(robot: Robot) -> None:
    """Render the named postures side by side."""
    figure, axes = plt.subplots(1, len(SHOWN_POSTURES), figsize=(12, 5.6))
    for axis, name in zip(axes, SHOWN_POSTURES, strict=True):
        axis.imshow(rendered(robot, robot.postures[name]))
        axis.set_title(name)
        axis.axis("off")
    figure.tight_layout()
    figure.savefig(IMAGES / "musashi_arm.png", dpi=130)


def rendered(robot: Robot, posture: NDArray[np.float64]) -> NDArray[np.uint8]:
    """Return a picture of one posture [rad], shape (height, width, 3)."""
    model = load_mjcf(robot.mjcf)
    data = mujoco.MjData(model)
    for name, angle in zip(JOINTS, posture, strict=True):
        data.joint(name).qpos = angle
    mujoco.mj_forward(model, data)
    with mujoco.Renderer(model, _HEIGHT, _WIDTH) as renderer:
        renderer.update_scene(data, _camera(), _what_to_show())
        return renderer.render().copy()


def _camera() -> mujoco.MjvCamera:
    camera = mujoco.MjvCamera()
    camera.lookat = [0.16, 0.19, 1.11]
    camera.distance, camera.azimuth, camera.elevation = 1.2, -112.0, -8.0
    return camera


def _what_to_show() -> mujoco.MjvOption:
    option = mujoco.MjvOption()
    option.geomgroup[3] = 1  # the wrapping geometry
    option.sitegroup[4] = 0
    option.label = mujoco.mjtLabel.mjLABEL_TENDON
    return option


def draw_moment_arms(robot: Robot) -> None:
    """Plot every muscle's moment arms over the travel from start to end."""
    start, end = robot.postures["start"], robot.postures["end"]
    arms = travel_arms(robot.model, start, end)
    figure, axes = plt.subplots(2, 1, figsize=(8, 8), sharex=True)
    travel = np.linspace(0.0, 100.0, len(arms))
    for axis, joint, column in zip(axes, ("S-p", "E-p"), (0, ELBOW_PITCH), strict=True):
        _plot_arms(axis, travel, arms[:, :, column])
        axis.set_title(f"{joint}: {start[column]:.2f} to {end[column]:.2f} rad")
    axes[-1].set_xlabel("travel from start to end [%]")
    figure.tight_layout()
    figure.savefig(IMAGES / "musashi_moment_arms.png", dpi=110)


def _plot_arms(axis: Axes, travel: NDArray[np.float64], arms: NDArray[np.float64]) -> None:
    for row, name in enumerate(MUSCLES):
        if np.abs(arms[:, row]).max() > 1e-6:
            axis.plot(travel, 1000 * arms[:, row], label=name, color=f"C{row}")
    axis.axhline(0.0, color="black", linewidth=0.8)
    axis.set_ylabel("moment arm [mm]\n> 0 antagonist, < 0 agonist")
    axis.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    axis.grid(alpha=0.3)


def draw_swings(robot: Robot) -> None:
    """Plot the E-p speed and the S-p angle of the three simulated swings."""
    planner = SwingPlanner(robot.model, robot.limits, ProxSuiteSolver())
    start, end = robot.postures["start"], robot.postures["end"]
    figure, axes = plt.subplots(2, 1, figsize=(8, 7), sharex=True)
    for method, colour in zip(PEAK, _COLOURS, strict=True):
        settings = SwingSettings(epsilon=EPSILON)
        swing = planner.plan(SwingRequest(start, end, method, settings=settings)).trajectory
        label = f"{method.name.lower()}, {swing.time_cost:.2f} s"
        axes[0].plot(swing.time, swing.joint_velocity[:, ELBOW_PITCH], color=colour, label=label)
        axes[1].plot(swing.time, swing.joint_position[:, 0], color=colour, label=f"{label}, S-p")
        elbow = swing.joint_position[:, ELBOW_PITCH]
        axes[1].plot(swing.time, elbow, "--", color=colour, label=f"{label}, E-p")
    axes[0].set_ylabel("E-p speed [rad/s]")
    axes[1].set_ylabel("angle [rad]")
    axes[1].set_xlabel("time [s]")
    for axis in axes:
        axis.legend(fontsize="small")
        axis.grid(alpha=0.3)
    figure.tight_layout()
    figure.savefig(IMAGES / "musashi_swings.png", dpi=110)


if __name__ == "__main__":
    main()
