"""Draws swings as the paper does: joint speed, muscle speed and muscle tension over time."""

import io
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
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
from fastswing_planner.arrays import Matrix, Vector

# Safe for colour-blind eyes (after Okabe and Ito). Muscles that are paid out are warm and solid,
# muscles that are wound in cool and dashed, so that the groups differ without any colour.
_PAID_OUT = ("#D55E00", "#6A1B4D", "#E69F00", "#CC79A7")
_WOUND_IN = ("#0072B2", "#009E73", "#56B4E9")
_JOINTS = ("#D55E00", "#0072B2", "#009E73", "#CC79A7", "#E69F00")
GROUPS = ("#0072B2", "#D55E00")
"""Colours of the two groups of a comparison."""
OTHER = "#B8B8B8"
SHADE = "#FAF1D2"
_WOUND_IN_DASHES: Any = (0, (5, 1.6))
_PLANNED: Any = (0, (1.2, 1.2))
_LIMIT: Any = (0, (9, 4))
_PATH = re.compile(rb' d="[^"]*"')
_LONG_NUMBER = re.compile(rb"(\d+\.\d\d)\d+")
_LABEL_SHARE = (0.085, 0.07)
"""Width and height of a label, as shares of the axes."""
_LABEL_PLACES = (
    (0.0, 0.75),
    (-0.8, 0.3),
    (0.8, 0.3),
    (0.0, -0.9),
    (-0.9, -0.6),
    (0.9, -0.6),
    (1.0, 1.2),
    (-1.0, 1.2),
    (1.8, 0.2),
    (-1.8, 0.2),
)
"""Where a label may stand from its peak, in its own sizes, the best first."""
_LEAST_SHARE = 0.08
"""A joint with less of the fastest joint's speed is drawn among the others."""
_NEAR_LIMIT = 0.6
"""A limit far above everything measured is not drawn."""
STYLE: dict[Any, Any] = {
    "font.size": 10,
    "axes.titlesize": 11,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.grid": True,
    "grid.color": "#E6E6E6",
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "svg.hashsalt": "fastswing",
    # Points nearer to their line than half a pixel are left out.
    "path.simplify_threshold": 0.5,
}
PANEL_SIZE = (4.8, 3.5)
"""[inch] one panel fills a telephone's screen."""


@dataclass(frozen=True)
class LineStyle:
    """How a joint or muscle is drawn in all figures of a report."""

    colour: str
    dashes: Any = "-"


_TIGHTEST = LineStyle("#4D4D4D")
"""Of the muscle with the largest tension, if it is none of the fast ones."""


def joint_styles(swings: Sequence[MeasuredSwing]) -> dict[str, LineStyle]:
    """Return the styles of the joints that matter, the fastest first."""
    peaks = _largest({joint.name: joint.peak_speed for joint in one.joints} for one in swings)
    fastest = max(peaks.values(), default=0.0)
    chosen = [name for name in _falling(peaks) if peaks[name] > _LEAST_SHARE * fastest]
    return {name: LineStyle(colour) for name, colour in zip(chosen, _JOINTS, strict=False)}


def muscle_styles(swings: Sequence[MeasuredSwing]) -> dict[str, LineStyle]:
    """Return the styles of the fastest muscles: paid out, then wound in, the fastest first."""
    out, back = _paid_out(swings)
    styles = {name: LineStyle(colour) for name, colour in zip(out, _PAID_OUT, strict=False)}
    for name, colour in zip(back, _WOUND_IN, strict=False):
        styles[name] = LineStyle(colour, _WOUND_IN_DASHES)
    return styles


def _paid_out(swings: Sequence[MeasuredSwing]) -> tuple[list[str], list[str]]:
    """Return the muscles that are paid out, and those that are wound in, the fastest first."""
    extremes: dict[str, float] = {}
    for swing in swings:
        if swing.muscle_series is None or swing.muscle_series.time.size == 0:
            continue
        velocity = np.nan_to_num(swing.muscle_series.velocity)
        rows = np.argmax(np.abs(velocity), axis=0)
        for column, name in enumerate(swing.muscle_series.names):
            value = float(velocity[rows[column], column])
            extremes[name] = max(extremes.get(name, 0.0), value, key=abs)
    order = _falling({name: abs(value) for name, value in extremes.items()})
    return (
        [name for name in order if extremes[name] > 0.0],
        [name for name in order if extremes[name] < 0.0],
    )


def _largest(tables: Any) -> dict[str, float]:
    largest: dict[str, float] = {}
    for table in tables:
        for name, value in table.items():
            largest[name] = max(largest.get(name, 0.0), np.nan_to_num(value))
    return largest


def _falling(values: Mapping[str, float]) -> list[str]:
    return sorted(values, key=lambda name: -values[name])


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
                axes.step(
                    plan.time, velocity, where="pre", color=colour, lw=1.2, linestyle=_PLANNED
                )
    _finish(axes, swing, "joint speed [rad/s]")
    if labelled:
        _label(axes, series.time, series.velocity, series.names, styles)


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
            axes.axhline(sign * limit, color="black", linewidth=1.0, linestyle=_LIMIT)
    _finish(axes, swing, "muscle speed [m/s]")
    if labelled and series is not None:
        _label(axes, series.time, series.velocity, series.names, styles)


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
                    axes.axhline(limit, color="black", linewidth=1.0, linestyle=_LIMIT)
    _finish(axes, swing, "muscle tension [N]")
    axes.set_ylim(bottom=0.0)
    if labelled and series is not None:
        _label(axes, series.time, series.tension, series.names, shown)


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


def _label(
    axes: Axes,
    time: Vector,
    values: Matrix,
    names: Sequence[str],
    styles: Mapping[str, LineStyle],
) -> None:
    """Write the names beside the peaks of their lines, where there is room; values (k, n)."""
    peaks = []
    for name, line in zip(names, values.T, strict=True):
        if name in styles and np.isfinite(line).any():
            row = int(np.nanargmax(np.abs(line)))
            peaks.append((abs(float(line[row])), name, (float(time[row]), float(line[row]))))
    to_share = axes.transData + axes.transAxes.inverted()
    taken: list[tuple[float, float]] = []
    for _, name, peak in sorted(peaks, reverse=True):
        place = _free_place(tuple(to_share.transform(peak)), peak[1] < 0.0, taken)
        taken.append(place)
        axes.text(
            *place,
            name,
            transform=axes.transAxes,
            color=styles[name].colour,
            fontsize=9,
            fontweight="bold",
            ha="center",
            va="center",
            zorder=4,
            bbox={"facecolor": "white", "alpha": 0.7, "edgecolor": "none", "pad": 0.5},
        )


def _free_place(
    peak: tuple[float, ...], below: bool, taken: Sequence[tuple[float, float]]
) -> tuple[float, float]:
    """Return the place of a label near a peak, all as shares of the axes; as free as possible."""
    across, up = _LABEL_SHARE
    side = -1.0 if below else 1.0
    tries = [
        (peak[0] + right * across, peak[1] + side * high * up) for right, high in _LABEL_PLACES
    ]
    inside = [place for place in tries if 0.02 < place[0] < 0.99 and 0.02 < place[1] < 1.0]
    for x, y in inside:
        if all(abs(x - left) >= across or abs(y - low) >= up for left, low in taken):
            return x, y
    x, y = (inside or tries)[0]
    return min(max(x, 0.02), 0.98), min(max(y, 0.02), 0.98)


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


def svg(figure: Figure) -> bytes:
    """Return a figure as SVG that is the same for the same input."""
    stream = io.BytesIO()
    figure.savefig(stream, format="svg", metadata={"Date": None})
    return shortened(stream.getvalue())


def shortened(picture: bytes) -> bytes:
    """Return an SVG whose paths have two decimals: finer than any screen, and a quarter smaller.

    All other numbers, such as the scales of letters, stay as they are.
    """
    return _PATH.sub(lambda path: _LONG_NUMBER.sub(rb"\1", path[0]), picture)


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
        handles.append(_line("black", _PLANNED, "plan"))
    if panel != "joint" and limits:
        handles.append(_line("black", _LIMIT, "limit"))
    if swing.inhibited:
        handles.append(Patch(color=SHADE, label="inhibited"))
    if np.isfinite(swing.arrival):
        handles.append(_line("#777777", ":", "arrived"))
    return handles


def _line(colour: str, dashes: Any, label: str) -> Line2D:
    return Line2D([], [], color=colour, linewidth=1.1, linestyle=dashes, label=label)
