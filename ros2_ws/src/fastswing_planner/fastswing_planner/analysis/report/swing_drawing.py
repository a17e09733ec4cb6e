"""Draws swings as the paper does: joint speed, muscle speed and muscle tension over time."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from fastswing_planner.analysis.measured_swing import MeasuredSwing
from fastswing_planner.analysis.motor_limits import MotorLimits, drawn_limits
from fastswing_planner.analysis.report.drawing_style import (
    LIMIT,
    OTHER,
    PANEL_SIZE,
    PLANNED,
    SHADE,
    STYLE,
    LineStyle,
)
from fastswing_planner.analysis.report.peak_labels import label_peaks
from fastswing_planner.analysis.report.svg import svg
from fastswing_planner.arrays import Matrix, Vector

_NEAR_LIMIT = 0.6
"""A limit far above everything measured is not drawn."""
_TIGHTEST = LineStyle("#4D4D4D")
"""Of the muscle with the largest tension, if it is none of the fast ones."""


def draw_joint_speed(
    axes: Axes,
    swing: MeasuredSwing,
    styles: Mapping[str, LineStyle],
    limits: MotorLimits,
    labelled: bool = True,
) -> None:
    """Draw joint speeds [rad/s], and those of the plan dotted; labelled: names at the peaks."""
    series = swing.joint_series
    _draw_lines(axes, series.time, series.velocity, series.names, styles)
    plan = swing.plan
    if plan is not None:
        for name, velocity in zip(plan.joint_names, plan.joint_velocity.T, strict=True):
            if name in styles:
                # A step's mean speed holds from the step before to this one.
                colour = styles[name].colour
                axes.step(plan.time, velocity, where="pre", color=colour, lw=1.2, linestyle=PLANNED)
    _finish(axes, swing, "joint speed [rad/s]")
    if labelled:
        label_peaks(axes, series.time, series.velocity, series.names, styles)


def draw_muscle_speed(
    axes: Axes,
    swing: MeasuredSwing,
    styles: Mapping[str, LineStyle],
    limits: MotorLimits,
    labelled: bool = True,
) -> None:
    """Draw muscle speeds [m/s] and their limits; labelled: names at the peaks."""
    series = swing.muscle_series
    if series is not None:
        _draw_lines(axes, series.time, series.velocity, series.names, styles)
    for limit in drawn_limits(swing, limits, "velocity"):
        for sign in (-1, 1):
            axes.axhline(sign * limit, color="black", linewidth=1.0, linestyle=LIMIT)
    _finish(axes, swing, "muscle speed [m/s]")
    if labelled and series is not None:
        label_peaks(axes, series.time, series.velocity, series.names, styles)


def draw_tension(
    axes: Axes,
    swing: MeasuredSwing,
    styles: Mapping[str, LineStyle],
    limits: MotorLimits,
    labelled: bool = True,
) -> None:
    """Draw muscle tensions [N] and the limits that come near; labelled: names at the peaks."""
    series, tight = swing.muscle_series, swing.tightest_muscle
    shown = dict(styles)
    if tight is not None and tight.name not in shown:
        shown[tight.name] = _TIGHTEST
    if series is not None:
        _draw_lines(axes, series.time, series.tension, series.names, shown)
        largest = float(np.nanmax(series.tension, initial=0.0))
        for figure in ("tension_max", "tension_limit"):
            for limit in drawn_limits(swing, limits, figure):
                if largest > _NEAR_LIMIT * limit:
                    axes.axhline(limit, color="black", linewidth=1.0, linestyle=LIMIT)
    _finish(axes, swing, "muscle tension [N]")
    axes.set_ylim(bottom=0.0)
    if labelled and series is not None:
        label_peaks(axes, series.time, series.tension, series.names, shown)


PANELS: Mapping[str, Callable[..., None]] = {
    "joint speed": draw_joint_speed,
    "muscle speed": draw_muscle_speed,
    "muscle tension": draw_tension,
}
"""What is drawn of a swing, from top to bottom."""


def _draw_lines(
    axes: Axes,
    time: Vector,
    values: Matrix,
    names: Sequence[str],
    styles: Mapping[str, LineStyle],
) -> None:
    """Draw one line for each of `names`, the important ones above the others; values (k, n)."""
    for name, line in zip(names, values.T, strict=True):
        style = styles.get(name)
        if style is None:
            axes.plot(time, line, color=OTHER, linewidth=0.9, zorder=2.0)
        else:
            axes.plot(
                time, line, color=style.colour, linewidth=1.7, linestyle=style.dashes, zorder=2.5
            )


def _finish(axes: Axes, swing: MeasuredSwing, label: str) -> None:
    for one in swing.inhibited:
        axes.axvspan(one.start, one.end, color=SHADE, linewidth=0, zorder=0)
    axes.axvline(0.0, color="#777777", linewidth=0.9, zorder=1)
    if np.isfinite(swing.arrival):
        axes.axvline(swing.arrival, color="#777777", linewidth=0.9, linestyle=":", zorder=1)
    series = swing.joint_series
    if series.time.size > 1:
        axes.set_xlim(float(series.time[0]), float(series.time[-1]))
    axes.margins(y=0.09)
    axes.set_title(label)
    axes.set_xlabel("time since the swing command [s]" if swing.commanded else "time [s]")


def panel_svg(
    swing: MeasuredSwing, panel: str, styles: Mapping[str, LineStyle], limits: MotorLimits
) -> bytes:
    """Return one panel, a key of PANELS, as SVG."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=PANEL_SIZE, layout="constrained")
        PANELS[panel](figure.subplots(), swing, styles, limits)
        return svg(figure)


def save_swing(
    path: Path,
    swing: MeasuredSwing,
    joints: Mapping[str, LineStyle],
    muscles: Mapping[str, LineStyle],
    limits: MotorLimits,
    title: str,
) -> None:
    """Write the three panels of a swing, with a legend, to a PNG or SVG file; raises OSError."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(8.0, 10.0), layout="constrained", dpi=120)
        FigureCanvasAgg(figure)
        grid = figure.subplots(3, sharex=True)
        draw_joint_speed(grid[0], swing, joints, limits)
        draw_muscle_speed(grid[1], swing, muscles, limits)
        draw_tension(grid[2], swing, muscles, limits)
        for axes in grid[:2]:
            axes.set_xlabel("")
        figure.suptitle(title, x=0.01, ha="left", fontweight="bold")
        entries = (
            legend_handles(joints, swing, limits, "joint"),
            legend_handles(muscles, swing, limits, "speed"),
            legend_handles(muscles, swing, limits, "tension"),
        )
        for axes, handles in zip(grid, entries, strict=True):
            axes.legend(handles=handles, loc="center left", bbox_to_anchor=(1.0, 0.5))
        figure.savefig(path, metadata={"Date": None} if path.suffix == ".svg" else None)


def legend_handles(
    styles: Mapping[str, LineStyle], swing: MeasuredSwing, limits: MotorLimits, panel: str
) -> list[Any]:
    """Return what a legend has to explain; panel: 'joint', 'speed' or 'tension'."""
    handles: list[Any] = [
        Line2D([], [], color=style.colour, linewidth=2.0, linestyle=style.dashes, label=name)
        for name, style in styles.items()
    ]
    tight = swing.tightest_muscle
    if panel == "tension" and tight is not None and tight.name not in styles:
        handles.append(_line(_TIGHTEST.colour, "-", tight.name))
    names = [one.name for one in (swing.joints if panel == "joint" else swing.muscles)]
    if any(name not in styles for name in names):
        handles.append(_line(OTHER, "-", "others"))
    if panel == "joint" and swing.plan is not None:
        handles.append(_line("black", PLANNED, "plan"))
    if panel != "joint" and limits:
        handles.append(_line("black", LIMIT, "limit"))
    if swing.inhibited:
        handles.append(Patch(color=SHADE, label="inhibited"))
    if np.isfinite(swing.arrival):
        handles.append(_line("#777777", ":", "arrived"))
    return handles


def _line(colour: str, dashes: Any, label: str) -> Line2D:
    return Line2D([], [], color=colour, linewidth=1.1, linestyle=dashes, label=label)
