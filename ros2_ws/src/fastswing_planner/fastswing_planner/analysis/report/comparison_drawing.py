"""Draws the swings of two groups over each other."""

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from fastswing_planner.analysis.measured_swing import MeasuredSwing
from fastswing_planner.analysis.report.drawing_style import GROUPS, PANEL_SIZE, STYLE
from fastswing_planner.analysis.report.svg import svg
from fastswing_planner.arrays import Vector

_DASHES = ("-", "--")


def comparison_pictures(
    first: Sequence[MeasuredSwing], second: Sequence[MeasuredSwing]
) -> dict[str, bytes]:
    """Return title -> SVG: for each method of both groups three overlays over time."""
    methods = sorted({swing.method for swing in first} & {swing.method for swing in second})
    pictures: dict[str, bytes] = {}
    for method in methods or ["all"]:
        groups = [
            [swing for swing in group if swing.method == method or not methods]
            for group in (first, second)
        ]
        if groups[0] and groups[1]:
            pictures |= _overlays(method, groups)
    return pictures


def _overlays(method: str, groups: Sequence[Sequence[MeasuredSwing]]) -> dict[str, bytes]:
    joint = groups[0][0].main_joint.name
    curves = {
        f"speed of {joint} [rad/s]": lambda swing: _joint_speed(swing, joint),
        "largest muscle speed [m/s]": _muscle_speed,
        "largest tension [N]": _tension,
    }
    return {
        f"{method}: {title}": _overlay(
            f"{method}: {title}", [[curve(swing) for swing in group] for group in groups]
        )
        for title, curve in curves.items()
    }


def _joint_speed(swing: MeasuredSwing, joint: str) -> tuple[Vector, Vector]:
    series = swing.joint_series
    if joint not in series.names:
        return np.zeros(0), np.zeros(0)
    return series.time, series.velocity[:, series.names.index(joint)]


def _muscle_speed(swing: MeasuredSwing) -> tuple[Vector, Vector]:
    series = swing.muscle_series
    if series is None:
        return np.zeros(0), np.zeros(0)
    return series.time, np.abs(series.velocity).max(axis=1)


def _tension(swing: MeasuredSwing) -> tuple[Vector, Vector]:
    series = swing.muscle_series
    if series is None:
        return np.zeros(0), np.zeros(0)
    return series.time, series.tension.max(axis=1)


def _overlay(title: str, groups: Sequence[Sequence[tuple[Vector, Vector]]]) -> bytes:
    """Draw each swing thin, and the median of each group thick."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=PANEL_SIZE, layout="constrained")
        axes = figure.subplots()
        for group, colour, dashes, name in zip(groups, GROUPS, _DASHES, "AB", strict=True):
            for time, values in group:
                axes.plot(time, values, color=colour, linewidth=0.8, alpha=0.35)
            _draw_median(axes, group, colour, dashes, f"{name}, {len(group)} swings")
        axes.axvline(0.0, color="#777777", linewidth=0.9, zorder=1)
        axes.set_title(title)
        axes.set_xlabel("time since the swing command [s]")
        axes.legend()
        return svg(figure)


def _draw_median(
    axes: Axes, group: Sequence[tuple[Vector, Vector]], colour: str, dashes: str, label: str
) -> None:
    known = [(time, values) for time, values in group if time.size > 1]
    if not known:
        return
    begin = max(float(time[0]) for time, _ in known)
    end = min(float(time[-1]) for time, _ in known)
    grid = np.linspace(begin, max(end, begin), 400)
    rows = np.array([np.interp(grid, time, values) for time, values in known])
    axes.plot(
        grid, np.median(rows, axis=0), color=colour, linewidth=2.2, linestyle=dashes, label=label
    )
