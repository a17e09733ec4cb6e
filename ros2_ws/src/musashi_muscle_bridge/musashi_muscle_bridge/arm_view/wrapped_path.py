"""How a muscle lies around a cylinder or a ball."""

import numpy as np

from fastswing_planner.arrays import Matrix, Vector

_STEP = 0.1  # [rad] between drawn points; 0.04% shorter than the arc
_ROUND = 2 * np.pi
_JUST_TOUCHING = 0.2  # [rad] less than a whole turn: round-off made it nothing, not a turn


def wrapped_arc(before: Vector, begin: Vector, end: Vector, cylinder: bool) -> Matrix:
    """Return the points between `begin` and `end` on the surface, without both, shape (k, 3).

    All in the geom's frame [m], shape (3,). The path comes straight from `before`, and goes on
    around the axis in the direction in which it arrives: never backwards, though that may be
    shorter.

    cylinder  whether the axis is z, and the path climbs evenly along it; otherwise a great circle
    """
    arrival = begin - before
    if cylinder:
        across = np.array([1.0, 1.0, 0.0])
        axis = np.array([0.0, 0.0, np.sign(np.cross(begin * across, arrival * across)[2])])
    else:
        across = np.ones(3)
        axis = np.cross(begin, arrival)
    length = np.linalg.norm(axis)
    if length == 0.0:
        return np.zeros((0, 3))
    axis = axis / length
    angle = _angle(begin * across, end * across, axis)
    count = int(np.ceil(angle / _STEP))
    parts = np.linspace(0.0, 1.0, count + 1)[1:-1, np.newaxis]
    # Rodrigues' formula for a vector at right angles to the axis.
    radius = begin * across
    turned = np.cos(parts * angle) * radius + np.sin(parts * angle) * np.cross(axis, radius)
    along = (end - begin) * (1.0 - across)
    return np.asarray(turned + begin * (1.0 - across) + parts * along)


def _angle(begin: Vector, end: Vector, axis: Vector) -> float:
    """Return the angle [rad] from one radius to the other around the axis, 0 to 2 pi."""
    angle = float(np.arctan2(axis @ np.cross(begin, end), begin @ end)) % _ROUND
    return 0.0 if angle > _ROUND - _JUST_TOUCHING else angle
