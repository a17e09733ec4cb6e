"""Draws the pictures of docs/concepts.md from the model and the simulated swings.

scripts/ros_env python pages/concept_pictures.py
"""

from pathlib import Path

import matplotlib as mpl
import mujoco
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.axes import Axes
from numpy.typing import NDArray

from fastswing_planner.execution.settings import ExecutionSettings, Phase
from fastswing_planner.planning.plan import SwingPlan
from fastswing_planner.planning.planner import SwingPlanner
from fastswing_planner.planning.request import Method, SwingRequest
from fastswing_planner.planning.speed_index import swing_speed_index
from fastswing_planner.qp.solvers import ProxSuiteSolver
from fastswing_planner.robot.description import Robot, load_robot
from fastswing_planner.robot.mujoco_model import load_mjcf
from fastswing_planner.robot.path import MUSASHI
from musashi_muscle_bridge.simulation.closed_loop import ClosedLoop, Sample

IMAGES = Path(__file__).parents[1] / "docs" / "images"
_ELBOW = "E-p"
_SLOW = ("#9", "#10")
"""The antagonists that reach their speed limit in the paper's swing."""
_COLOURS = {"antagonist": "tab:red", "agonist": "tab:blue"}
_METHODS = {
    Method.BASIC: "Basic: all muscles driven",
    Method.INHIBIT: "Method 1: antagonists without current",
    Method.ELONGATE: "Method 2: #9 paid out before",
}
_SHOWN_SEC = (-0.2, 1.3)
_RATE_HZ = 1000.0


def main() -> None:
    """Write the pictures into docs/images."""
    mpl.use("Agg")
    robot = load_robot(MUSASHI)
    draw_problem(robot)
    draw_methods(robot)
    draw_way()


def draw_problem(robot: Robot) -> None:
    """Draw the arm at both ends of the swing, and the elbow speed that each antagonist allows."""
    start, end = robot.postures["start"], robot.postures["end"]
    index = swing_speed_index(robot.model, start, end, robot.limits.velocity)
    figure, axes = plt.subplots(1, 3, figsize=(11, 4.2), width_ratios=(1, 1, 1.2))
    for axis, name in zip(axes, ("start", "end"), strict=False):
        _draw_arm(axis, robot, robot.postures[name], index)
        axis.set_title(f"{name} of the swing down")
    slow = sorted(
        (
            (1.0 / q, name)
            for name, q in zip(robot.model.muscle_names, index, strict=True)
            if q > 0.0
        ),
        reverse=True,
    )
    bars = axes[2].barh([name for _, name in slow], [speed for speed, _ in slow], color="tab:red")
    axes[2].bar_label(bars, fmt="%.1f", padding=3)
    axes[2].set_xscale("log")
    axes[2].set_xlim(1.0, 120.0)
    axes[2].set_xlabel("fastest swing that this muscle can follow [rad/s]")
    axes[2].set_title("each antagonist sets a limit, the lowest counts")
    figure.tight_layout()
    figure.savefig(IMAGES / "problem.png", dpi=110)


def _draw_arm(
    axis: Axes, robot: Robot, posture: NDArray[np.float64], index: NDArray[np.float64]
) -> None:
    """Draw bones and muscles from the side."""
    mjcf = load_mjcf(robot.mjcf)
    data = mujoco.MjData(mjcf)
    data.qpos[:] = robot.model.full_position(posture)
    mujoco.mj_forward(mjcf, data)
    for number in range(mjcf.ngeom):
        if mjcf.geom_type[number] == mujoco.mjtGeom.mjGEOM_CAPSULE:
            along = data.geom_xmat[number].reshape(3, 3)[:, 2] * mjcf.geom_size[number, 1]
            ends = np.array([data.geom_xpos[number] - along, data.geom_xpos[number] + along])
            axis.plot(ends[:, 0], ends[:, 2], color="0.75", linewidth=9, solid_capstyle="round")
    for name, q in zip(robot.model.muscle_names, index, strict=True):
        path = _wire(mjcf, data, name)
        side = "antagonist" if q > 0.0 else "agonist"
        width, alpha = (2.5, 1.0) if name in _SLOW else (1.2, 0.6)
        axis.plot(path[:, 0], path[:, 2], color=_COLOURS[side], linewidth=width, alpha=alpha)
        if name in _SLOW:
            middle = path.mean(axis=0)[[0, 2]]
            axis.annotate(name, middle, xytext=(6, 4), textcoords="offset points")
    for side, colour in _COLOURS.items():
        axis.plot([], [], color=colour, label=side)
    axis.legend(loc="lower left", fontsize=8)
    axis.set_aspect("equal")
    axis.axis("off")


def _wire(mjcf: mujoco.MjModel, data: mujoco.MjData, name: str) -> NDArray[np.float64]:
    """Return the points [m] of a muscle's path, shape (k, 3)."""
    tendon = mjcf.tendon(name).id
    first, count = data.ten_wrapadr[tendon], data.ten_wrapnum[tendon]
    points: NDArray[np.float64] = data.wrap_xpos.reshape(-1, 3)[first : first + count]
    return points


def draw_methods(robot: Robot) -> None:
    """Draw elbow speed, wire speed and tension of a simulated swing by each method."""
    planner = SwingPlanner(robot.model, robot.limits, ProxSuiteSolver())
    figure, axes = plt.subplots(3, len(_METHODS), figsize=(12, 7), sharex=True, sharey="row")
    for column, (method, title) in zip(axes.T, _METHODS.items(), strict=True):
        request = SwingRequest(robot.postures["start"], robot.postures["end"], method)
        plan = planner.plan(request)
        loop = ClosedLoop(robot, planner, _RATE_HZ)
        loop.run(plan, ExecutionSettings())
        column[0].set_title(title)
        _draw_swing(column, robot, loop.samples, plan)
    for axis, label in zip(
        axes[:, 0], (f"{_ELBOW} speed [rad/s]", "wire speed [m/s]", "tension [N]"), strict=True
    ):
        axis.set_ylabel(label)
    axes[0, -1].legend(fontsize=8)
    axes[1, -1].legend(fontsize=8)
    figure.tight_layout()
    figure.savefig(IMAGES / "methods.png", dpi=110)


def _draw_swing(
    column: NDArray[np.object_], robot: Robot, samples: list[Sample], plan: SwingPlan
) -> None:
    began = next(sample.time for sample in samples if sample.phase is Phase.SWING)
    shown = [sample for sample in samples if _SHOWN_SEC[0] <= sample.time - began <= _SHOWN_SEC[1]]
    times = np.array([sample.time - began for sample in shown])
    elbow = robot.model.joint_names.index(_ELBOW)
    speeds = np.array([sample.state.joints["velocity"][elbow] for sample in shown])
    predicted = plan.trajectory
    column[0].plot(times, speeds, color="k", label="emulated arm")
    column[0].plot(
        predicted.time, predicted.joint_velocity[:, elbow], "--", color="0.5", label="predicted"
    )
    for name, style in zip(_SLOW, ("-", ":"), strict=True):
        muscle = robot.model.muscle_names.index(name)
        for axis, quantity in zip(column[1:], ("velocity", "tension"), strict=True):
            values = [sample.state.rows[quantity][muscle] for sample in shown]
            axis.plot(times, values, style, color="tab:red", label=name)
    limit = robot.limits.velocity[0]
    column[1].axhline(limit, color="0.5", linewidth=0.8)
    column[1].text(_SHOWN_SEC[1], limit, "limit", ha="right", va="bottom", fontsize=8)
    column[-1].set_xlabel("time since the swing began [s]")


_BOXES = {
    "task code": (0.4, 2.0),
    "planner": (0.4, 0.6),
    "swing_executor": (2.7, 1.6),
    "inhibitor": (2.7, 0.2),
    "bridge": (5.0, 1.0),
    "boards": (7.1, 1.0),
}
_ARROWS = (
    ("task code", "swing_executor", "execute_swing"),
    ("swing_executor", "planner", "plan_swing"),
    ("swing_executor", "inhibitor", "arm_inhibitor"),
    ("swing_executor", "bridge", "length_command"),
    ("inhibitor", "bridge", "current_override"),
    ("bridge", "boards", "command frames"),
)
_STATES = "each answer becomes muscle_state and joint_states, read by inhibitor and swing_executor"


def draw_way() -> None:
    """Draw which node tells which what."""
    figure, axis = plt.subplots(figsize=(10, 3.6))
    frame = {"boxstyle": "round,pad=0.5", "fc": "white"}
    boxes = {
        name: axis.text(*place, name, ha="center", va="center", bbox=frame)
        for name, place in _BOXES.items()
    }
    for begin, end, label in _ARROWS:
        ends = np.array([_BOXES[begin], _BOXES[end]])
        arrow = {
            "arrowstyle": "-|>",
            "color": "tab:blue",
            "patchA": boxes[begin].get_bbox_patch(),
            "patchB": boxes[end].get_bbox_patch(),
        }
        axis.annotate("", ends[1], ends[0], arrowprops=arrow)
        paper = {"fc": "white", "ec": "none", "pad": 1.0}
        x, y = ends.mean(axis=0)
        axis.text(x, y, label, ha="center", va="center", fontsize=9, bbox=paper)
    axis.text(3.7, -0.35, _STATES, ha="center", fontsize=8, color="tab:green")
    axis.set_xlim(-0.2, 7.6)
    axis.set_ylim(-0.5, 2.4)
    axis.axis("off")
    figure.tight_layout()
    figure.savefig(IMAGES / "data_way.png", dpi=110)


if __name__ == "__main__":
    main()
