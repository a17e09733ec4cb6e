"""Tables out of a bag's states, which name their joints and muscles in every message."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from fastswing_planner.analysis.recording import plausible
from fastswing_planner.arrays import Matrix, Vector
from fastswing_planner.cdr.columns import Columns


def inside(time: Vector, windows: Sequence[tuple[float, float]]) -> NDArray[np.bool_]:
    """Return which times [s], shape (k,), are within a window, both ends included."""
    chosen = np.zeros(time.shape, dtype=bool)
    if time.size == 0:
        return chosen
    low, high = float(time.min()), float(time.max())
    for begin, end in windows:
        if begin <= high and end >= low:
            chosen |= (time >= begin) & (time <= end)
    return chosen


def names_of(part: Columns) -> tuple[str, ...]:
    """Return the names in the first message; empty without messages."""
    return tuple(part["name"][0]) if part.count else ()


def matrix_of(part: Columns, name: str, names: tuple[str, ...]) -> Matrix:
    """Return a field in the order of `names`, shape (k, len(names)); NaN where it is missing."""
    if name not in part:
        return np.full((part.count, len(names)), np.nan)
    values, titles = part[name], part["name"]
    if (
        values.ndim == 2
        and titles.ndim == 2
        and values.shape == titles.shape
        and tuple(titles[0]) == names
        and bool((titles == titles[0]).all())
    ):
        return plausible(values)
    table = np.full((part.count, len(names)), np.nan)
    place = {title: column for column, title in enumerate(names)}
    for row, (keys, numbers) in enumerate(zip(titles, values, strict=True)):
        if len(keys) == len(numbers):
            for key, number in zip(keys, numbers, strict=True):
                if key in place:
                    table[row, place[key]] = number
    return plausible(table)
