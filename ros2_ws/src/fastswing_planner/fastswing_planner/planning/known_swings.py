"""Swings of one arm between two postures with one mask after the other."""

from collections.abc import Callable

import numpy as np

from fastswing_planner.arrays import BoolVector
from fastswing_planner.planning.swing import Trajectory, shared_step_count

_MOST_REMEMBERED = 256  # of about 10 kB each


class KnownSwings:
    """Simulates what the swings known so far do not tell.

    A mask's swing begins as that of a mask which keeps one muscle more, up to the step in which
    that muscle holds it back; often that is all of it.
    """

    def __init__(self, simulate: Callable[[BoolVector, Trajectory | None], Trajectory]) -> None:
        """`simulate` returns the swing of a mask, given one with more muscles kept or None."""
        self._simulate = simulate
        self._known: dict[bytes, Trajectory] = {}

    def swing(self, kept: BoolVector) -> Trajectory:
        """Return the swing with the kept muscles, shape (m,); raises what `simulate` raises."""
        known = self._known.get(kept.tobytes())
        if known is not None:
            return known
        trajectory = self._simulate(kept, self._most_alike(kept))
        if len(self._known) == _MOST_REMEMBERED:
            del self._known[next(iter(self._known))]
        self._known[kept.tobytes()] = trajectory
        return trajectory

    def _most_alike(self, kept: BoolVector) -> Trajectory | None:
        everything = np.ones_like(kept)
        masks = [everything, *(_with(kept, muscle) for muscle in np.flatnonzero(~kept).tolist())]
        alike = [self._known[mask.tobytes()] for mask in masks if mask.tobytes() in self._known]
        return max(alike, key=lambda one: shared_step_count(one, kept), default=None)


def _with(kept: BoolVector, muscle: int) -> BoolVector:
    more = kept.copy()
    more[muscle] = True
    return more
