"""Draws three swings side by side: joint speed, muscle speed and muscle tension over time."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import numpy.typing as npt
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from swing_bag import Array, RecordedSwing, read_swings

from fastswing_planner.robot import load_robot
from fastswing_planner.robot_path import MUSASHI, resolve_path

TITLES = {"basic": "Basic", "method_1": "Method 1", "method_2": "Method 2"}
_PREPARED = {"method_1": "zero current: ", "method_2": "paid out before: "}

# Safe for colour-blind eyes (after Okabe and Ito): agonists of the swing are cool colours,
# antagonists warm ones.
MUSCLE_COLOURS = {
    "#1": "#56B4E9",
    "#6": "#0072B2",
    "#8": "#009E73",
    "#2": "#E69F00",
    "#3": "#CC79A7",
    "#9": "#D55E00",
    "#10": "#6A1B4D",
}
JOINT_COLOURS = {
    "S-p": "#0072B2",
    "S-r": "#009E73",
    "S-y": "#CC79A7",
    "E-p": "#D55E00",
    "E-y": "#E69F00",
}
_OTHER = "#BBBBBB"
_SHADE = "#FAF1D2"
_PLANNED: Any = (0, (3, 1.5))
_LIMIT: Any = (0, (9, 4))

_FROM_SEC, _TO_SEC = -0.1, 1.3
_PLANNED_FROM = 0.2  # [rad/s] slower joints of a plan are not drawn
_STYLE: dict[Any, Any] = {
    "font.size": 12,
    "axes.grid": True,
    "grid.color": "#E4E4E4",
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
}


def draw_swing(bags: Mapping[str, Path], output: Path, robot: Path | None = None) -> None:
    """Draw the swings of `bags` (method -> bag) into the picture `output`.

    robot  the YAML file of the robot, for its velocity limit; None: the nodes' default

    Raises UnusableBag or RobotDescriptionError.
    """
    swings = read_swings(bags)
    limits = load_robot(robot or resolve_path(MUSASHI)).limits
    with mpl.rc_context(_STYLE):
        figure = draw_figure(swings, np.unique(limits.velocity))
        output.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(output)


def draw_figure(swings: Mapping[str, RecordedSwing], velocity_limits: Array) -> Figure:
    """Return the figure, 1600 x 1000 pixels; velocity_limits [m/s], shape (any,)."""
    figure = Figure(figsize=(16, 10), dpi=100, layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(3, len(swings), sharex=True, sharey="row", squeeze=False)
    for column, (method, swing) in zip(grid.T, swings.items(), strict=True):
        column[0].set_title(_title(method, swing))
        _draw_joints(column[0], swing)
        _draw_muscle_speed(column[1], swing, velocity_limits)
        _draw_tension(column[2], swing)
        column[2].set_xlabel("time since the swing command [s]")
        for axes in column:
            _shade(axes, swing)
    grid[0, 0].set_xlim(_FROM_SEC, _TO_SEC)
    grid[2, 0].set_ylim(bottom=0.0)
    for axes, label in zip(
        grid[:, 0],
        ("joint speed [rad/s]", "muscle speed [m/s]\n(longer is positive)", "muscle tension [N]"),
        strict=True,
    ):
        axes.set_ylabel(label)
    figure.align_ylabels(list(grid[:, 0]))
    _add_legends(grid, list(swings.values()))
    return figure


def _title(method: str, swing: RecordedSwing) -> str:
    title = TITLES.get(method, method)
    masked = swing.plan.masked if swing.plan is not None else ()
    if method in _PREPARED and masked:
        title += f"\n{_PREPARED[method]}{' '.join(masked)}"
    return title


def _window(time: Array) -> npt.NDArray[np.bool_]:
    """Return which samples are drawn, with one beyond each edge, shape of `time`."""
    return (time >= _FROM_SEC - 0.05) & (time <= _TO_SEC + 0.05)


def _lines(
    axes: Axes, time: Array, values: Array, names: Sequence[str], colours: Mapping[str, str]
) -> None:
    """Draw one line for each of `names`, the important ones above the others; values (k, n)."""
    shown = _window(time)
    for name, line in zip(names, values.T, strict=True):
        important = name in colours
        axes.plot(
            time[shown],
            line[shown],
            color=colours.get(name, _OTHER),
            linewidth=1.8 if important else 1.0,
            zorder=2.5 if important else 2.0,
        )


def _draw_joints(axes: Axes, swing: RecordedSwing) -> None:
    _lines(axes, swing.joint_time, swing.joint_velocity, swing.joint_names, JOINT_COLOURS)
    if swing.plan is None:
        return
    for name, velocity in zip(swing.plan.joint_names, swing.plan.velocity.T, strict=True):
        if np.abs(velocity).max(initial=0.0) > _PLANNED_FROM:
            # A step's mean speed holds from the step before to this one.
            axes.step(
                swing.plan.time,
                velocity,
                where="pre",
                color=JOINT_COLOURS.get(name, _OTHER),
                linewidth=1.1,
                linestyle=_PLANNED,
            )


def _draw_muscle_speed(axes: Axes, swing: RecordedSwing, velocity_limits: Array) -> None:
    _lines(axes, swing.muscle_time, swing.muscle_velocity, swing.muscle_names, MUSCLE_COLOURS)
    for limit in velocity_limits:
        for sign in (-1, 1):
            axes.axhline(sign * limit, color="black", linewidth=1.1, linestyle=_LIMIT)


def _draw_tension(axes: Axes, swing: RecordedSwing) -> None:
    _lines(axes, swing.muscle_time, swing.muscle_tension, swing.muscle_names, MUSCLE_COLOURS)


def _shade(axes: Axes, swing: RecordedSwing) -> None:
    for inhibition in swing.inhibitions:
        axes.axvspan(inhibition.start, inhibition.end, color=_SHADE, linewidth=0, zorder=0)
    axes.axvline(0.0, color="#888888", linewidth=0.8, zorder=1)


def _add_legends(grid: Any, swings: Sequence[RecordedSwing]) -> None:
    joints = _handles(swings[0].joint_names, JOINT_COLOURS)
    joints.append(Line2D([], [], color="black", linewidth=1.1, linestyle=_PLANNED, label="plan"))
    muscles = _handles(swings[0].muscle_names, MUSCLE_COLOURS)
    limit = Line2D([], [], color="black", linewidth=1.1, linestyle=_LIMIT, label="speed limit")
    shade = Patch(color=_SHADE, label="inhibited")
    entries = (joints, [*muscles, limit], [*muscles, shade])
    for axes, handles in zip(grid[:, -1], entries, strict=True):
        axes.legend(handles=handles, loc="center left", bbox_to_anchor=(1.01, 0.5))


def _handles(names: Sequence[str], colours: Mapping[str, str]) -> list[Line2D]:
    handles = [
        Line2D([], [], color=colours[name], linewidth=2.2, label=name)
        for name in names
        if name in colours
    ]
    if any(name not in colours for name in names):
        handles.append(Line2D([], [], color=_OTHER, linewidth=1.2, label="others"))
    return handles
