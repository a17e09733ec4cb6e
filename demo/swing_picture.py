"""Draws three swings side by side: joint speed, muscle speed and muscle tension over time."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from swing_bag import read_swings

from fastswing_planner.analysis.measured_swing import MeasuredSwing
from fastswing_planner.analysis.motor_limits import MotorLimits, motor_limits
from fastswing_planner.analysis.report.drawing_style import STYLE, joint_styles, muscle_styles
from fastswing_planner.analysis.report.swing_drawing import PANELS, legend_handles
from fastswing_planner.robot.description import load_robot
from fastswing_planner.robot.path import MUSASHI

TITLES = {"basic": "Basic", "method_1": "Method 1", "method_2": "Method 2"}
_PREPARED = {"method_1": "zero current: ", "method_2": "paid out before: "}
_LABELS = ("joint speed [rad/s]", "muscle speed [m/s]\n(longer is positive)", "muscle tension [N]")
_FROM_SEC, _TO_SEC = -0.1, 1.3
_STYLE: dict[Any, Any] = {**STYLE, "font.size": 12, "axes.titlelocation": "center"}


def draw_swing(bags: Mapping[str, Path], output: Path, robot: Path | None = None) -> None:
    """Draw the swings of `bags` (method -> bag) into the picture `output`.

    robot  the YAML file of the robot, for its limits; None: the nodes' default

    Raises UnusableBag or RobotDescriptionError.
    """
    swings = read_swings(bags)
    limits = motor_limits(load_robot(robot or MUSASHI))
    with mpl.rc_context(_STYLE):
        figure = draw_figure(swings, limits)
        output.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(output)


def draw_figure(swings: Mapping[str, MeasuredSwing], limits: MotorLimits) -> Figure:
    """Return the figure, 1600 x 1000 pixels."""
    shown = list(swings.values())
    joints, muscles = joint_styles(shown), muscle_styles(shown)
    figure = Figure(figsize=(16, 10), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(3, len(shown), sharex=True, sharey="row", squeeze=False)
    for column, (method, swing) in zip(grid.T, swings.items(), strict=True):
        for axes, (panel, draw) in zip(column, PANELS.items(), strict=True):
            draw(axes, swing, joints if panel == "joint speed" else muscles, limits, False)
            axes.set_title("")
            axes.set_xlabel("")
        column[0].set_title(_title(method, swing))
        column[2].set_xlabel("time since the swing command [s]")
    grid[0, 0].set_xlim(_FROM_SEC, _TO_SEC)
    for axes, label in zip(grid[:, 0], _LABELS, strict=True):
        axes.set_ylabel(label)
    figure.align_ylabels(list(grid[:, 0]))
    _add_legends(grid, shown, joints, muscles, limits)
    return figure


def _title(method: str, swing: MeasuredSwing) -> str:
    title = TITLES.get(method, method)
    masked = swing.plan.masked if swing.plan is not None else ()
    if method in _PREPARED and masked:
        title += f"\n{_PREPARED[method]}{' '.join(masked)}"
    return title


def _add_legends(
    grid: Any, swings: Sequence[MeasuredSwing], joints: Any, muscles: Any, limits: MotorLimits
) -> None:
    panels = (("joint", joints), ("speed", muscles), ("tension", muscles))
    # The swing with the most to explain comes first.
    order = sorted(swings, key=lambda one: -len(one.inhibited))
    for axes, (panel, styles) in zip(grid[:, -1], panels, strict=True):
        entries = [one for swing in order for one in legend_handles(styles, swing, limits, panel)]
        # Of entries with one name the first.
        named = {one.get_label(): one for one in reversed(entries)}
        handles = [one for one in entries if named[one.get_label()] is one]
        axes.legend(handles=handles, loc="center left", bbox_to_anchor=(1.01, 0.5))
