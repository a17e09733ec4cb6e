"""Draws the markers of show_arm, in three moments of swings, for docs/monitor.md.

Run `scripts/ros_env python demo/arm_picture.py`. matplotlib draws the messages, not a viewer.
"""

from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
import mujoco
import numpy as np
from matplotlib import pyplot as plt
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Line3DCollection
from std_msgs.msg import Header
from visualization_msgs.msg import Marker

from fastswing_planner.execution.measurements import MuscleMeasurement
from fastswing_planner.execution.settings import Phase
from fastswing_planner.planning.request import Method
from fastswing_planner.robot.description import Robot, load_robot
from fastswing_planner.robot.path import MUSASHI
from musashi_muscle_bridge.buses.protocol import Mode
from musashi_muscle_bridge.commands.simulate_swing import simulated_swing
from musashi_muscle_bridge.nodes.arm_markers import LINKS, ArmMarkers
from musashi_muscle_bridge.simulation.closed_loop import Sample

IMAGE = Path(__file__).parents[1] / "docs/images/arm_markers.png"
_CENTRE, _HALF = np.array([0.16, 0.10, 1.16]), 0.38  # [m] of what is shown
_POINTS_PER_METRE = 500.0
_LINK_OPACITY = 0.35
_INTO_SWING_SEC = 0.35


def main() -> None:
    """Write the picture into docs/images."""
    mpl.use("Agg")
    robot = load_robot(MUSASHI)
    markers = ArmMarkers(robot, lifetime=0.5, slack_tension=1.0)
    moments = (
        ("Basic, swinging", Method.BASIC, middle_of_swing),
        ("Method 1, swinging: outlined at zero current", Method.INHIBIT, middle_of_swing),
        ("Method 2, before the swing: #9 paid out", Method.ELONGATE, before_swing),
    )
    figure = plt.figure(figsize=(15, 5.6))
    for number, (title, method, choose) in enumerate(moments, start=1):
        sample = choose(simulated_swing(robot, method, 1000.0)[1])
        axes = figure.add_subplot(1, len(moments), number, projection="3d")
        position = sample.state.joints["position"].astype(float)
        array = markers.draw(Header(frame_id="world"), position, measurement(robot, sample))
        for marker in array.markers:
            draw(axes, marker)
        axes.set_title(title, fontsize=11, y=0.03)
        frame(axes)
    figure.subplots_adjust(0, 0, 1, 1, 0, 0)
    figure.savefig(IMAGE, dpi=110)
    print(f"written: {IMAGE}")


def middle_of_swing(samples: list[Sample]) -> Sample:
    """Return a sample a little after the swing began."""
    swinging = [sample for sample in samples if sample.phase is Phase.SWING]
    began = swinging[0].time
    return next(sample for sample in swinging if sample.time >= began + _INTO_SWING_SEC)


def before_swing(samples: list[Sample]) -> Sample:
    """Return the last sample before the arm swings."""
    return [sample for sample in samples if sample.phase < Phase.SWING][-1]


def measurement(robot: Robot, sample: Sample) -> MuscleMeasurement:
    """Return what the bridge would publish."""
    rows = sample.state.rows
    limp = tuple(
        name
        for name, mode in zip(robot.model.muscle_names, rows["mode"], strict=True)
        if mode == Mode.ZERO_CURRENT
    )
    length, velocity, tension = (
        rows[name].astype(float) for name in ("length", "velocity", "tension")
    )
    return MuscleMeasurement(sample.time, length, velocity, tension, limp=limp)


def draw(axes: Axes3D, marker: Marker) -> None:
    """Draw one marker as RViz would."""
    colour = (marker.color.r, marker.color.g, marker.color.b)
    if marker.ns == LINKS:
        surface = SURFACES[marker.type]() * scale(marker) @ rotation(marker).T + place(marker)
        x, y, z = np.moveaxis(surface, -1, 0)
        axes.plot_surface(x, y, z, color=colour, alpha=_LINK_OPACITY, linewidth=0)
    elif marker.action == Marker.ADD:
        points = np.array([(point.x, point.y, point.z) for point in marker.points])
        lines = Line3DCollection(
            points.reshape(-1, 2, 3),
            colors=[(*colour, marker.color.a)],
            linewidths=marker.scale.x * _POINTS_PER_METRE,
        )
        axes.add_collection3d(lines)


def frame(axes: Axes3D) -> None:
    """Look at the arm from its front and left."""
    for limit, middle in zip((axes.set_xlim, axes.set_ylim, axes.set_zlim), _CENTRE, strict=True):
        limit(middle - _HALF, middle + _HALF)
    axes.set_box_aspect((1, 1, 1), zoom=1.6)
    axes.view_init(elev=8, azim=65)
    axes.set_axis_off()


def scale(marker: Marker) -> np.ndarray:
    """Return a marker's size [m], shape (3,)."""
    return np.array([marker.scale.x, marker.scale.y, marker.scale.z])


def place(marker: Marker) -> np.ndarray:
    """Return where a marker is [m], shape (3,)."""
    position = marker.pose.position
    return np.array([position.x, position.y, position.z])


def rotation(marker: Marker) -> np.ndarray:
    """Return a marker's rotation matrix, shape (3, 3)."""
    turn = marker.pose.orientation
    matrix = np.zeros(9)
    mujoco.mju_quat2Mat(matrix, np.array([turn.w, turn.x, turn.y, turn.z]))
    return matrix.reshape(3, 3)


def _grid(rows: int, columns: int) -> tuple[np.ndarray, np.ndarray]:
    u, v = np.meshgrid(np.linspace(0, 1, rows), np.linspace(0, 2 * np.pi, columns))
    return u, v


def _ball() -> np.ndarray:
    u, v = _grid(10, 18)
    radius = np.sin(np.pi * u) / 2
    return np.stack([radius * np.cos(v), radius * np.sin(v), np.cos(np.pi * u) / 2], axis=-1)


def _cylinder() -> np.ndarray:
    u, v = _grid(2, 18)
    return np.stack([np.cos(v) / 2, np.sin(v) / 2, u - 0.5], axis=-1)


def _box() -> np.ndarray:
    ring = np.array([(0, 0), (0.5, 0.5), (0.5, -0.5), (-0.5, -0.5), (-0.5, 0.5), (0.5, 0.5)])
    heights = (-0.5, -0.5, 0.5, 0.5)
    rows = [
        np.column_stack([ring[1:] * (0 if end else 1), np.full(5, height)])
        for height, end in zip(heights, (True, False, False, True), strict=True)
    ]
    return np.array(rows)


SURFACES: dict[int, Callable[[], np.ndarray]] = {
    Marker.SPHERE: _ball,
    Marker.CYLINDER: _cylinder,
    Marker.CUBE: _box,
}

if __name__ == "__main__":
    main()
