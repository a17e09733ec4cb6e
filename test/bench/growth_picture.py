"""Draws how costs grow."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

Line = Sequence[tuple[float, float]]
"""Points: size, cost."""


def draw(panels: Mapping[str, Mapping[str, Line]], ylabel: str, path: Path) -> None:
    """Draw a panel for each x-axis label, a line for each name in it, on logarithmic axes."""
    figure = Figure(figsize=(4.0 * len(panels), 3.4), layout="constrained")
    FigureCanvasAgg(figure)
    axes = np.atleast_1d(figure.subplots(1, len(panels), sharey=True))
    for axis, (xlabel, lines) in zip(axes, panels.items(), strict=True):
        for name, points in lines.items():
            axis.loglog(*zip(*sorted(points), strict=True), marker="o", label=name)
        sizes = sorted({size for points in lines.values() for size, _ in points})
        axis.set_xticks(sizes, [f"{size:,.0f}" for size in sizes])
        axis.minorticks_off()
        axis.set_xlabel(xlabel)
        axis.grid(alpha=0.3)
    axes[0].set_ylabel(ylabel)
    axes[0].legend()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
