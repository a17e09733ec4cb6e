"""Names of lines beside their peaks, where there is room."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes

from fastswing_planner.analysis.report.drawing_style import LineStyle
from fastswing_planner.arrays import Matrix, Vector

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


def label_peaks(
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
