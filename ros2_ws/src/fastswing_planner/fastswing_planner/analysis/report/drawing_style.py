"""What all drawings look like, and how each joint and muscle is drawn in them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fastswing_planner.analysis.measured_swing import MeasuredSwing

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
PLANNED: Any = (0, (1.2, 1.2))
LIMIT: Any = (0, (9, 4))
_LEAST_SHARE = 0.08
"""A joint with less of the fastest joint's speed is drawn among the others."""
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


def _largest(tables: Iterable[Mapping[str, float]]) -> dict[str, float]:
    largest: dict[str, float] = {}
    for table in tables:
        for name, value in table.items():
            largest[name] = max(largest.get(name, 0.0), np.nan_to_num(value))
    return largest


def _falling(values: Mapping[str, float]) -> list[str]:
    return sorted(values, key=lambda name: -values[name])
