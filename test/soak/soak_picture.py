"""Draws memory and rates over the time of a soak."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure


def draw(
    times: Sequence[float],
    rss: Mapping[str, Sequence[float]],
    counts: Mapping[str, Sequence[tuple[float, int]]],
    path: Path,
) -> None:
    """Draw resident memory [kB] at `times` [s], and rates out of (time [s], count) pairs."""
    figure = Figure(figsize=(8.0, 6.0), layout="constrained")
    FigureCanvasAgg(figure)
    memory, rate = figure.subplots(2, 1)
    for name, values in rss.items():
        memory.plot([t / 60.0 for t in times], [kb / 1024.0 for kb in values], label=name)
    memory.set_ylabel("resident memory [MB]")
    memory.set_ylim(bottom=0.0)
    memory.legend(ncols=3)
    for name, pairs in counts.items():
        start = pairs[0][0]
        rate.plot(
            [(time - start) / 60.0 for time, _ in pairs[1:]],
            [(b - a) / (late - early) for (early, a), (late, b) in pairwise(pairs)],
            label=name,
            linewidth=0.8,
        )
    rate.set_ylabel("rate [Hz]")
    rate.set_xlabel("time [min]")
    rate.set_ylim(bottom=0.0)
    rate.legend(ncols=3)
    figure.savefig(path, dpi=110)
