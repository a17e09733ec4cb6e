"""How a muscle is drawn: coloured by its tension; dashed, grey and sagging when it is slack."""

import math

import numpy as np

from fastswing_planner.arrays import Matrix, Vector
from musashi_muscle_bridge.arm_view.shapes import Path

Colour = tuple[float, float, float]

SLACK_COLOUR: Colour = (0.55, 0.55, 0.55)
_SLACKEST, _TIGHTEST = np.array([0.10, 0.35, 0.90]), np.array([0.95, 0.10, 0.05])
_DASH = 0.012  # [m] drawn, and as much left out
_SAG_POINTS = 17
_DOWN = np.array([0.0, 0.0, -1.0])
_SIDEWAYS = np.array([1.0, 0.0, 0.0])
_HALVINGS = 40


def tension_colour(tension: float, limit: float) -> Colour:
    """Return red, green, blue, 0 to 1: from blue at none to red at the limit [N]."""
    share = min(max(tension / limit, 0.0), 1.0)
    red, green, blue = (_SLACKEST + share * (_TIGHTEST - _SLACKEST)).tolist()
    return red, green, blue


def segments(path: Path) -> Matrix:
    """Return the ends of a path's straight parts, shape (2 k, 3)."""
    return np.concatenate([np.repeat(piece, 2, axis=0)[1:-1] for piece in path])


def dashes(path: Path) -> Matrix:
    """Return the ends of the dashes along a path, shape (2 k, 3)."""
    return np.concatenate([_dashed(piece) for piece in path])


def sagging(path: Path, slack: float) -> Path:
    """Return a path that is longer by `slack` [m]: its longest straight part hangs down."""
    piece, part = max(
        ((piece, part) for piece, points in enumerate(path) for part in range(len(points) - 1)),
        key=lambda where: float(_part_length(path[where[0]], where[1])),
    )
    points = path[piece]
    arc = _hanging(points[part], points[part + 1], slack)
    longer = np.concatenate([points[: part + 1], arc, points[part + 1 :]])
    return (*path[:piece], longer, *path[piece + 1 :])


def path_length(path: Path) -> float:
    """Return the length of all pieces [m]."""
    return sum(float(_lengths(piece).sum()) for piece in path)


def _lengths(points: Matrix) -> Vector:
    return np.asarray(np.linalg.norm(np.diff(points, axis=0), axis=1))


def _part_length(points: Matrix, part: int) -> float:
    return float(np.linalg.norm(points[part + 1] - points[part]))


def _dashed(points: Matrix) -> Matrix:
    """Walk along a polyline; dashes bend where it bends."""
    at = np.concatenate([[0.0], np.cumsum(_lengths(points))])
    marks = np.arange(0.0, at[-1], _DASH)
    stops = np.unique(np.concatenate([at, marks]))
    middle = (stops[:-1] + stops[1:]) / 2
    drawn = np.floor(middle / _DASH).astype(int) % 2 == 0
    ends = np.stack([stops[:-1][drawn], stops[1:][drawn]], axis=1).reshape(-1)
    return np.stack([np.interp(ends, at, points[:, axis]) for axis in range(3)], axis=1)


def _hanging(begin: Vector, end: Vector, slack: float) -> Matrix:
    """Return the points between two ends of a wire that is longer than their distance."""
    span = end - begin
    along = span / np.linalg.norm(span)
    down = _DOWN - (_DOWN @ along) * along
    if np.linalg.norm(down) < 0.1:  # an upright wire bulges
        down = _SIDEWAYS - (_SIDEWAYS @ along) * along
    down = down / np.linalg.norm(down)
    depth = _sag_depth(float(np.linalg.norm(span)), slack)
    part = np.linspace(0.0, 1.0, _SAG_POINTS)[1:-1, np.newaxis]
    return np.asarray(begin + part * span + 4 * depth * part * (1 - part) * down)


def _sag_depth(span: float, slack: float) -> float:
    """Return how deep a parabola over `span` hangs that is longer by `slack`; all [m]."""
    low, high = 0.0, span + slack
    for _ in range(_HALVINGS):
        depth = (low + high) / 2
        slope = 4 * depth / span  # at the ends
        length = span / 2 * (math.sqrt(1 + slope * slope) + math.asinh(slope) / slope)
        low, high = (low, depth) if length > span + slack else (depth, high)
    return low
